"""A package of a user's own: wind as physics, with levels, a task, an observation and a learner."""
