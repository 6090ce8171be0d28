"""How the shipped sets of textures are made."""
