"""Kernels on NVIDIA GPUs through the driver's own library. Nothing is loaded before it is asked for."""
