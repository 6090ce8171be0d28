"""The experiments of the paper: their files, the plan of runs, the pool of processes that carries it out, and its display."""
