"""The compiled engine: the compiler makes a kernel of a world, the runtime is what kernels call, the simulator steps batches."""
