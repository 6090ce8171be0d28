"""A table of runs as the main grid leaves it, with effects that a test chooses."""

import pandas as pd

FAMILIES, DIFFICULTIES = ("empty", "objectsx1", "tilesx1"), ("easy", "medium", "hard")
# W2 (reference) between n training levels and 100 test levels, means over 5 seeds: EXPERIMENTS.md, 2.7.
W2 = {
    "empty-easy": (0.187, 0.082, 0.054, 0.047, 0.055),
    "empty-medium": (0.330, 0.173, 0.118, 0.106, 0.104),
    "empty-hard": (0.505, 0.307, 0.208, 0.188, 0.178),
    "objectsx1-easy": (0.312, 0.219, 0.163, 0.147, 0.139),
    "objectsx1-medium": (0.449, 0.271, 0.222, 0.206, 0.198),
    "objectsx1-hard": (0.539, 0.365, 0.294, 0.277, 0.269),
    "tilesx1-easy": (0.504, 0.249, 0.181, 0.152, 0.142),
    "tilesx1-medium": (0.564, 0.291, 0.212, 0.199, 0.185),
    "tilesx1-hard": (0.664, 0.437, 0.355, 0.328, 0.317),
}
COUNTS = (1, 10, 50, 100, 200)


def grid(rng, seeds=1, slope=-1.0, noise=0.2, panel_sd=0.0, block_sd=0.0, seed_sd=0.0, scatter=0.02):
    """Nine panels x five n x seeds; gap = slope x W2 + panel + seed + (panel, seed) + noise."""
    rows = []
    of_seed = rng.normal(scale=seed_sd, size=seeds)
    for name, means in W2.items():
        family, difficulty = name.split("-")
        of_panel = rng.normal(scale=panel_sd)
        for seed in range(seeds):
            shared = of_panel + of_seed[seed] + rng.normal(scale=block_sd)
            for n, mean in zip(COUNTS, means, strict=True):
                w2 = mean + rng.normal(scale=scatter)
                gap = slope * w2 + shared + rng.normal(scale=noise)
                rows.append({"family": family, "difficulty": difficulty, "n": n, "seed": seed, "w2": w2, "gap": gap})
    return pd.DataFrame(rows)
