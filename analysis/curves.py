"""``python -m analysis.curves``: how each algorithm learns, from one run each, as a figure, a table and two CSV files.

Finished runs are read, the others are trained first. ``only=[sac, drq]`` does so for some, and leaves the rows of the
others as they are. It writes the figure and the table of ``docs/reference/algorithms.md``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from analysis.plotting import style
from analysis.plotting.figures import new_figure, save_figure
from analysis.tables import write_csv
from experiments.commands.hydra_app import compose, run_simple_command
from experiments.runs.files import write_text
from experiments.runs.run_folder import LEVELS_TEST, read_config, read_metrics, read_summary
from experiments.settings import ACTION_MODES, CHECKOUT, require, require_known
from experiments.training.run import run
from segar import Levels
from segar.evaluation import find_baselines

CURVES_CSV, TABLE_CSV, FIGURE = "curves.csv", "algorithms.csv", "algorithms"
BEGIN, END = "<!-- made by python -m analysis.curves -->", "<!-- end -->"
POINTS = 20  # of a curve
ANCHOR_SEED = 0
COLUMNS = 4  # of axes


@dataclass(frozen=True)
class Curve:
    """One run: its name on the page, what the command line of ``experiments.train`` says, and how long it lasts."""

    name: str
    levels: str
    settings: tuple[str, ...]
    frames: int

    @property
    def overrides(self) -> tuple[str, ...]:
        """The command line, without where things go."""
        interval = f"evaluation.interval={self.frames // POINTS}"
        return (f"levels={self.levels}", *self.settings, f"scale.frames={self.frames}", interval)


MANY = "levels.count=200"
SMALL = ("algorithm.encoder=small", "observation=rgb")  # a CNN whose runs take minutes; ppo_small is the others' base
CURVES = (
    Curve("ppo_fast_state", "empty-hard", (MANY, "algorithm=ppo_fast"), 200_000),
    Curve("sac", "empty-easy", (MANY, "algorithm=sac"), 20_000),
    Curve("ppo_fast", "empty-hard", (MANY, "algorithm=ppo_fast", "observation=rgb_stack2"), 150_000),
    Curve("ppo_recurrent", "empty-hard", (MANY, "algorithm=ppo_recurrent", "observation=rgb"), 600_000),
    Curve("drq", "empty-easy", (MANY, "algorithm=drq", "observation=rgb_stack2"), 60_000),
    Curve("ppo", "empty-easy", (MANY, "algorithm=ppo", "observation=rgb"), 1_000_000),
    Curve("ppo_procgen", "empty-easy", (MANY, "algorithm=ppo_procgen", "observation=rgb_stack2"), 250_000),
    Curve("ppo_small", "empty-easy", (MANY, "algorithm=ppo", *SMALL), 250_000),
    Curve("curl", "empty-easy", (MANY, "algorithm=curl", *SMALL), 250_000),
    Curve("curl_original", "empty-easy", (MANY, "algorithm=curl_original", *SMALL), 250_000),
    Curve("spr", "empty-easy", (MANY, "algorithm=spr", *SMALL), 250_000),
    Curve("spr_original", "empty-easy", (MANY, "algorithm=spr_original", *SMALL), 250_000),
)


@dataclass(frozen=True)
class CurvesConfig:
    """Which runs, and the folders that are read and written."""

    only: tuple[str, ...] = ()  # names of curves; none: all
    root: str | None = None  # where the run folders lie; None: runs/ of the checkout
    out: str | None = None  # the folder of docs; None: docs/ of the checkout
    page: str | None = None  # whose table is replaced; None: reference/algorithms.md in that folder
    num_threads: int = 2

    def __post_init__(self) -> None:
        require(self.num_threads >= 1, "num_threads", self.num_threads, "at least 1")
        for name in self.only:
            require_known("only", name, [curve.name for curve in CURVES])


def curves(config: CurvesConfig) -> None:
    """Trains what is missing, then writes figure, tables and page."""
    out = Path(config.out).expanduser().resolve() if config.out else CHECKOUT / "docs"
    chosen = [curve for curve in CURVES if not config.only or curve.name in config.only]
    folders = {curve.name: trained(curve, config) for curve in chosen}
    rows = pd.DataFrame([row_of(curve, folders[curve.name]) for curve in chosen])
    points = pd.concat([points_of(curve, folders[curve.name]) for curve in chosen], ignore_index=True)
    rows, points = (merged(out / "results" / name, table) for name, table in ((TABLE_CSV, rows), (CURVES_CSV, points)))
    save_figure(figure(rows, points), out / "images" / FIGURE)
    page = Path(config.page) if config.page else out / "reference" / "algorithms.md"
    write_text(page, with_table(page.read_text(), rows))
    print(page)


def trained(curve: Curve, config: CurvesConfig) -> Path:
    """The folder of the finished run."""
    places = ["tracking=none", f"num_threads={config.num_threads}", *([f"root={config.root}"] if config.root else [])]
    return run(compose([*curve.overrides, *places])).folder


def row_of(curve: Curve, folder: Path) -> dict[str, Any]:
    """The row of the table for a curve."""
    summary = read_summary(folder)
    levels = Levels.load(folder / LEVELS_TEST)
    baselines = find_baselines(levels, rng=np.random.default_rng(ANCHOR_SEED))
    row: dict[str, Any] = {"name": curve.name, "levels": curve.levels, "settings": " ".join(curve.settings)}
    row |= {"frames": curve.frames, "threads": read_config(folder).num_threads, "minutes": seconds_of(folder) / 60}
    for mode in ACTION_MODES:
        for split in ("train", "test"):
            row[f"{split}_success_{mode}"] = summary[f"evaluation/{split}/success/{mode}"]
        row[f"test_return_{mode}"] = summary[f"evaluation/test/return/{mode}"]
        row[f"test_score_{mode}"] = float(baselines.normalised(row[f"test_return_{mode}"]))
    return row


def seconds_of(folder: Path) -> float:
    """How long the training took, evaluations on the way not counted."""
    return max(read_metrics(folder)["seconds"].to_pylist())


def points_of(curve: Curve, folder: Path) -> pd.DataFrame:
    """The curve: ``name``, ``frames``, ``mode`` and ``success`` on the test levels."""
    metrics = read_metrics(folder).to_pandas()
    found = metrics[metrics["name"].str.fullmatch(r"evaluation/test/success/(deterministic|sampled)")]
    mode = found["name"].str.rpartition("/")[2]
    points = pd.DataFrame({"name": curve.name, "frames": found["frames"], "mode": mode, "success": found["value"]})
    return points.drop_duplicates(["frames", "mode"], keep="last")  # the run's end is evaluated twice


def merged(path: Path, table: pd.DataFrame) -> pd.DataFrame:
    """The CSV at ``path`` with the rows of ``table`` in place of those of the same names; it is written back."""
    if path.exists():
        there = pd.read_csv(path)
        table = pd.concat([there.loc[~there["name"].isin(list(table["name"]))], table], ignore_index=True)
    order = {curve.name: i for i, curve in enumerate(CURVES)}
    known = table.loc[table["name"].isin(list(order))]
    table = known.iloc[np.argsort(known["name"].map(order).to_numpy(), kind="stable")]
    write_csv(path, table, 6)
    return table


def figure(rows: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Success on test levels against frames, an axes for each run."""
    colour = dict(zip(ACTION_MODES, style.PALETTE, strict=False))
    names = list(rows["name"])
    with style.applied():
        drawn = new_figure(3.1 * COLUMNS, 2.5 * -(-len(names) // COLUMNS) + 0.3)
        grid = drawn.subplots(-(-len(names) // COLUMNS), COLUMNS, sharey=True, squeeze=False).ravel()
        for axes in grid[len(names) :]:
            axes.set_visible(False)
        for axes, name, levels in zip(grid, names, rows["levels"], strict=False):
            axes.set_title(f"{name}, {levels}")
            axes.set_ylim(-0.03, 1.03)
            axes.set_xlabel("thousand frames")
            for mode in colour:
                own = points.loc[(points["name"] == name) & (points["mode"] == mode)]
                axes.plot(own["frames"] / 1000, own["success"], color=colour[mode], label=mode)
        for axes in grid[::COLUMNS]:
            axes.set_ylabel("success on test levels")
        drawn.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return drawn


def with_table(page: str, rows: pd.DataFrame) -> str:
    """The page with a new table between its two marks; raises ``ValueError`` where they are not there."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page needs the lines '{BEGIN}' and '{END}', between which the table goes")
    return f"{before}{BEGIN}\n{as_markdown(rows)}\n{END}{after}"


def as_markdown(rows: pd.DataFrame) -> str:
    """The table as the page has it: both action modes as deterministic / sampled."""
    head = "run, levels, settings, frames, threads, minutes, train success, test success, score on test levels"
    lines = [head.split(", "), ["---"] * 3 + ["--:"] * 6]
    for row in rows.to_dict("records"):
        pairs = [
            f"{row[f'{key}_deterministic']:.2f} / {row[f'{key}_sampled']:.2f}"
            for key in ("train_success", "test_success", "test_score")
        ]
        settings = f"`{row['settings']}`"
        cost = (f"{row['frames']:,}", str(row["threads"]), f"{row['minutes']:.1f}")
        lines.append([row["name"], row["levels"], settings, *cost, *pairs])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


if __name__ == "__main__":
    run_simple_command(curves, CurvesConfig, __doc__)
