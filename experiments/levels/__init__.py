"""What the settings of levels, task and observation stand for: builders, variations, conditions.

The room may import segar, segar.experiments.settings and segar.experiments.commands. Others use its modules by name:
``builders`` to make levels and environments, ``variations`` for named changes to a distribution.
"""
