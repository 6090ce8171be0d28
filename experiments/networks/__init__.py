"""Networks: encoders of observations, heads and distributions of policies, random changes of frames.

Authors of algorithms import from here. The modules of ``experiments`` name the file instead, so that the code that a run is
resumed under is only the code that it executes.
"""

from segar.experiments.networks.augmentations import (
    greyscale,
    random_colour_jitter,
    random_convolution,
    random_crop,
    random_cutout,
    random_flip,
    random_intensity,
    random_rotation,
    random_shift,
)
from segar.experiments.networks.devices import usable_device
from segar.experiments.networks.encoders import MLP, FrameEncoder, initialize, make_encoder
from segar.experiments.networks.policies import Actor, SquashedNormal, actions_of, make_head, representation_of

__all__ = [
    "MLP", "Actor", "FrameEncoder", "SquashedNormal", "actions_of", "greyscale", "initialize", "make_encoder",
    "make_head", "random_colour_jitter", "random_convolution", "random_crop", "random_cutout", "random_flip",
    "random_intensity", "random_rotation", "random_shift", "representation_of", "usable_device",
]  # fmt: skip
