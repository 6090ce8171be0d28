"""How the shipped sets of textures are made: filter banks, linear auto-encoders, and the bars that both must meet."""
