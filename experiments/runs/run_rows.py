"""One row per run, of any sweep: its settings, how far it is, and its final figures under short names.

The figures are those of all tables, also of the reproduction's: :func:`figures_of_run` builds them. They are named as those of
the summary: ``evaluation/test/success/sampled`` is ``success_test_sampled``, ``evaluation/gap/deterministic`` is
``gap_deterministic``, ``w2/exact`` is ``w2_exact``, and what the task ``charging`` calls ``charge`` among its results is
``results/charge_test_deterministic``. Mean returns are ``eta_train_deterministic`` and so on. Settings have their dotted names.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from segar.errors import SegarError
from segar.experiments.runs.executed_code import combined
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.level_prints import is_own, prints_in, share_of
from segar.experiments.runs.performance import SETS, performance
from segar.experiments.runs.run_folder import (
    CONFIG,
    EPISODES,
    EVALUATIONS,
    LEVELS_TEST,
    LEVELS_TRAIN,
    RESULTS,
    is_finished,
    is_locked,
    of_another_agent,
    read_config,
    read_episodes,
    read_evaluation,
    read_summary,
    read_versions,
    run_folders,
    sweeps_of,
)
from segar.experiments.runs.versions import computed_with
from segar.experiments.settings import ACTION_MODES, LevelsConfig, RunConfig, RunFolderError, flat
from segar.support import misfit

FINISHED = "finished"
UNREADABLE = "unreadable"
# Settings that a table has even where all runs agree.
ALWAYS = ("levels.train", "levels.count", "levels.seed", "algorithm.name", "observation.name", "seed")
DERIVED = ("algorithm.kind", "algorithm._target_")  # settings that follow from others
# The settings that decide a part of the executed code, by how their names begin; all runs share the other parts.
DECIDE_CODE = {"kernel": ("levels.", "task."), "levels": ("levels.",), "learner": ("algorithm.kind",)}
DECIDE_NO_CODE = ("levels.count", "levels.seed", "levels.design", "levels.test_count", "levels.test_seed")
LAST_DISTANCES = ("w2_reference", "w2_paper", "ks")  # stand behind all other modes of W2
NAMED = 3  # runs that a warning names
# What is read first.
FIRST = ("gap", "gap_se", "success_test", "success_train", "score", "regret", RESULTS, "eta_test", "eta_train")


@dataclass(frozen=True)
class RunRow:
    """A run: its folder, its state, why it has no figures where it failed, its settings and its figures."""

    folder: Path
    state: str  # "finished", or see :func:`state_of`, or "unreadable"
    problem: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    figures: Mapping[str, float] = field(default_factory=dict)
    sweeps: tuple[str, ...] = ()  # that it is of
    computed_with: str = ""  # what decided the last bits, see :func:`segar.experiments.runs.versions.computed_with`
    code: Mapping[str, str] = field(default_factory=dict)  # as executed_code of this room, without modules
    seen: float = 0.0  # the share of the test levels that are among the training levels
    unscored: str = ""  # why score and regret of its evaluation are left out
    planner: str = ""  # the search behind its score, as settings of segar evaluate; empty where that is not known
    name: str = ""  # that of the run, by its settings, whatever its folder is called; empty where it cannot be read
    copies: tuple[str, ...] = ()  # other folders of the same run, which do not count, with what they hold


def run_rows(places: Iterable[Path], trusted: Collection[str] = ()) -> list[RunRow]:
    """The runs in folders of runs, in their order; a place may be a run folder itself, and counts once.

    A folder that cannot be read is a row that says why.

    Args:
        trusted: as of :func:`segar.experiments.runs.run_folder.read_config`.

    Raises:
        RunFolderError: a place does not exist.
    """
    folders: dict[Path, None] = {}
    for place in places:
        if not place.is_dir():
            raise RunFolderError(f"there is no folder {place}; name one that holds run folders")
        found = [place] if (place / CONFIG).exists() else sorted(run_folders(place), key=_in_words_and_numbers)
        folders |= dict.fromkeys(found)
    return [_row(folder, trusted) for folder in folders]


def chosen_rows(places: Iterable[Path], sweep: str | None) -> list[RunRow]:
    """The runs of a sweep, or all, that lie in folders, each once; raises :class:`RunFolderError` where there is none."""
    places = list(places)
    found = run_rows(places)
    chosen = once_each([row for row in found if sweep in (None, *row.sweeps)])
    if not chosen:
        sweeps = sorted({name for row in found for name in row.sweeps})
        known = f"; there are the sweeps {', '.join(sweeps)}" if sweeps else ""
        which = f" of the sweep {sweep}" if sweep else ""
        raise RunFolderError(f"there is no run{which} in {', '.join(map(str, places))}{known}")
    return chosen


def once_each(rows: Sequence[RunRow]) -> list[RunRow]:
    """The rows with each run once, however many folders hold it: the first finished one, else the first; ``copies`` of it
    names the others. Runs are the same that have the same name, and so the same settings."""
    folders: dict[str, list[RunRow]] = {}
    for row in rows:
        folders.setdefault(row.name or str(row.folder), []).append(row)
    found: dict[Path, RunRow] = {}
    for same in folders.values():
        kept = next((row for row in same if row.state == FINISHED), same[0])
        copies = tuple(f"{row.folder} ({_compared(row, kept)})" for row in same if row is not kept)
        found[kept.folder] = replace(kept, copies=copies)
    return [found[row.folder] for row in rows if row.folder in found]


def _compared(copy: RunRow, kept: RunRow) -> str:
    """What a folder of a run holds beside the one that counts."""
    if copy.state != kept.state:
        return copy.state
    return "equal results" if repr(copy.figures) == repr(kept.figures) and copy.code == kept.code else "other results"


def copies_warning(rows: Iterable[RunRow]) -> str:
    """Which folders hold a run that another folder holds, too, and do not count; empty where none does."""
    if not (found := [f"{', '.join(row.copies)} beside {row.folder}, which counts" for row in rows if row.copies]):
        return ""
    return f"warning: the same run lies in several folders, and counts once: {_some(found, '; ')}"


def named_settings(rows: Sequence[RunRow]) -> list[str]:
    """:data:`ALWAYS`, and the other settings that tell the runs apart, in the order of the settings."""
    settings = [row.settings for row in rows if row.settings]
    names = dict.fromkeys(name for one in settings for name in one if name not in DERIVED)
    varied = [name for name in names if len({str(one.get(name)) for one in settings}) > 1]
    return list(dict.fromkeys((*ALWAYS, *varied))) if settings else []


def in_short(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[str]:
    """The names of settings without those of algorithms that ``algorithm.name`` decides in these rows, for people to read."""
    algorithms = {str(row.get("algorithm.name")) for row in rows}

    def is_decided(name: str) -> bool:
        pairs = {(str(row.get("algorithm.name")), str(row.get(name))) for row in rows}
        return name.startswith("algorithm.") and len(pairs) == len(algorithms) > 1

    return [name for name in names if name == "algorithm.name" or not is_decided(name)]


def as_columns(rows: Sequence[RunRow]) -> list[dict[str, Any]]:
    """The rows as plain data, all with the same columns: ``run``, settings, ``state``, figures, ``computed_with``,
    ``code`` (a fingerprint of the code that the run executed), ``problem``, ``folder``.

    What a run does not have is None. Fingerprints of runs on other levels, of another task or algorithm differ; where
    they should not, :func:`mixed_code` says.
    """
    names = named_settings(rows)
    figures = sorted({name for row in rows for name in row.figures}, key=_place)
    return [
        {
            "run": row.folder.name,
            **{name: row.settings.get(name) for name in names},
            "state": row.state,
            **{name: row.figures.get(name) for name in figures},
            "computed_with": row.computed_with,
            "code": combined(row.code) if row.code else None,
            "problem": row.problem,
            "folder": str(row.folder),
        }
        for row in rows
    ]


def mixed_code(rows: Iterable[RunRow]) -> dict[str, list[str]]:
    """The parts of the code that are not the same in all finished runs which share them, such as ``kernel`` or
    ``my_lab.tasks``, and of each the names of the runs in which it is another than in most; of equally many, the runs that
    differ in another part, too.

    Runs of one algorithm share the learner, runs on levels of one distribution the levels, and with one task, too, the
    kernel. All runs share each other part that they have, such as a module of the user's own.
    """
    done = [row for row in rows if row.code]
    found: dict[str, list[str]] = {}
    others: set[str] = set()
    for part in sorted({part for row in done for part in row.code}, key=lambda part: (part in DECIDE_CODE, part)):
        sharing: dict[tuple[Any, ...], list[RunRow]] = {}
        for row in (row for row in done if part in row.code):
            sharing.setdefault(_deciding(row, part), []).append(row)
        for group in sharing.values():
            counts = Counter(row.code[part] for row in group)
            known = Counter(row.code[part] for row in group if row.folder.name in others)
            most = max(counts, key=lambda value: (counts[value], -known[value]))
            other = [row.folder.name for row in group if row.code[part] != most]
            others |= {*other}
            if other:
                found[part] = [*found.get(part, ()), *other]
    return dict(sorted(found.items()))


def code_warning(runs: Sequence[RunRow]) -> str:
    """Which parts of the code are not the same in all runs of one table, and in which runs; empty where all are."""
    parts_of: dict[tuple[str, ...], list[str]] = {}
    for part, names in mixed_code(runs).items():
        parts_of.setdefault(tuple(names), []).append(part)
    if not parts_of:
        return ""
    which = [f"{', '.join(parts)} in {_some(names)}" for names, parts in parts_of.items()]
    return (
        f"warning: these runs were made by different code, so their means and differences are not those of settings and seeds"
        f" alone. Others than in most runs are"
        f" {'; '.join(which)}. Give the command of a sweep again with stale=anew: it trains what today's code did not make"
    )


def seen_warning(runs: Sequence[RunRow]) -> str:
    """In which runs test levels are among the training levels; empty where in none."""
    if not (found := [row for row in runs if row.seen]):
        return ""
    names, share = [row.folder.name for row in found], max(row.seen for row in found)
    return (
        f"warning: {share:.0%} of the test levels are training levels, too, in {_some(names)}. Such a gap says nothing of"
        " levels that an agent has not seen"
    )


def _some(names: Sequence[str], between: str = ", ") -> str:
    """The first names, and how many more there are."""
    return between.join(names[:NAMED]) + f" and {len(names) - NAMED} more" * (len(names) > NAMED)


def score_warnings(runs: Sequence[RunRow]) -> list[str]:
    """A line where scores are left out because they are by other code or of other weights, and one where several searches
    found the best known return; none where all scores can be compared."""
    found = []
    if left_out := [row for row in runs if row.unscored]:
        each = _some([f"that of {row.folder.name}{row.unscored}" for row in left_out], "; ")
        found.append(
            f"warning: score and regret are left out where the evaluation is by other code or of other weights than the run's:"
            f" {each}. Evaluate again, with the run's code: segar evaluate run=FOLDER levels=test"
        )
    sizes = sorted({row.planner for row in runs if row.planner})
    if len(sizes) > 1:
        found.append(
            f"warning: score and regret are measured by searches of several sizes: {'; '.join(sizes)}. A larger search finds a"
            " better best known return, so that these scores do not compare; evaluate all runs with the same"
        )
    return found


def figures_of_run(summary: Mapping[str, Any], episodes: pa.Table | None) -> dict[str, float]:
    """The figures of a run, or of a test of it: the numbers of its summary under the names of columns, and what
    :func:`segar.experiments.runs.performance.performance` makes of its episodes, which leads; NaN where an error is not known.

    The summary of a test on other levels has no results of the task on training levels: these come from the episodes.
    """
    summary = dict(summary)
    lacking = [one for one in SETS if not any(key.startswith(f"evaluation/{one}/{RESULTS}") for key in summary)]
    rows = episodes.to_pylist() if episodes is not None and lacking else []
    for levels, mode in product(lacking, ACTION_MODES):
        summary |= result_figures(rows, levels, mode)
    # +one: of truths, 0 or 1
    named = {_column(key): +one for key, one in summary.items() if misfit(one, (bool, int, float)) is None}
    return named | (performance(episodes) if episodes is not None else {})


def result_figures(episodes: Iterable[Mapping[str, Any]], levels: str, mode: str) -> dict[str, float]:
    """Means of the task's own results over the episodes of a level set in an action mode, as
    ``evaluation/test/results/<name>/deterministic``; results that are no single number or truth are left out."""
    chosen = [row for row in episodes if row["levels"] == levels and row["action_mode"] == mode]
    names = [name for name in (chosen[0] if chosen else ()) if name.startswith(RESULTS)]
    numbers = [name for name in names if all(isinstance(row[name], bool | int | float) for row in chosen)]
    return {f"evaluation/{levels}/{name}/{mode}": float(np.mean([row[name] for row in chosen])) for name in numbers}


def state_of(folder: Path) -> str:
    """The state of a run: finished, at work, stopped or failed (after so many frames), or cut off."""
    if is_finished(folder):
        return FINISHED
    if is_locked(folder):
        return "at work"
    *_, last = {"event": "not begun"}, *read_journal(folder)
    word = "cut off" if last["event"] in ("started", "lost") else last["event"]
    return f"{word} after {last['frames']:,} frames" if last.get("frames") else word


def _in_words_and_numbers(folder: Path) -> list[tuple[int, str]]:
    """Sorts names as people do: ``n8`` before ``n40``."""
    return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", folder.name)]


def _row(folder: Path, trusted: Collection[str]) -> RunRow:
    try:
        config = read_config(folder, trusted)
        settings, sweeps = flat(config.identity()), sweeps_of(folder, config)
        state = state_of(folder)
        if state != FINISHED:
            journal = read_journal(folder)
            problem = journal[-1].get("error", "") if journal else ""
            return RunRow(folder, state, problem, settings, sweeps=sweeps, name=config.label())
        about = read_versions(folder)
        parts = about.get("code", {})
        figures, seen = _figures(folder, config), _seen(folder, config.levels, about)
        scores, unscored, planner = _score(folder, config)
        made_with, figures = computed_with(about), figures | scores
        known = {"seen": seen, "unscored": unscored, "planner": planner, "name": config.label()}
        return RunRow(folder, state, "", settings, figures, sweeps, made_with, parts, **known)
    except (SegarError, OSError, ValueError) as error:
        return RunRow(folder, UNREADABLE, str(error))


def _deciding(row: RunRow, part: str) -> tuple[Any, ...]:
    """The settings of a run that decide a part of its code."""
    begins = DECIDE_CODE.get(part, ())
    names = (name for name in sorted(row.settings) if begins and name.startswith(begins) and name not in DECIDE_NO_CODE)
    return tuple((name, str(row.settings[name])) for name in names)


def _seen(folder: Path, levels: LevelsConfig, about: Mapping[str, Any]) -> float:
    """The share of the test levels that are training levels, from the level files where the levels are the user's own."""
    hashes = about.get("levels", {})
    if hashes and hashes.get("train") == hashes.get("test"):
        return 1.0
    if not is_own(levels.train):
        return 0.0
    return share_of(prints_in(folder / LEVELS_TEST), prints_in(folder / LEVELS_TRAIN))


def _figures(folder: Path, config: RunConfig) -> dict[str, float]:
    """The figures of a finished run that are known."""
    summary = read_summary(folder, config)
    found = figures_of_run(summary, read_episodes(folder) if (folder / EPISODES).exists() else None)
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _score(folder: Path, config: RunConfig) -> tuple[dict[str, float], str, str]:
    """What ``segar evaluate levels=test`` found of a finished run on its own test levels, if asked, by the code of the
    run: score and regret; why these are left out where they are of other weights; and the planner's search. A portable
    evaluation counts where there is no other.
    """
    name = f"test-n{config.levels.test_count}"
    places = (folder / EVALUATIONS / one for one in (name, f"{name}-portable"))
    found = next((one for one in map(read_evaluation, places) if "anchors" in (one or {})), None)
    if found is None:
        return {}, "", ""
    changed = found.get("changed_code")
    by_other_code = f" is by other code than the run's ({', '.join(changed)})" if changed else ""
    if unscored := by_other_code or of_another_agent(folder, found):
        return {}, unscored, ""
    named = [(f"{name}_{mode}", name, mode) for name in ("score", "regret") for mode in ACTION_MODES]
    scores = {column: found.get("players", {}).get(mode, {}).get(name) for column, name, mode in named}
    planner = " ".join(f"{name}={value}" for name, value in found.get("planner", {}).items())
    return {name: one for name, one in scores.items() if misfit(one, (int, float)) is None}, "", planner


def _column(key: str) -> str:
    group, *rest = key.split("/")
    if group == "evaluation" and len(rest) > 2:
        levels, *quantity, mode = rest
        return f"{'eta' if quantity == ['return'] else '/'.join(quantity)}_{levels}_{mode}"
    if group == "evaluation":
        return "_".join(rest)
    return "_".join(["w2", *rest]) if group == "w2" else key.removeprefix("diversity/")


def _place(name: str) -> tuple[Any, ...]:
    """Where a figure stands: exact W2 first, then by what people read first, deterministic before sampled."""
    if name.startswith("w2_") or name == "ks":
        return 0, LAST_DISTANCES.index(name) + 2 if name in LAST_DISTANCES else int(name != "w2_exact"), name
    mode = next((mode for mode in ACTION_MODES if name.endswith(f"_{mode}")), "")
    stem = RESULTS if name.startswith(RESULTS) else name.removesuffix(f"_{mode}")
    return 1, (*ACTION_MODES, "").index(mode), FIRST.index(stem) if stem in FIRST else len(FIRST), name
