"""Networks: encoders of observations, heads and distributions of policies, random changes of frames.

Names are imported from the modules, so that the code that a run is resumed under is only the code that it executes.
"""
