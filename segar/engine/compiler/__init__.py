"""From a layout, a world and a task to the source of one compiled module."""
