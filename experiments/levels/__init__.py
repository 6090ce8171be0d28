"""What the settings of levels, task and observation stand for: builders, variations, conditions, mixed levels.

The room may import segar, experiments.settings and experiments.commands. Others use its modules by name: ``builders`` to make
levels and environments, ``variations`` for named changes to a distribution, ``mixed_levels`` for levels between two sets.
"""
