"""Make the sets of textures that come with SEGAR, and say how well factors can be read from them.

A set with a model below the bars of :mod:`experiments.textures.texture_bars` is not written; the message names the model
and the factor.

python -m experiments.make_textures                     # all sets, into segar/textures/data
python -m experiments.make_textures one --into /tmp     # one of them, elsewhere
python -m experiments.make_textures --only-table        # of the sets that are there
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from experiments.textures.filter_sets import filter_sets
from experiments.textures.linear_autoencoder import Training, train_set
from experiments.textures.texture_bars import refuse_below_bars
from segar.textures import DATA, UNIFORM, TextureSet, family_laws, is_noise, linear_read_out

# Sets share no seed, so that one can be trained on and another be tested on.
FILTER_SETS = ("baseline", "close", "far")
LINEAR_SETS = {"one": range(1), "five": range(1, 6), "twenty": range(6, 26)}
ROW = "| {:14} | {:>6} | {:>18} | {:>18} |"


def main(arguments: list[str] | None = None) -> None:
    """The command; ``arguments`` instead of those of the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.make_textures", description="Make the sets of textures that come with SEGAR."
    )
    parser.add_argument(
        "sets", nargs="*", choices=[*LINEAR_SETS, *FILTER_SETS, []], help="sets to make; all by default"
    )
    parser.add_argument("--into", type=Path, default=DATA, help="folder to write to")
    parser.add_argument("--only-table", action="store_true", help="make nothing, measure what is there")
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)  # the models are small, and threads would only wait for each other
    for name in chosen.sets or (*LINEAR_SETS, *FILTER_SETS):
        path = chosen.into / f"{name}.npz"
        if not chosen.only_table:
            chosen.into.mkdir(parents=True, exist_ok=True)
            made = filter_sets()[name] if name in FILTER_SETS else train_set(name, LINEAR_SETS[name], Training())
            refuse_below_bars(made)
            made.save(path)
        found = TextureSet.load(path)
        print(f"\n{table(found)}", flush=True)
        refuse_below_bars(found)


def table(textures: TextureSet) -> str:
    """Error of reconstruction of each input by a linear read-out: share of the variance, mean and worst over models."""
    laws = {"uniform": UNIFORM, "families": {**UNIFORM, **family_laws()}}
    errors: dict[str, dict[str, list[float]]] = {}
    for which, law in laws.items():
        for model in range(len(textures)):
            found = linear_read_out(textures, model, rng=np.random.default_rng(0), laws=law)
            for name, share in found.items():
                errors.setdefault(name, {}).setdefault(which, []).append(1.0 - share)
    lines = [ROW.format(textures.name, "models", *(f"{which} marginals" for which in laws)), "|---|---|---|---|"]
    for name, by_law in errors.items():
        cells = [_cell(by_law[which]) if which in by_law else "constant" for which in laws]
        lines.append(ROW.format(f"*{name}*" if is_noise(name) else name, len(textures), *cells))
    return "\n".join(lines)


def _cell(errors: list[float]) -> str:
    return f"{np.mean(errors):.1%}" if len(errors) == 1 else f"{np.mean(errors):.1%} (to {np.max(errors):.1%})"


if __name__ == "__main__":
    main()
