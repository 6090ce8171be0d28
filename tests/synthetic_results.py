"""Tables of a results folder without any run: the shipped main grid's columns, with effects that a test chooses."""

from collections.abc import Sequence
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.report.claims.claim import Claim
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.reading import read_claims
from segar.analysis.report.results import read_results
from segar.analysis.tables import select

FAMILIES, DIFFICULTIES, COUNTS = ("empty", "objectsx1", "tilesx1"), ("easy", "medium", "hard"), (1, 10, 50, 100, 200)
HARDER = {"easy": "medium", "medium": "hard"}


def run_rows(
    rng: np.random.Generator,
    experiments: str,
    *,
    seeds: int = 3,
    slope: float = -4.0,
    noise: float = 0.1,
    beyond_n: bool = True,
    families: Sequence[str] = FAMILIES,
    difficulties: Sequence[str] = DIFFICULTIES,
    counts: Sequence[int] = COUNTS,
    **place: Any,
) -> pd.DataFrame:
    """A run for every cell and seed; its gap is ``slope`` times exact W2, or times what panel and n make of W2."""
    rows = []
    for seed, (i, family), (j, difficulty), n in product(
        range(1, seeds + 1), enumerate(families), enumerate(difficulties), counts
    ):
        expected = 0.7 + 0.3 * i + 0.4 * j - 0.1 * np.log(n)
        exact = expected * np.exp(0.15 * rng.normal())
        gap = slope * (exact if beyond_n else expected) + noise * rng.normal()
        what = {"algorithm": "ppo_fast", "observation": "rgb_stack2", "task": "puttputt", "variation": ""}
        what |= {"design": "iid"} | place
        name = "-".join(map(str, (family, difficulty, n, seed, *what.values(), experiments)))
        eta = -1.0 - 0.5 * j - 5.0 * (family == "tilesx1")
        rows.append(
            {"experiments": experiments, "family": family, "difficulty": difficulty, "n": n, **what, "seed": seed,
             "run": name, "test": "own", "hash": "0" * 8, "frames": 100_000, "test_levels": 100, "w2_reference": exact / 3,
             "w2_exact": exact, "w2_paper": 2 * exact, "ks": 0.5, "effective_number": float(rng.uniform(1, n + 1)),
             "entropy": float(rng.uniform(0, np.log(n + 1))), "radius": exact, "hours": 0.1, "code": "c0de"}
            | outcome(eta, gap, 0.9 - 0.1 * j)
        )  # fmt: skip
    return pd.DataFrame(rows)


def outcome(eta_train: float, gap: float, success: float) -> dict[str, float]:
    """The columns of both action modes; returns of 2022 leave a little out."""
    row: dict[str, float] = {}
    for mode in ("deterministic", "sampled"):
        row |= {f"eta_train_{mode}": eta_train, f"eta_test_{mode}": eta_train + gap, f"gap_{mode}": gap}
        row |= {f"gap_se_{mode}": 0.1, f"gap_ref_{mode}": 0.9 * gap}
        row |= {f"episodes_train_{mode}": 120, f"episodes_test_{mode}": 100}
        row |= {f"success_train_{mode}": success, f"success_test_{mode}": success * 0.8, f"death_test_{mode}": 0.0}
    return row


def transfer_rows(runs: pd.DataFrame, loss: float, **there: Any) -> pd.DataFrame:
    """The agents of ``runs`` on harder levels, or wherever ``there`` says: their gap is larger by ``loss``."""
    rows = []
    for k, row in enumerate(runs.to_dict("records")):
        difficulty = there.get("test_difficulty") or HARDER.get(row["difficulty"])
        if difficulty is None:
            continue
        place = {"test": "moved", "test_family": row["family"], "test_variation": row["variation"],
                 "test_observation": row["observation"]} | there | {"test_difficulty": difficulty}  # fmt: skip
        gap = row["gap_deterministic"] - loss * (1 + 0.01 * np.cos(k))
        moved = outcome(row["eta_train_deterministic"], gap, row["success_train_deterministic"])
        kept = {key: value for key, value in row.items() if key not in ("experiments", "hours", "code", "hash")}
        rows.append(kept | place | moved | {"w2_exact": row["w2_exact"] + 1, "w2_reference": row["w2_reference"] + 0.3})
    return pd.DataFrame(rows)


PARTS = {"position": 0.7, "properties": 0.1, "rest": 0.2}  # of every gap


def between_rows(runs: pd.DataFrame) -> pd.DataFrame:
    """The agents of ``runs`` on levels between training and test: each group of factors makes its part of the gap."""
    rows = []
    for size in range(1, len(PARTS)):
        for changed in combinations(PARTS, size):
            place = {"test_changed": "+".join(changed), "test_groups": "position+properties", "test_difficulty": "easy"}
            for row in transfer_rows(runs, 0.0, **place).to_dict("records"):
                gap = row["gap_deterministic"] * sum(PARTS[name] for name in changed)
                rows.append(row | outcome(row["eta_train_deterministic"], gap, 0.5))
    return pd.DataFrame(rows)


def probe_rows(rng: np.random.Generator, runs: pd.DataFrame) -> pd.DataFrame:
    """Accuracies that have nothing to do with gaps, a little higher on training levels."""
    rows = []
    for run, probe, levels in product(runs["run"], ("paper", "jsd"), ("train", "test")):
        value = 0.7 + 0.05 * (levels == "train") + 0.03 * rng.normal()
        row = {"run": run, "levels": levels, "representation": "trained", "factor": "all", "probe": probe, "units": 5}
        row |= {"quantity": "accuracy", "estimate": value, "low": value - 0.01, "high": value + 0.01, "p": 0.01}
        rows.append(row)
    return pd.DataFrame(rows)


def curve_rows(runs: pd.DataFrame) -> pd.DataFrame:
    """Curves that rise."""
    names = ("episode/return", "evaluation/test/return/deterministic")
    rows = [
        {"run": run, "name": name, "frames": frames, "value": -10 + frames / 20_000}
        for run, name, frames in product(runs["run"], names, range(5_000, 100_001, 5_000))
    ]
    return pd.DataFrame(rows)


def everything(rng: np.random.Generator, **main: Any) -> dict[str, pd.DataFrame]:
    """All tables of all experiments, by file name."""
    grid = run_rows(rng, "figure_3a figure_3b figure_4a figure_4b figure_5b", **main)
    short = {"seeds": 2, "counts": (1, 10)}
    two = {"families": ("empty", "objectsx1"), "difficulties": ("medium", "hard")}
    parts = [grid]
    for algorithm in ("ppo_fast", "curl_fast", "spr_fast", "ppo_two_epochs"):
        parts.append(run_rows(rng, "figure_5a", algorithm=algorithm, observation="textures", **short))
    for look in ("textures", "textures(hidden=Mass)", "textures_stack4", "textures_stack4(hidden=Mass)"):
        parts.append(run_rows(rng, "appendix_mass", observation=look, variation="ball_mass", **short))
    parts.append(run_rows(rng, "appendix_sac", algorithm="drq", observation="textures", **short))
    for design in ("iid", "clustered", "covering", "nuisance_only"):
        parts.append(run_rows(rng, "fixed_n diversity", design=design, seeds=2, counts=(10,), **two))
    for design in ("matched", "matched_far", "matched_sparse", "matched_far_sparse"):
        one = {"families": ("empty",), "difficulties": ("medium",), "seeds": 3, "counts": (10, 50)}
        parts.append(run_rows(rng, "matched_sets", design=design, **one))
    for task in range(4):
        one = {"task": f"conditional_puttputt(conditions={task})", "observation": "state"}
        parts.append(run_rows(rng, "hardness", **one, **short))
    parts.append(run_rows(rng, "upper_bound", observation="state", seeds=1))
    parts += [rule_set_rows(rng), trial_rows(rng, gain=0.2)]
    looks = run_rows(rng, "visual", observation="textures(textures=baseline)", **two, **short)
    runs = pd.concat([*parts, looks], ignore_index=True)
    moved = [
        transfer_rows(grid, loss=2.0),
        transfer_rows(grid.head(6), 3.0, test_variation="gravity_40", test_difficulty="easy"),
        transfer_rows(looks, 0.5, test_observation="textures(textures=far)"),
        transfer_rows(looks, 1.0),
        between_rows(select(grid, difficulty="easy")),
    ]
    tables = {"runs": runs, "transfers": pd.concat(moved, ignore_index=True), "curves": curve_rows(runs)}
    return tables | {"probes": probe_rows(rng, runs)}


RULE_SETS = {"rule_sets_1": 4.0, "rule_sets_10": 3.5, "rule_sets_100": 2.7}
RULE_SETS |= {"rule_sets_10_near": 3.0, "rule_sets_10_far": 4.2}
"""Designs, and how far their rule sets are from those of the test."""


def rule_set_rows(
    rng: np.random.Generator, *, seeds: int = 3, of_distance: float = 0.0, of_number: float = 0.0
) -> pd.DataFrame:
    """Runs on few and many rule sets, whose gap in success falls by ``of_distance`` per unit of distance between dynamics and
    rises by ``of_number`` per factor of e in their number."""
    place = {"families": ("objectsx1",), "difficulties": ("medium",), "counts": (1_000,), "seeds": seeds}
    parts = []
    for design, distance in RULE_SETS.items():
        runs = run_rows(rng, "rule_sets", design=design, variation="rule_space", observation="state", **place)
        number = np.log(float(design.split("_")[2]))
        gap = -0.3 - of_distance * distance + of_number * number + 0.01 * rng.normal(size=len(runs))
        parts.append(runs.assign(success_test_deterministic=runs["success_train_deterministic"] + gap))
    return pd.concat(parts, ignore_index=True)


def rule_set_distances(runs: pd.DataFrame) -> pd.DataFrame:
    """The table of the study ``rule_set_distances`` of these runs."""
    table = runs[["family", "difficulty", "n", "seed", "design"]]
    return table.assign(dynamics_w2=[RULE_SETS[design] for design in table["design"]])


def trial_rows(rng: np.random.Generator, gain: float, seeds: int = 3) -> pd.DataFrame:
    """Runs over three trials, with a memory and without: it solves more in the last trial by ``gain``."""
    place = {"families": ("objectsx1",), "difficulties": ("medium",), "counts": (1_000,), "seeds": seeds}
    place |= {"variation": "rule_space", "observation": "state_past"}
    parts = []
    for algorithm, memory in (("ppo_recurrent", 1.0), ("ppo_fast", 0.0)):
        runs = run_rows(rng, "trials", algorithm=algorithm, **place)
        for trial in range(3):
            noise = 0.01 * rng.normal(size=len(runs))
            runs[f"success_trial_{trial}_test_deterministic"] = 0.5 + gain * memory * trial / 2 + noise
        parts.append(runs)
    return pd.concat(parts, ignore_index=True)


def player_rows(floor: float = -10.0, oracle: float = 0.0) -> pd.DataFrame:
    """Players without training that reach the same in every panel."""
    returns = {"idle": floor - 2.0, "random": floor - 1.0, "floor": floor, "oracle": oracle}
    places = product(FAMILIES, DIFFICULTIES, returns.items())
    rows = [(*place, *player, float(player[1] == oracle)) for *place, player in places]
    return pd.DataFrame(rows, columns=["family", "difficulty", "player", "return", "success"])


def write_players(folder: Path, players: pd.DataFrame) -> None:
    """The table of the study ``anchors`` in a results folder."""
    (folder / "studies" / "anchors").mkdir(parents=True)
    players.to_csv(folder / "studies" / "anchors" / "anchors.csv", index=False)


def evidence_of(folder: Path, tables: dict[str, pd.DataFrame]) -> Evidence:
    """What the tables of a results folder say."""
    return Evidence(read_results(write_results(folder, tables)))


def claims_of(evidence: Evidence) -> dict[str, Claim]:
    return {claim.name: claim for claim in read_claims(evidence)}


def write_results(folder: Path, tables: dict[str, pd.DataFrame]) -> Path:
    """A results folder with these tables."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        table.to_parquet(folder / f"{name}.parquet", index=False)
    return folder
