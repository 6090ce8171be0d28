"""What a study asks, and its runs: read from the tables of a results folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.distances import COMMON
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.results import BLOCK, NEEDED, PANEL, measured, read_results
from segar.analysis.runs import LEVEL_SETS, column_name, number_of_pairs
from segar.analysis.tables import count_of, keep, pick, select
from segar.errors import did_you_mean
from segar.experiments.reproduction.experiment_file import FEWEST_BLOCKS, STUDY
from segar.experiments.reproduction.grid import AGENT_SEED, KIND, KINDS, LEVEL_SEED, kind_columns
from segar.experiments.runs.run_folder import LONGEST
from segar.experiments.runs.trust import settings_of_file
from segar.experiments.settings import ConfigError, RunFolderError, add_module_path, flat
from segar.support import data_in, misfit, read_yaml

READ = {
    "claims?": ({str: {"test?": str}}, None),
    "module_path?": [str],
    **dict.fromkeys(("grid?", "settings?"), (dict, None)),
}
ALL = "all agents"
OWN_UNITS = "w2_exact has a unit for each pair of training and test distributions: compare it within a pair."
ONE_UNIT = "Exact W2 is in one unit: standard deviations over all distributions of the study, transfers included."
SUCCESS = ("success_train_deterministic", "success_test_deterministic")


BLOCK_NAMES = {BLOCK: LEVEL_SETS, PANEL: "panels"}  # as their intervals call blocks


@dataclass(frozen=True)
class Study:
    """What a study asks, and what its tables say.

    ``runs`` has the columns of :func:`segar.analysis.report.results.measured`; ``agent``, the settings that tell agents apart,
    in words; and ``levels``, which is ``n``. ``seed`` is that of the level set: the least one of those that gave its levels.
    """

    asked: Mapping[str, Any]
    evidence: Evidence
    runs: pd.DataFrame
    told_apart: Sequence[str]  # columns that vary beside panels, numbers of levels and seeds

    @property
    def w2(self) -> str:
        """The column of exact W2: in one unit for all pairs of distributions, if the tables have that."""
        return column_name(self.runs, "w2")

    @property
    def about_w2(self) -> str:
        """In what unit W2 is, as a sentence; empty where all runs are of one pair of training and test distributions."""
        if self.w2 == COMMON:
            return ONE_UNIT
        return OWN_UNITS if number_of_pairs(self.runs) > 1 else ""

    @property
    def panels(self) -> list[str]:
        """The panels, in their order of first appearance."""
        return list(dict.fromkeys(self.runs["panel"]))

    def tested_on(self, label: str) -> pd.DataFrame:
        """The columns of ``runs`` for the agents on the levels of a transfer; raises :class:`ConfigError`.

        Agents whose own test levels are those of the transfer count with these.
        """
        moved = self.evidence.results.moved
        there = select(moved, test=label) if len(moved) else moved
        if there.empty:
            known = sorted(set(map(str, moved["test"]))) if len(moved) else []
            raise ConfigError(f"tested_on: no agent was tested on '{label}'.{did_you_mean(label, known)}")
        own = ["run", *(name for name in self.runs if name not in there), "seed"]
        moved_there = there.drop(columns=["seed"]).merge(pick(self.runs, own), on="run")
        return pd.concat([moved_there, self._there_anyway(there).assign(test=label)], ignore_index=True)

    def _there_anyway(self, there: pd.DataFrame) -> pd.DataFrame:
        """The runs whose own test levels are those of the transfer that ``there`` has."""
        settings = flat(self.asked.get("settings") or {})
        vary = (self.asked.get("grid") or {}).get("vary") or {}
        if {"levels.test", "levels.test_variation"} & {*settings, *vary}:
            return self.runs.iloc[:0]
        where = ("family", "difficulty", "variation", "observation")
        levels = set(zip(*(there[f"test_{name}"] for name in where), strict=True))
        return keep(self.runs, [one in levels for one in zip(*(self.runs[name] for name in where), strict=True)])

    @property
    def agents(self) -> list[str]:
        """The kinds of agents."""
        return sorted(set(self.runs["agent"]))


def is_study(folder: Path) -> bool:
    """Whether a results folder is that of a study."""
    return (folder / STUDY).exists()


def read_study(folder: Path) -> Study:
    """The study in a results folder; raises :class:`RunFolderError`."""
    path = folder / STUDY
    # Both are of one reading: what is signed is what is used.
    asked, text = data_in(path, "a study", RunFolderError, lambda text: (read_yaml(text), text.decode()), LONGEST)
    if wrong := misfit(asked, READ):
        raise RunFolderError(f"{path}: {wrong}")
    used = {key: asked[key] for key in ("claims", "module_path") if key in asked}
    add_module_path(settings_of_file(path, used, (), text).get("module_path", ()))
    results = read_results(folder, NEEDED)
    table, vary = results.runs, [str(name) for name in (asked.get("grid") or {}).get("vary", ())]
    shared = table["levels.seed"].fillna(table["seed"]) if "levels.seed" in table else table["seed"]
    merged = table["level_set"].fillna(shared) if "level_set" in table else shared
    seeds = {AGENT_SEED: table["seed"], LEVEL_SEED: shared.astype(int), "seed": merged.astype(int)}
    table = table.assign(**seeds)
    known = [str(name) for name in table if not np.any(table[name].isna())]  # tables of earlier releases have no kinds
    told_apart = [name for name in (*kind_columns(known), *vary) if name in table and count_of(table, name) > 1]
    table = measured(table)
    agent = [agent_name(row, told_apart) for row in table.to_dict("records")]
    evidence = Evidence(results, False, FEWEST_BLOCKS, BLOCK_NAMES)  # of all runs
    return Study(asked, evidence, table.assign(agent=agent, levels=table["n"]), told_apart)


def agent_name(row: Mapping[Any, Any], told_apart: Sequence[str]) -> str:
    """What tells a kind of agents apart, such as ``curl, gamma=0.9``."""
    words = (
        str(row[name]) if name.removesuffix(KIND) in KINDS else f"{name.rpartition('.')[2]}={row[name]}"
        for name in told_apart
    )
    return ", ".join(filter(None, words)) or ("default" if told_apart else ALL)
