"""The tables of a results folder, which are all that a report is made from."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from segar.analysis.collect import CURVES, MISSING
from segar.analysis.plotting import style
from segar.analysis.plotting.names import word_for
from segar.analysis.report.rules import GATE_MARGIN
from segar.analysis.stats.association import keys, labels
from segar.analysis.tables import Floats, column, keep, read_frame, select
from segar.errors import did_you_mean, naming
from segar.experiments.reproduction.experiment_file import PLAN
from segar.experiments.reproduction.imported_results import RUNS, TRANSFERS
from segar.experiments.runs.files import read_json
from segar.experiments.runs.run_folder import PROBES
from segar.experiments.settings import RunFolderError, require

STUDIES = "studies"
PANEL = ("family", "difficulty")
BLOCK = (*PANEL, "seed")  # runs that share their nested training levels
HARDER = {"easy": "medium", "medium": "hard"}
# The columns of runs that each report needs, and those that the paper's needs.
NEEDED = ("experiments", *BLOCK, "n", "algorithm", "observation", "run", "frames", "w2_exact", "gap_deterministic",
          "gap_se_deterministic", "gap_ref_deterministic", "success_train_deterministic", "success_test_deterministic",
          "test_levels", "hours", "code")  # fmt: skip
REQUIRED = (*NEEDED, "design", "variation", "w2_reference", "task", "gap_sampled", "episodes_train_deterministic",
            "episodes_test_deterministic")  # fmt: skip
WHOSE = ("run", *BLOCK, "n", "algorithm")  # which no run may lack: means are over runs of one kind
TEXTS = ("family", "difficulty", "algorithm", "observation", "task", "design", "variation", "run")
NUMBERS = {"n": 1, "seed": 0}  # columns of whole numbers, and the least ones
NAMED = ("run", "reason", "name", "experiment")  # of what is missing
ETA, SUCCESS = "eta_test_deterministic", "success_test_deterministic"
LESS_REGRET = "less_regret"
TEST_COLUMNS = ("test_family", "test_difficulty", "test_variation", "test_observation", "test_changed", "test_groups")
FRAME, STACK, MEMORY = "one frame", "four frames", "one frame, a memory"


@dataclass(frozen=True)
class Results:
    """All tables of a results folder; a table that has no file is empty."""

    folder: Path
    scale: str  # the folder's name up to the first dash, e.g. "quick"
    runs: pd.DataFrame
    transfers: pd.DataFrame
    curves: pd.DataFrame
    probes: pd.DataFrame
    missing: pd.DataFrame  # what is planned and not finished: run, reason, name of the experiment and its title
    studies: dict[str, dict[str, pd.DataFrame]] = field(default_factory=dict)  # of each study, its tables by name

    def of(self, *experiments: str) -> pd.DataFrame:
        """The runs that belong to any of the experiments, with the columns of :func:`measured`."""
        wanted, runs = set(experiments), self.measured_runs
        return keep(runs, [bool(wanted & set(str(names).split())) for names in runs["experiments"]])

    @cached_property
    def measured_runs(self) -> pd.DataFrame:
        """All runs, with the columns of :func:`measured`."""
        return measured(self.runs)

    def study(self, name: str, table: str) -> pd.DataFrame:
        """A table of a study that trains nothing; empty where there is none."""
        return self.studies.get(name, {}).get(table, pd.DataFrame())

    @cached_property
    def players(self) -> pd.DataFrame:
        """What four players without training reach on the test levels of each panel: ``panel``, ``player`` (idle, random,
        script, oracle; floor, the better of idle and random on each level), ``return``, ``success``. Empty if not measured."""
        table = self.study("anchors", "anchors")
        return with_panel(table) if len(table) else table

    def player(self, name: str, value: str) -> dict[str, float]:
        """The ``return`` or ``success`` of a player, by panel."""
        if self.players.empty:
            return {}
        rows = select(self.players, player=name)
        return dict(zip(rows["panel"], column(rows, value), strict=True))

    def with_less_regret(self, runs: pd.DataFrame) -> pd.DataFrame:
        """The runs with ``less_regret``, the return on test levels less that of the planner in their panel, which falls like a
        gap; as they are where the planner was not measured in all their panels."""
        best = self.player("oracle", "return")
        known = np.array([best.get(panel, np.nan) for panel in runs["panel"]], np.float64)
        return runs.assign(**{LESS_REGRET: column(runs, ETA) - known}) if np.isfinite(known).all() else runs

    @cached_property
    def learned(self) -> np.ndarray:
        """Whether each run learned its training levels, bool ``[runs]``: its success there is above that of idle and of
        random play in its panel by the gate's margin. Where these were not measured, 0 stands for them."""
        idle, chance = (self.player(name, "success") for name in ("idle", "random"))
        least = [max(idle.get(panel, 0.0), chance.get(panel, 0.0)) for panel in with_panel(self.runs)["panel"]]
        return column(self.runs, "success_train_deterministic") >= np.array(least) + GATE_MARGIN

    @cached_property
    def gated(self) -> "Results":
        """The same tables without the runs that did not learn their training levels, and what belongs to them."""
        runs = keep(self.runs, self.learned)
        names = list(runs["run"])
        parts = {
            name: keep(table, table["run"].isin(names)) if len(table) else table
            for name, table in (("transfers", self.transfers), ("probes", self.probes), ("curves", self.curves))
        }
        return dataclasses.replace(self, runs=runs, **parts)

    @cached_property
    def main(self) -> pd.DataFrame:
        """The main grid, one row per run: panels, numbers of levels, seeds."""
        return self.of("figure_3a", "figure_3b", "figure_5b")

    def with_training_sets(self, runs: pd.DataFrame) -> pd.DataFrame:
        """The runs with the measures of their training sets, from the studies that have a table ``training_sets``; as they are
        without one."""
        if not (parts := [tables["training_sets"] for tables in self.studies.values() if "training_sets" in tables]):
            return runs
        return runs.merge(pd.concat(parts).drop_duplicates(), on=[*BLOCK, "n", "design"], how="left", validate="m:1")

    @cached_property
    def tested(self) -> pd.DataFrame:
        """All transfers, with the columns of :func:`measured`; ``test_changed`` is empty but for levels in between."""
        none = self.runs.head(0).assign(**dict.fromkeys(TEST_COLUMNS, ""))
        table = self.transfers if len(self.transfers) else none
        changed = table["test_changed"].fillna("") if "test_changed" in table else ""
        return measured(table.assign(test_changed=changed))

    @cached_property
    def moved(self) -> pd.DataFrame:
        """The transfers to levels of other distributions, or to other observations."""
        return select(self.tested, test_changed="")

    @cached_property
    def between(self) -> pd.DataFrame:
        """The transfers to levels between training and test; ``test_changed`` names the groups that are as in the test."""
        return keep(self.tested, self.tested["test_changed"] != "")

    @cached_property
    def harder(self) -> pd.DataFrame:
        """Agents of the main grid on the next harder levels of their family, in the same physics and look."""
        table = self.moved
        harder = table["difficulty"].map(HARDER.get) == table["test_difficulty"]
        same = (table["test_family"] == table["family"]) & (table["test_variation"] == table["variation"])
        same &= (table["test_observation"] == table["observation"]) & table["run"].isin(list(self.main["run"]))
        return keep(table, harder & same)

    @cached_property
    def other_physics(self) -> pd.DataFrame:
        """The transfers to another variation than in training (``trained``), with the ``difference`` of :meth:`shifted`."""
        part = self.shifted(keep(self.moved, self.moved["test_variation"] != self.moved["variation"]))
        return part.assign(trained=[name or "the default" for name in part["variation"]])

    @cached_property
    def other_looks(self) -> pd.DataFrame:
        """The transfers of the experiment ``visual``, with the ``difference`` of :meth:`shifted`.

        ``shift`` names the textures or the difficulty of the test levels, ``trained`` the textures of training."""
        part = self.shifted(keep(self.moved, self.moved["run"].isin(list(self.of("visual")["run"]))))
        same = np.asarray(part["test_observation"] == part["observation"])
        places = zip(same, part["test_difficulty"], part["test_observation"], strict=True)
        shift = [f"{difficulty} levels" if s else texture(look) for s, difficulty, look in places]
        return part.assign(shift=shift, trained=[texture(look) for look in part["observation"]])

    @cached_property
    def masses(self) -> pd.DataFrame:
        """The runs of the appendix's mass and frame stack.

        ``mass`` is "shown" or "hidden"; ``past`` says what the agent has of past frames."""
        table = self.of("appendix_mass", "appendix_memory")
        looks = [(str(look), str(name)) for look, name in zip(table["observation"], table["algorithm"], strict=True)]
        past = [MEMORY if "recurrent" in name else STACK if "stack4" in look else FRAME for look, name in looks]
        return table.assign(mass=["hidden" if "hidden=Mass" in look else "shown" for look, _ in looks], past=past)

    def shifted(self, moved: pd.DataFrame) -> pd.DataFrame:
        """Transfers with ``difference``: the return there less that of the same agent on its own test levels."""
        return paired(moved, self.runs, ETA, ["run"])


def read_results(folder: Path, required: Sequence[str] = REQUIRED) -> Results:
    """The tables in ``folder``; raises :class:`RunFolderError` if there is no table of runs, it has not the ``required``
    columns, or a run does not say what it belongs to."""
    if not (folder / RUNS).exists():
        raise RunFolderError(
            f"{folder} holds no {RUNS}. Name a folder of tables, such as docs/results/quick, or have them made: segar "
            "collect results=FOLDER"
        )
    runs = read_frame(folder / RUNS)
    if runs.empty:
        raise RunFolderError(f"{folder / RUNS} has no rows: no run is finished; run the same command again")
    transfers, curves, probes, missing = (optional(folder / name) for name in (TRANSFERS, CURVES, PROBES, MISSING))
    for file, table, names in ((RUNS, runs, required), (MISSING, missing, NAMED if len(missing) else ())):
        for name in names:
            if name not in table:
                known = map(str, table.columns)
                raise RunFolderError(f"{folder / file} has no column '{name}'.{did_you_mean(name, known)}")
    with naming(folder / RUNS, RunFolderError):
        keys(runs, [name for name in WHOSE if name in runs])
        for name in (one for one in TEXTS if one in runs):
            require(runs[name].dtype.kind not in "biuf", name, list(runs[name][:1]), "texts")
        for name, least in NUMBERS.items():
            values = column(runs, name)
            wrong = list(runs[name][(values < least) | (values % 1 != 0) | (runs[name].dtype.kind == "O")])
            require(not wrong, name, wrong[:1], f"whole numbers from {least} up")
        gaps = column(runs, "gap_deterministic")
        require(bool(np.isfinite(gaps).any()), "gap_deterministic", float(gaps[0]), "a number of some run")
    for file, table, names in ((RUNS, runs, ["run"]), (TRANSFERS, transfers, ["run", "transfer"])):
        twice = list(table.loc[table.duplicated(names), "run"]) if {*names} <= {*table.columns} else []
        with naming(folder / file, RunFolderError):
            require(not twice, "run", twice[:1], "there once: each row would count")
    studies: dict[str, dict[str, pd.DataFrame]] = {}
    for path in sorted((folder / STUDIES).glob("*/*.csv")):
        studies.setdefault(path.parent.name, {})[path.stem] = read_frame(path)
    return Results(folder, scale_of(folder), runs, transfers, curves, probes, missing, studies)


def optional(path: Path) -> pd.DataFrame:
    """A table, or an empty one where there is none."""
    return read_frame(path) if path.exists() else pd.DataFrame()


def scale_of(folder: Path) -> str:
    """The name of the scale: from the plan, or from the folder's name up to the first dash where there is no plan."""
    plan = folder / PLAN
    return read_json(plan, {"scale": str})["scale"] if plan.exists() else folder.name.partition("-")[0]


def measured(table: pd.DataFrame) -> pd.DataFrame:
    """The rows whose gap is known, with these names: ``gap`` and ``gap_se`` (full returns, deterministic actions),
    ``gap_2022`` (returns without their last reward, as in 2022), ``gap_success``, ``panel``, ``log_n``, ``levels`` (n as a
    word, for a factor) and ``cell``."""
    named = table.assign(
        gap=table["gap_deterministic"],
        gap_se=table["gap_se_deterministic"],
        gap_2022=table["gap_ref_deterministic"],
        gap_success=table["success_test_deterministic"] - table["success_train_deterministic"],
        log_n=np.log(table["n"].to_numpy(np.float64)),
        levels=table["n"].astype(str),
        cell=labels(table, [*PANEL, "n"]),
    )
    return keep(with_panel(named), np.isfinite(column(named, "gap")))


def texture(look: object) -> str:
    """The textures of an observation's name: far, of textures(textures=far)."""
    return str(look).removeprefix("textures(textures=").removesuffix(")")


def shifts_in_words(table: pd.DataFrame, tested: str) -> pd.DataFrame:
    """The table with the names of variations in words, in ``trained`` and in the column ``tested``."""
    return table.assign(**{name: table[name].map(word_for) for name in ("trained", tested)})


def with_panel(table: pd.DataFrame) -> pd.DataFrame:
    """The table with ``panel``: empty-hard, or the name alone of levels that have no difficulty."""
    return table.assign(panel=[name.removesuffix("-") for name in labels(table, PANEL)])


def panels_of(table: pd.DataFrame) -> list[str]:
    """The panels of a table, in the paper's order."""
    there = set(table["panel"])
    orders = (style.ordered(table[name]) for name in PANEL)
    return [name for name in ("-".join(place).removesuffix("-") for place in product(*orders)) if name in there]


def paired(first: pd.DataFrame, second: pd.DataFrame, value: str, at: Sequence[str]) -> pd.DataFrame:
    """The rows of ``first`` with ``difference``, as of :func:`less_partner`; rows without a partner are left out."""
    found = first.assign(difference=less_partner(first, second, value, at))
    return keep(found, np.isfinite(column(found, "difference")))


def less_partner(
    first: pd.DataFrame, second: pd.DataFrame, value: str, at: Sequence[str], there: Sequence[str] = ()
) -> Floats:
    """The ``value`` of each row of ``first`` less that of its partner in ``second``, float64 ``[rows]``; NaN without a partner.

    Args:
        at: the columns of ``first`` that name its partner.
        there: the names of these columns in ``second``; by default as in ``first``.
    """
    places = second[list(there or at)].itertuples(index=False, name=None)
    partners = dict(zip(places, column(second, value), strict=True))
    partner = [partners.get(place, np.nan) for place in first[list(at)].itertuples(index=False, name=None)]
    return column(first, value) - np.array(partner, np.float64)
