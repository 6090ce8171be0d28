"""``segar causes FOLDERS -o causes.png``: what failures on suites come from, as bars with intervals.

``FOLDERS`` hold evaluations that ``segar evaluate ... twins=true`` made, at any depth. There is a panel for each suite
and a bar for each group of factors: what the success gains where this group alone is as in training. Blue groups differ
between training and test; grey ones are controls, whose bars show chance.
"""

from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import METADATA, error_bars, figure_of_panels, save_figure
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.tables import column, read_frame, select
from segar.errors import SegarError
from segar.experiments.commands.command_line import run_from_command_line

CAUSES = "causes.csv"  # as segar.experiments.evaluation.causes writes it
DIFFERS, CONTROL = "#0072B2", "#BBBBBB"
FIGURES = {"effect": -1.0, "attributed": 0.0}  # and the least that each can be; the most is 1


def read_causes(*folders: str | Path) -> pd.DataFrame:
    """One row per evaluation, action mode and group, from the files below these folders; ``folder`` says where each lay.

    Raises:
        SegarError: there is none.
    """
    if not (paths := sorted(path for folder in folders for path in Path(folder).expanduser().rglob(CAUSES))):
        raise SegarError(
            f"there is no {CAUSES} below {', '.join(map(str, folders))}; segar evaluate run=FOLDER twins=true writes one"
        )
    return pd.concat([read_frame(path).assign(folder=str(path.parent)) for path in paths], ignore_index=True)


def profile_of_causes(causes: pd.DataFrame, mode: str = "deterministic") -> pd.DataFrame:
    """One row per suite and group: ``effect`` and ``attributed``, each with ``_low`` and ``_high``, and ``runs``.

    Of one run the intervals are those over levels, paired. Of several runs they are Student's over runs, cut where shares end.

    Args:
        causes: of :func:`read_causes`, or :meth:`segar.suites.Causes.rows` as a table.
        mode: the action mode that counts, where the table has several.

    Raises:
        SegarError: no row has this action mode.
    """
    chosen = select(causes, action_mode=mode) if "action_mode" in causes else causes
    if chosen.empty:
        raise SegarError(f"no evaluation has the action mode '{mode}'")
    rows = []
    for key, part in chosen.groupby(["suite", "group"], sort=False, dropna=False):
        suite, group = cast(tuple[str, str], key)
        row: dict[str, object] = {"suite": suite, "group": group, "differs": bool(part["differs"].iloc[0])}
        for name, least in FIGURES.items():
            columns = (name, f"{name}_low", f"{name}_high")
            found = mean_of_replicates(column(part.dropna(subset=name), name))
            over_runs = (found.estimate, *np.clip([found.low, found.high], least, 1.0))
            ends = part[list(columns)].iloc[0] if len(part) == 1 else over_runs
            row |= dict(zip(columns, map(float, ends), strict=True))
        rows.append({**row, "runs": len(part)})
    return pd.DataFrame(rows)


def causes_plot(
    causes: pd.DataFrame, path: str | Path | None = None, figure: str = "effect", mode: str = "deterministic"
) -> Figure:
    """Bars with intervals: what each group of factors has to do with failures, a panel per suite.

    Args:
        causes: as of :func:`profile_of_causes`.
        path: where the figure is written, as ``.png``, ``.pdf`` or ``.svg``.
        figure: ``"effect"``, the success gained where the group is as in training; or ``"attributed"``, the share of failures
            that do not happen there.

    Raises:
        SegarError: the path has another suffix, there is no such figure, or no row has this action mode.
    """
    if path is not None and Path(path).suffix not in METADATA:
        raise SegarError(f"'{path}' ends in none of {', '.join(METADATA)}, which say what is written")
    if figure not in FIGURES:
        raise SegarError(f"figure must be one of {', '.join(FIGURES)}, not '{figure}'")
    table = profile_of_causes(causes, mode)
    suites = list(dict.fromkeys(table["suite"]))
    most = max(len(select(table, suite=name)) for name in suites)
    with style.applied():
        drawn, grid = figure_of_panels(len(suites), 3.4, 0.6 + 0.3 * most, 0.9)
        for axes, name in zip(grid, suites, strict=False):
            axes.sharex(grid[0])
            _draw(axes, select(table, suite=name), figure, str(name))
        what = "success gained" if figure == "effect" else "share of failures that end"
        drawn.supxlabel(f"{what} where this group alone\nis as in training, 95 %", fontsize=10)
    if path is not None:
        place = Path(path).expanduser().resolve()
        save_figure(drawn, place, (place.suffix,))
    return drawn


def _draw(axes: Axes, part: pd.DataFrame, figure: str, title: str) -> None:
    """One suite."""
    at = np.arange(len(part))[::-1]
    value = np.nan_to_num(column(part, figure))
    bars = error_bars(part.rename(columns={f"{figure}_low": "low", f"{figure}_high": "high"}), figure)
    colours = [DIFFERS if differs else CONTROL for differs in part["differs"]]
    axes.barh(at, value, height=0.62, color=colours, zorder=2)
    axes.errorbar(value, at, xerr=bars, fmt="none", ecolor="#333333", elinewidth=1.2, capsize=2.5, zorder=3)
    axes.axvline(0, color="#999999", linewidth=0.8, zorder=1)
    axes.set_yticks(at, [str(name) for name in part["group"]])
    axes.grid(axis="y", visible=False)
    runs = int(cast(int, part["runs"].max()))
    axes.set_title(f"{title}{f', {runs} runs' if runs > 1 else ''}", loc="left")


def draw(*folders: str, output: str = "causes.png", figure: str = "effect", mode: str = "deterministic") -> None:
    """The command line: draws the evaluations below these folders, and prints the file and the profile.

    Args:
        output, figure, mode: of :func:`causes_plot`.

    Raises:
        SegarError: no folder is named, or as :func:`read_causes` and :func:`causes_plot`.
    """
    if not folders:
        raise SegarError("name folders below which evaluations lie: segar causes FOLDER")
    causes = read_causes(*folders)
    causes_plot(causes, output, figure, mode)
    print(profile_of_causes(causes, mode).to_string(index=False))
    print(Path(output).expanduser().resolve())


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(draw)


if __name__ == "__main__":
    main()
