from .layers import Layer
from .network import NETWORK_FILE as NETWORK_FILE, Network
from .network_policy import NetworkPolicy
from .onnx_policy import OnnxPolicy
from .shipped import load

__all__ = ["Layer", "Network", "NetworkPolicy", "OnnxPolicy", "load"]
