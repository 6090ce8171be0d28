"""Textures: patterns that show factors, as sets of models whose differences can be measured."""

from segar.textures.inputs import BACKGROUND, NOISE, TypeInputs, type_inputs
from segar.textures.texture_set import TextureSet, shipped_sets

__all__ = ["BACKGROUND", "NOISE", "TextureSet", "TypeInputs", "shipped_sets", "type_inputs"]
