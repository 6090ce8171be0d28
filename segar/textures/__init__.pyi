from .filter_bank import FilterBank
from .filter_clusters import (
    FilterClusters as FilterClusters,
    cluster_costs as cluster_costs,
    filter_textures,
)
from .inputs import NOISE_CLIP as NOISE_CLIP, is_noise as is_noise
from .layout_inputs import type_inputs as type_inputs
from .standard import (
    INPUTS as INPUTS,
    UNIFORM as UNIFORM,
    Laws as Laws,
    linear_read_out,
    product_of_marginals as product_of_marginals,
    require_laws as require_laws,
)
from .texture_sets import TextureSet, hidden_inputs as hidden_inputs, shipped_sets as shipped_sets

__all__ = ["FilterBank", "TextureSet", "filter_textures", "linear_read_out"]
