"""Collecting experience: collectors of rollouts, the replay of off-policy learners, and rewards as learners see them.

Names are imported from the modules, so that the code that a run is resumed under is only the code that it executes.
"""
