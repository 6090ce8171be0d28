"""Textures: patterns that show factors, as sets of models whose differences can be measured."""

from segar.textures.filter_bank import FilterBank
from segar.textures.filter_clusters import (
    FilterClusters,
    aligned,
    cluster_costs,
    cluster_filters,
    filter_patterns,
    filter_textures,
)
from segar.textures.inputs import BACKGROUND, NOISE, NOISE_CLIP, is_noise, name_of_input
from segar.textures.layout_inputs import TypeInputs, type_inputs
from segar.textures.measures import CHIEF, KINDS, linear_read_out, look_distances, looks
from segar.textures.standard import INPUTS, UNIFORM, Laws, product_of_marginals, units
from segar.textures.texture_sets import DATA, TextureSet, shipped_sets

__all__ = [
    "BACKGROUND", "CHIEF", "DATA", "INPUTS", "KINDS", "NOISE", "NOISE_CLIP", "UNIFORM", "FilterBank",
    "FilterClusters", "Laws", "TextureSet", "TypeInputs", "aligned", "cluster_costs", "cluster_filters",
    "filter_patterns", "filter_textures", "is_noise", "linear_read_out",
    "look_distances", "looks", "name_of_input", "product_of_marginals", "shipped_sets", "type_inputs",
    "units",
]  # fmt: skip
