"""Networks that act, without torch: their layers and weights as plain data, and a compiled forward pass.

Its products and sums have one order, so that actions are the same bits on every processor. The room knows no
environments. Other rooms, and ``experiments``, use the names below.
"""

from segar.policies.layers import Layer
from segar.policies.network import NETWORK_FILE, Network
from segar.policies.network_policy import NetworkPolicy

__all__ = ["NETWORK_FILE", "Layer", "Network", "NetworkPolicy"]
