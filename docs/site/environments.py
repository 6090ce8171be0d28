"""The site's pages of the named level distributions: pictures, entities, distributions of factors, sizes, hardness.

``python docs/site/environments.py`` writes them to ``build/site-source/environments``, and the playgrounds that they frame
to ``build/site-playgrounds/environments``. It plays some episodes, for which it compiles nothing with ``SEGAR_PATIENCE=1000``.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
from collections.abc import Collection, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from pathlib import Path
from typing import Any

import measure
import numpy as np
import pandas as pd
from PIL import Image
from playgrounds import BUILD, PLAYGROUNDS, frame

import segar
from segar.cli import main as run_segar
from segar.evaluation import Scripted, play_episodes
from segar.language import Factor, Parameter, all_subclasses
from segar.levels import TASK_LEVELS, Levels
from segar.playground import aim_of, make_playground, together
from segar.rendering import View
from segar.support import aligned
from segar.tasks import task_of

FOLDER = BUILD / "site-source" / "environments"
FRAMED = PLAYGROUNDS / FOLDER.name
PICTURES, ACROSS = 8, 4  # levels that a page shows, and how many side by side
SIDE, GAP = 256, 8  # [px] of a picture, and between pictures
MOVING, QUALITY, MOST_FRAMES = 256, 60, 40  # [px] of a moving level, percent, and pictures
STEP_TIME, LAST_TIME = 100, 1500  # [ms] of its pictures, and of the last one
PLAYED = 100  # levels of a playground
PLAYERS = {"random": "random actions", "scripted": "the scripted player", "oracle": "the planner"}
UNITS = {kind.__name__: kind.unit for base in (Factor, Parameter) for kind in all_subclasses(base)}
LONG_NUMBER = re.compile(r"-?\d+\.\d{7,}")

PAGE = """# {name}

{aim}
{moving}
{summary}

![The first levels of {name}, drawn for people]({name}.png)

The first {pictures} training levels of seed 0. [Render](../how-to/render.md) says what the marks mean.
{playground}
## Use it

```python
levels = segar.family("{name}").sample(100, seed=0, split="train")
env = segar.envs.VectorEnv(levels, num_envs=64, observation="state", seed=0)
```

```sh
{commands}
```

## Entities

{entities}

## Factors that vary

![The densities of all factors of {name} that vary]({name}-marginals.png)

{varying}

## Hardness without training

{hardness}

Success on {measured} test levels, with Wilson's interval of 95 %, and the mean number of steps where the level was solved.
Random actions played each level {plays} times. [Measure hardness](../how-to/measure-hardness.md) says what the players do.

## Factors and parameters that are constant

{constant}
"""

MOVES = """
```{{raw}} html
<picture><source media="(prefers-reduced-motion: reduce)" srcset="{name}-still.webp"><img src="{name}-moving.webp"
alt="the scripted player plays a level of {name}" width="{size}" height="{size}"></picture>
```
"""

COMMANDS = {
    "segar sample {name} -n 100 --seed 0 -o levels.npz": "write levels into a file",
    "segar hardness levels.npz": "how hard each level is",
    "segar describe {name} -o marginals.png": "the tables and the figure below",
    "segar play {name}": "hit the ball with the mouse",
    "segar record {name} -o film.mp4 --policy script": "a video of the scripted player",
}

INDEX = """# Environments

SEGAR names {number} level distributions. Each page shows levels, the distribution of every factor, how large the
environment is, and how hard its levels are before anything is trained. [Factors, entities and
parameters](../reference/factors-and-entities.md) says what the families differ in; [define a
distribution](../how-to/define-a-distribution.md) how you write your own.

{groups}
```{{toctree}}
:hidden:

{pages}
```
"""


def write_environments() -> None:
    """Write a page for every named distribution, and their index."""
    for folder in (FOLDER, FRAMED):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    names = [*segar.families(), *TASK_LEVELS]
    alike = [[*members] for _, members in groupby(names, key=lambda name: name.rpartition("-")[0])]
    with ProcessPoolExecutor() as pool:
        list(pool.map(write_pages, alike))
    (FOLDER / "index.md").write_text(index_page(names), encoding="utf-8")


def write_pages(names: Sequence[str]) -> None:
    """Write the pages of distributions which share a kernel, one after the other, so that it is compiled once."""
    for name in names:
        (FOLDER / f"{name}.md").write_text(environment_page(name), encoding="utf-8")


def environment_page(name: str) -> str:
    """The page of a distribution, whose pictures are written beside it."""
    distribution = segar.family(name)
    levels = distribution.sample(PICTURES, seed=0, split="train")
    draw(levels, FOLDER / f"{name}.png", FOLDER / f"{name}-first.png")
    described = answer_of("describe", name, "-o", str(FOLDER / f"{name}-marginals.png"))
    rows = shared_rows(described["marginals"])
    return PAGE.format(
        name=name,
        aim=aim_of(levels),
        moving=moving_level(levels, name),
        summary=summary_of(levels, {row[1] for row in rows if row[0]}),
        commands=aligned([(command.format(name=name), f"# {use}") for command, use in COMMANDS.items()]),
        pictures=PICTURES,
        playground=playground_of(name),
        entities=table(("entity", "type", "probability"), [entity_row(*one) for one in described["entities"].items()]),
        varying=table(
            ("factor", "of", "distribution", "mean", "sd", "range", "unit"), [row[1:] for row in rows if row[0]]
        ),
        constant=table(("factor", "of", "value", "unit"), [(r[1], r[2], r[4] or r[3], r[7]) for r in rows if not r[0]]),
        hardness=hardness_table(name),
        measured=measure.LEVELS,
        plays=measure.PLAYS,
    )


def index_page(names: Sequence[str]) -> str:
    """The index: the first level of each distribution, task by task."""
    tasks = list(dict.fromkeys(name.rpartition("-")[0] if name in segar.families() else "tasks" for name in names))
    groups = ""
    for task in tasks:
        members = [name for name in names if name.rpartition("-")[0] == task] if task != "tasks" else [*TASK_LEVELS]
        title = task if task != "tasks" else "Levels of the tasks"
        cells = "\n\n".join(f"[![a level of {name}]({name}-first.png)<br>{name}]({name}.md)" for name in members)
        groups += f"## {title}\n\n````{{container}} gallery\n{cells}\n````\n\n"
    return INDEX.format(number=len(names), groups=groups, pages="\n".join(names))


def playground_of(name: str) -> str:
    """A frame with the playground of a distribution, written beside its page; for most, the command that makes it.

    A playground has machine code of its own, which takes half a minute to compile: one of each kind is framed.
    """
    if not (name.endswith(("empty-hard", "x1-hard")) or name in TASK_LEVELS):
        return (
            f"\n## Play it\n\n`segar playground {name} -o page.html` makes a page in which you can play these levels.\n"
        )
    file = f"{name}-playground.html"
    page = make_playground(segar.family(name).sample(PLAYED, seed=0, split="train"), title=name)
    page.save(FRAMED / file)
    return f"\n## Play it\n{frame(file, name)}"


def moving_level(levels: Levels, name: str) -> str:
    """The level that takes the scripted player longest, again and again; it stands for readers who ask for less motion."""
    view, player = View(size=MOVING, labels=False, line=False), Scripted()
    played = play_episodes(levels, np.arange(len(levels)), player, seed=0)
    chosen = np.argmax(np.where(played.success, played.length, 0))
    env = segar.envs.VectorEnv(levels, 1, render_mode="rgb_array", view=view, seed=0, autoreset_mode="Disabled")
    observations, _ = env.reset(seed=0, options={"levels": np.array([chosen])})
    player.begin(env)
    frames, over = [picture_of(env)], False
    while not over:
        observations, _, terminated, truncated, _ = env.step(player(observations))
        over = bool(terminated[0] or truncated[0])
        frames.append(picture_of(env))
    frames[0].save(FRAMED / f"{name}-still.webp", quality=QUALITY)
    each = -(-len(frames) // MOST_FRAMES)
    shown = [*frames[:-1:each], frames[-1]]
    times = [STEP_TIME * each] * (len(shown) - 1) + [LAST_TIME]
    place = FRAMED / f"{name}-moving.webp"
    shown[0].save(place, save_all=True, append_images=shown[1:], duration=times, loop=0, quality=QUALITY)
    return MOVES.format(name=name, size=MOVING)


def picture_of(env: segar.envs.VectorEnv) -> Image.Image:
    frames = env.render()
    assert frames is not None
    return Image.fromarray(frames[0])


def draw(levels: Levels, sheet: Path, first: Path) -> None:
    """Write the levels side by side, and the first one by itself."""
    view = View(size=SIDE, labels=False, line=False)
    env = segar.envs.VectorEnv(levels, len(levels), render_mode="rgb_array", view=view, seed=0)
    env.reset(options={"levels": np.arange(len(levels))})
    frames = env.render()
    assert frames is not None
    step, lines = SIDE + GAP, -(-len(levels) // ACROSS)
    image = Image.new("RGBA", (ACROSS * step - GAP, lines * step - GAP))
    for k, picture in enumerate(frames):
        image.paste(Image.fromarray(picture), (k % ACROSS * step, k // ACROSS * step))
    image.quantize(256, dither=Image.Dither.NONE).save(sheet, optimize=True)
    Image.fromarray(frames[0]).quantize(256, dither=Image.Dither.NONE).save(first, optimize=True)


def answer_of(*command: str) -> dict[str, Any]:
    """What a command of ``segar`` answers in JSON."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        status = run_segar([*command, "--json"])
    if status:
        raise SystemExit(f"segar {' '.join(command)} ended with status {status}")
    return json.loads(out.getvalue())


def summary_of(levels: Levels, varying: Collection[str]) -> str:
    """What is played, and how large it is."""
    env = segar.envs.VectorEnv(levels, 1, observation="state", seed=0)
    observed, acted = (
        space.shape[0] for space in (env.single_observation_space, env.single_action_space) if space.shape
    )
    return (
        f"The task is `{task_of(levels).name}`. A level has at most {len(levels.layout.slots)} entities, the floor among"
        f" them. {len(varying)} factors vary between levels. The observation `state` has {observed} numbers, an action has"
        f" {acted}."
    )


def entity_row(name: str, entity: dict[str, Any]) -> tuple[str, ...]:
    kinds = zip(entity["types"], entity["probabilities"], strict=True)
    types = ", ".join(f"`{kind}`" + (f" {share:.3g}" if share < 1 else "") for kind, share in kinds)
    return f"`{name}`", types, f"{entity['there']:.3g}"


def shared_rows(marginals: Sequence[dict[str, Any]]) -> list[tuple[Any, ...]]:
    """Rows of the table of distributions; entities with the same one share a row. First whether it varies."""
    entities: dict[tuple[str, str], list[str]] = {}
    numbers: dict[tuple[str, str], dict[str, Any]] = {}
    for row in marginals:
        key = row["factor"], row["law"]
        entities.setdefault(key, []).append(row["entity"])
        numbers[key] = row
    rows = []
    for (factor, law), owners in entities.items():
        row = numbers[factor, law]
        # A shape has no numbers; it varies where it is drawn, and says so by its name.
        varies = "Random" in law or "Choice" in law if row["sd"] is None else np.any(np.asarray(row["sd"], float) != 0)
        text = LONG_NUMBER.sub(lambda number: f"{float(number[0]):.6g}", law)
        bounds = " to ".join(shown(row[end]) for end in ("low", "high")) if row["low"] is not None else ""
        cells = (shown(row["mean"]), shown(row["sd"]), bounds, UNITS.get(factor, ""))
        rows.append((bool(varies), f"`{factor}`", together(owners), f"`{text}`", *cells))
    return rows


def shown(value: Any) -> str:
    """A number, or a pair of numbers, in short."""
    if value is None:
        return ""
    if isinstance(value, list):
        return f"({', '.join(map(shown, value))})"
    return f"{value:.4g}".replace("inf", "∞")


def hardness_table(name: str) -> str:
    measured = pd.read_csv(measure.HARDNESS).set_index("environment").loc[name]
    rows = [
        (
            PLAYERS[one.player],
            f"{one.success:.2f} ({one.low:.2f} to {one.high:.2f})",
            "" if pd.isna(one.steps) else f"{one.steps:.1f}",
        )
        for one in measured.itertuples()
    ]
    return table(("player", "success", "steps"), rows)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    write_environments()
