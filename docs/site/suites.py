"""The site's cards of suites: pictures of training and test, what differs, distances, certificates, results of methods.

``python docs/site/suites.py`` writes them to ``build/site-source/suites``.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pandas as pd
from environments import GAP, SIDE, draw, table
from measure import CARDS
from PIL import Image
from playgrounds import BUILD

from segar.analysis.benchmark.leaderboard_page import rows_on
from segar.envs import VectorEnv
from segar.experiments.benchmarking.protocol import SHIPPED
from segar.levels import Levels
from segar.observations import TexturedPixels
from segar.suites import AXES, Suite, suite, suites

FOLDER = BUILD / "site-source" / "suites"
SCORES = SHIPPED / "scores.csv"
PICTURES = 4  # levels of each side
SEED = 1  # of the training levels
RESULTS = """Means over the seeds of each row. *Score*: a ratio of means over levels, 0 where the mean return is that of the
better of idle and random play on each level, 1 where it is the planner's. *Regret*: what the return on test levels lacks of
the planner's.
[The leaderboard](../results/benchmark/leaderboard.md) says what the rows are, and has intervals."""

PAGE = """# {name}

{says}

| axis | kind of difference | training levels | test levels |
|---|---|---|---|
| {axis} | {shift} | {training_levels} | {test_levels} |

![Training levels of {name}]({name}-train.png)

Training levels of seed 1, each drawn from the training distribution.

![Test levels of {name}]({name}-test.png)

The first of the frozen test levels.

## What differs

{differs}

{hidden}

## How far apart training and test are

The exact W2 distance of the test levels to the training levels of seed 1 is {w2:.3g}, and it is made of:

{w2_by_factor}

Parts of factors that do not differ come from having few levels. The Kolmogorov-Smirnov statistic of the two distributions is
{ks:.3g}, exactly. It is above 0 in:

{ks_by_factor}

{unseen}{shared}

## What certifies it

{certificates}

Of the levels that were drawn for the test, {unsolved} were left out because the planner found no way to solve them.

## Results

{results}

## Play against an agent

```sh
segar playground {name} --policy {row} -o page.html
```

[A match against an agent](../how-to/show-a-world-in-a-browser.md#a-match-against-an-agent) says how it is played.

## Train on it

```sh
segar train suite={name} seed=1 levels.seed=1
```

```python
train = gymnasium.make_vec("Segar/{name}-train-{observation}", num_envs=64, vectorization_mode="vector_entry_point")
test = gymnasium.make("Segar/{name}-test-{observation}")
```

[Compare on a suite](../how-to/compare-on-a-suite.md) says more. `segar suites {name}` prints the numbers of this page.

## Hashes

{hashes}
"""

INDEX = """# Suites

{number} suites over {axes} axes: each has a distribution of training levels, another one of the test, and frozen test levels.
[Compare on a suite](../how-to/compare-on-a-suite.md) says how they are used.

{groups}
```{{toctree}}
:hidden:

{pages}
```
"""


def write_suites() -> None:
    """Write a card for every suite, and their index."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    with ProcessPoolExecutor() as pool:
        for name, page in zip(suites(), pool.map(card_page, suites()), strict=True):
            (FOLDER / f"{name}.md").write_text(page, encoding="utf-8")
    (FOLDER / "index.md").write_text(index_page(), encoding="utf-8")


def card_page(name: str) -> str:
    """The card of a suite, whose pictures are written beside it."""
    one = suite(name)
    for side, levels in (("train", one.sample(SEED)[:PICTURES]), ("test", one.test_levels[:PICTURES])):
        sheet = FOLDER / f"{name}-{side}.png"
        if one.textures:
            draw_textures(levels, one.textures[side == "test"], sheet)
        else:
            draw(levels, sheet, FOLDER / f"{name}-{side}-first.png")
    told = json.loads(CARDS.read_text(encoding="utf-8")).get(name, {})
    if told.get("hash") != one.hash:
        raise SystemExit(f"{CARDS} has no card of {name} as it is now: run docs/site/measure.py")
    return page_of(one, told)


def page_of(one: Suite, told: Mapping[str, Any]) -> str:
    """The text of a card."""
    differs = [(f"`{name}`", words) for name, words in told["differs"].items()]
    nothing = "Nothing: training and test have one distribution, and the question is what few training levels teach."
    unseen = "".join(f"Not seen by W2: {text}.\n\n" for text in told["unseen"])
    certificates = [
        ("the planner, by its plans", f"{told['solved_by_planner']:.3f}"),
        ("doing nothing", f"{told['solved_by_idle']:.3f}"),
        ("random actions", f"{told['solved_by_random']:.3f}"),
    ]
    plain = {
        key: told[key]
        for key in ("name", "says", "axis", "shift", "training_levels", "test_levels", "w2", "ks", "unsolved")
    }
    return PAGE.format(
        **plain,
        differs=table(("group", "in words"), differs) if differs else nothing,
        hidden=f"Hidden from observations of states: {told['hidden']}. Textures: {told['textures']}.",
        w2_by_factor=table(
            ("factor", "share of squared W2"), [(f"`{k}`", f"{v:.3f}") for k, v in told["w2_by_factor"].items()]
        ),
        ks_by_factor=table(("marginal", "KS"), [(f"`{k}`", f"{v:.3f}") for k, v in told["ks_by_factor"].items()])
        if told["ks_by_factor"] else "none.",
        unseen=unseen,
        shared="" if told["shared_probability"] is None else (
            f"A test level would be among {one.training_levels} training levels with a probability of"
            f" {told['shared_probability']:.2g}; training leaves such levels out."
        ),
        certificates=table(("player", "share of test levels solved"), certificates),
        results=results_of(one),
        observation="rgb" if one.textures else "state",
        row="ppo_fast-rgb_stack2-laptop" if one.textures else "ppo_fast-state-laptop",
        hashes=table(("part", "hash"), [("suite", f"`{one.hash}`"), *((k, f"`{v}`") for k, v in told["hashes"].items())]),
    )  # fmt: skip


def results_of(one: Suite) -> str:
    """What methods achieve on a suite, by the shipped rows that played this version of it."""
    scores = pd.read_csv(SCORES)
    played = scores.loc[scores["suite_hash"] == one.hash]
    if played.empty:
        return "There are no results of methods on this suite yet."
    return f"{RESULTS}\n\n{rows_on(one.name, played)}"


def draw_textures(levels: Levels, textures: str, sheet: Path) -> None:
    """Write the frames that an agent sees, side by side."""
    env = VectorEnv(levels, len(levels), observation=TexturedPixels(textures), seed=0)
    frames, _ = env.reset(options={"levels": list(range(len(levels)))})
    step = SIDE + GAP
    image = Image.new("RGBA", (len(levels) * step - GAP, SIDE))
    for k, frame in enumerate(frames):
        image.paste(Image.fromarray(frame).resize((SIDE, SIDE), Image.Resampling.NEAREST), (k * step, 0))
    image.quantize(256, dither=Image.Dither.NONE).save(sheet, optimize=True)


def index_page() -> str:
    """The index, axis by axis."""
    groups = ""
    for axis, words in AXES.items():
        members = [suite(name) for name in suites() if suite(name).axis == axis]
        rows = [(f"[{one.name}]({one.name}.md)", one.shift, one.says) for one in members]
        groups += f"## {axis}: {words}\n\n{table(('suite', 'difference', 'what differs'), rows)}\n\n"
    return INDEX.format(number=len(suites()), axes=len(AXES), groups=groups, pages="\n".join(suites()))


if __name__ == "__main__":
    write_suites()
