"""The reference interpreter: the same rules as plain Python, which the kernels are held against."""

__all__ = []
