"""The built-in tasks, and tasks by name."""
