"""Textures: patterns that show factors, as sets of models whose differences can be measured."""

from segar.textures.filter_bank import FilterBank
from segar.textures.filter_clusters import (
    FilterClusters,
    aligned,
    cluster_costs,
    cluster_filters,
    filter_patterns,
    filter_textures,
    filter_weights,
    texture_set,
)
from segar.textures.inputs import BACKGROUND, NOISE, NOISE_CLIP, is_noise, name_of_input
from segar.textures.layout_inputs import TypeInputs, type_inputs
from segar.textures.measures import CHIEF, EXTREMES, KINDS, linear_read_out, look_distances, looks
from segar.textures.standard import INPUTS, UNIFORM, Laws, family_laws, product_of_marginals, units
from segar.textures.texture_sets import DATA, TextureSet, shipped_sets

__all__ = [
    "BACKGROUND", "CHIEF", "DATA", "EXTREMES", "INPUTS", "KINDS", "NOISE", "NOISE_CLIP", "UNIFORM", "FilterBank",
    "FilterClusters", "Laws", "TextureSet", "TypeInputs", "aligned", "cluster_costs", "cluster_filters",
    "family_laws", "filter_patterns", "filter_textures", "filter_weights", "is_noise", "linear_read_out",
    "look_distances", "looks", "name_of_input", "product_of_marginals", "shipped_sets", "texture_set", "type_inputs",
    "units",
]  # fmt: skip
