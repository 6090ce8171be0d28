"""Textures: patterns that show factors, as sets of models whose differences can be measured."""

from segar.textures.contrast import look_distances
from segar.textures.filter_bank import FilterBank
from segar.textures.filter_clusters import filter_textures
from segar.textures.inputs import BACKGROUND, NOISE, TypeInputs, type_inputs
from segar.textures.read_out import linear_read_out
from segar.textures.samples import product_of_marginals
from segar.textures.texture_set import TextureSet, shipped_sets

__all__ = [
    "BACKGROUND",
    "NOISE",
    "FilterBank",
    "TextureSet",
    "TypeInputs",
    "filter_textures",
    "linear_read_out",
    "look_distances",
    "product_of_marginals",
    "shipped_sets",
    "type_inputs",
]
