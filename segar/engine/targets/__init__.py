"""Kernels for other targets than this processor with threads: WebAssembly, object files."""
