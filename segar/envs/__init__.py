"""Environments: the batched core, and the interfaces of Gymnasium, TorchRL and Stable-Baselines3 to it.

The room puts engine, levels, tasks, observations and rendering together. Other rooms use the names below.
"""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
