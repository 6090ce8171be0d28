"""Frames of the arena from above, in solid colours or textures."""
