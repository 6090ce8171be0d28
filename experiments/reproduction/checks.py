"""What is checked before a plan is made, so that a wrong name ends the plan, and not its runs."""

import dataclasses
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from segar.errors import SegarError, did_you_mean, naming
from segar.experiments.evaluation.transfers import RunTask
from segar.experiments.levels.builders import Prepared, check_observations, distribution_of
from segar.experiments.reproduction.experiment_file import (
    FEWEST_BLOCKS,
    OF_GRID,
    OF_TASK,
    TESTS,
    ClaimConfig,
    Experiment,
    claim_config,
)
from segar.experiments.reproduction.grid import (
    AGENT_SEED,
    compares_panels,
    kind_columns,
    pair_columns,
    run_columns,
    varied_columns,
)
from segar.experiments.runs.run_folder import RESULTS
from segar.experiments.settings import ConfigError, LevelsConfig, RunConfig, grid_point, import_object
from segar.levels import check_fits, places
from segar.support import counted

NUMBERS = ("n", "levels", "seed", AGENT_SEED)  # columns of numbers, which tell no panels apart
PICTURES = ("rgb", "textures")  # how the names of observations begin that fit all levels


def check_objects(runs: Iterable[RunConfig]) -> None:
    """Raises :class:`ConfigError` for the first run whose levels, task, observation or algorithm cannot be made.

    Each is made once, however many runs have it, so that a wrong name ends a plan, and not its runs.
    """
    seen: set[str] = set()

    def is_new(*settings: Any) -> bool:
        known = repr(settings) in seen
        seen.add(repr(settings))
        return not known

    for run in runs:
        levels, algorithm = dataclasses.replace(run.levels, count=1, seed=0), run.algorithm
        try:
            if is_new(levels):
                for which in ("train", "test"):
                    distribution_of(levels, which)
            if is_new(levels, run.task, run.observation):  # the task may be that of the levels
                Prepared(run).env_options()
            for name in (algorithm.learner, getattr(algorithm, "encoder", "")):
                if ":" in name and not name.startswith("segar.") and is_new(name):
                    import_object(name, "algorithm")
        except SegarError as error:
            setting, _, problem = str(error).partition(": ")
            place = f"grid.{OF_GRID[setting]}: {problem}" if setting in OF_GRID else f"{run.label()}: {error}"
            raise ConfigError(place) from error


def check_transfers(works: Iterable[RunTask]) -> None:
    """Raises :class:`ConfigError` if an agent that sees states would not see the same numbers in the levels of a transfer."""
    seen = set()
    for work in works:
        for transfer in (one for one in work.transfers if one.mixture is None):
            there = dataclasses.replace(
                work.run.levels, test=transfer.panel, test_variation=transfer.variation, count=1, seed=0
            )
            run = dataclasses.replace(work.run, observation=transfer.observation, levels=there)
            kind = repr((there, run.observation, run.task))
            if kind in seen or run.observation.name.startswith(PICTURES):
                continue
            seen.add(kind)
            with naming(f"transfers: {transfer.label}", ConfigError):
                check_observations(
                    Prepared(run), *(distribution_of(there, which).sample(1) for which in ("train", "test"))
                )


def columns_of_works(experiment: Experiment, works: Sequence[RunTask]) -> list[tuple[RunTask, dict[str, str]]]:
    """The runs of an experiment, each with the columns that claims may name before there are results; none without claims."""
    varied = experiment.grid.vary if experiment.grid else {}
    found = []
    for work in works if experiment.claims else ():
        run, cell = work.run, grid_point(work.run)
        place_columns = {"panel": cell.panel, "levels": cell.count, "seed": run.levels.seed, AGENT_SEED: run.seed}
        place_columns["cell"] = "-".join((cell.family, cell.difficulty, str(cell.count)))
        columns = {**run_columns(run, ""), **place_columns, **varied_columns(run, varied)}
        found.append((work, {name: str(value) for name, value in columns.items()}))
    return found


def check_claims(experiment: Experiment, works: Sequence[RunTask]) -> None:
    """Raises :class:`ConfigError` if a claim names a setting, a value of one, or a transfer that no run has.

    What only results say, such as a column of figures, is known to the report alone.
    """
    columns_of = columns_of_works(experiment, works)
    known: dict[str, set[str]] = {}
    for _, columns in columns_of:
        for name, value in columns.items():
            known.setdefault(name, set()).add(value)
    labels = sorted({one.label for work in works for one in work.transfers if one.mixture is None})
    for name, stated in experiment.claims.items():
        claim, place = claim_config(stated, f"claims.{name}"), f"claims.{name}"
        if claim.tested_on and claim.tested_on not in labels:
            there = f"transfers are {', '.join(labels)}" if labels else "the study has no transfers"
            raise ConfigError(
                f"{place}.tested_on: no agent is tested on '{claim.tested_on}'; {there}.{did_you_mean(claim.tested_on, labels)}"
            )
        if ":" in claim.test:
            import_object(claim.test, f"{place}.test")
        for key, columns in (("of", [claim.of]), ("against", [claim.against]), ("given", claim.given)):
            for column in columns:
                check_setting(f"{place}.{key}", column, known)
                check_result(f"{place}.{key}", column, works)
                if key == "of" or (key == "against" and claim.test == "correlation"):
                    check_numbers(f"{place}.{key}", column, known)
        for key, asked in (("between", claim.between), ("where", claim.where)):
            for column, values in asked.items():
                check_setting(f"{place}.{key}", column, known)
                for value in values if isinstance(values, list | tuple) else [values]:
                    if column in known and str(value) not in known[column]:
                        there = ", ".join(sorted(known[column], key=lambda text: (len(text), text)))  # numbers in order
                        raise ConfigError(f"{place}.{key}: no run has {column}={value}; there are {there}.")
                    there = [work for work, columns in columns_of if columns.get(column) == str(value)]
                    if (
                        claim.tested_on
                        and there
                        and not any(is_tested_on(claim.tested_on, work, works) for work in there)
                    ):
                        raise ConfigError(
                            f"{place}.tested_on: no agent with {column}={value} is tested on '{claim.tested_on}': its own test"
                            " levels are others, and it has no such transfer. Leave levels.test out, or compare other agents"
                        )
        if claim.test == "difference":
            check_pairs(place, claim, [columns for work, columns in columns_of if counts(claim, work, columns, works)])


def counts(claim: ClaimConfig, work: RunTask, columns: Mapping[str, str], works: Sequence[RunTask]) -> bool:
    """Whether a run, which has these columns, is one that a claim is about."""
    for name, value in claim.where.items():
        values = value if isinstance(value, list | tuple) else [value]
        if name in columns and columns[name] not in map(str, values):
            return False
    return not claim.tested_on or is_tested_on(claim.tested_on, work, works)


def untestable_claims(experiment: Experiment, works: Sequence[RunTask]) -> Iterable[str]:
    """A warning for each claim that has too few blocks in these runs for an interval, and so for a verdict.

    The blocks are those of the report, as far as they are known before there are results: seeds whose level sets turn out to be
    equal are told apart here.
    """
    columns_of = columns_of_works(experiment, works)
    for name, stated in experiment.claims.items():
        claim = claim_config(stated, f"claims.{name}")
        runs = [columns for work, columns in columns_of if counts(claim, work, columns, works)]
        if claim.test == "difference":
            runs = check_pairs(f"claims.{name}", claim, runs)
        if claim.test not in TESTS or not runs:  # a test of one's own, or what only results say
            continue
        given = [[run[one] for run in runs] for one in claim.given if one in runs[0] and one not in NUMBERS]
        if claim.test == "correlation" and compares_panels([run["panel"] for run in runs], given):
            blocks = {run["panel"] for run in runs}
            what = "whole panels, which the correlation compares; given: [panel] asks within panels"
        else:
            blocks = {(run["panel"], run["seed"]) for run in runs}
            what = "level sets of a panel; grid.seeds gives more"
        if len(blocks) < FEWEST_BLOCKS:
            yield (
                f"warning: claims.{name} cannot be tested by this design: it has "
                f"{counted(len(blocks), 'block')}, and an interval takes {FEWEST_BLOCKS}. Its blocks are {what}"
            )


def check_pairs(place: str, claim: ClaimConfig, runs: Sequence[Mapping[str, str]]) -> list[Mapping[str, str]]:
    """The runs, of these with these columns, that a claim about two values of a column compares with a run that differs in it
    alone, as the report pairs them; none where only results say the column.

    Raises:
        ConfigError: no two runs differ in it alone.
    """
    ((by, (first, second)),) = claim.between.items()
    if not runs or by not in runs[0]:  # what only results say, such as a column of figures
        return []
    parts = [[run for run in runs if run[by] == str(value)] for value in (first, second)]
    for value, part in zip((first, second), parts, strict=True):
        if not part:
            raise ConfigError(f"{place}.between: no run that counts has {by}={value}")
    shared = [
        name for name in ("family", "difficulty") if {one[name] for one in parts[0]} & {one[name] for one in parts[1]}
    ]
    kinds = dict.fromkeys([*kind_columns(runs[0]), *(name for name in runs[0] if "." in name)])
    at = pair_columns(by, shared, "seed", kinds)
    places = {tuple(run[name] for name in at) for run in parts[1]}
    if not (compared := [run for run in parts[0] if tuple(run[name] for name in at) in places]):
        raise ConfigError(
            f"{place}.between: no two runs are equal but for {by}={first} and {second}, so that it cannot be tested: runs are"
            f" compared that have the same {', '.join(at)}"
        )
    return compared


def is_tested_on(label: str, work: RunTask, works: Sequence[RunTask]) -> bool:
    """Whether an agent is tested on the levels of a transfer: by a transfer, or because they are its own test levels."""
    alike = [one for other in works for one in other.transfers if one.label == label and one.mixture is None]
    run, panel = work.run, grid_point(work.run).panel
    own = run.levels.test is None and run.levels.test_variation is None
    return any(one.label == label for one in work.transfers) or any(
        own and (one.panel, one.variation, one.observation) == (panel, run.levels.variation, run.observation)
        for one in alike
    )


def check_result(place: str, column: str, works: Sequence[RunTask]) -> None:
    """Raises :class:`ConfigError` for a column of a result that no task of the runs has."""
    found = OF_TASK.fullmatch(re.sub(r"_(deterministic|sampled)$", "", column))
    if found is None:
        return
    runs = {repr((work.run.task, work.run.levels.train)): work.run for work in works}
    results = {task.name: task.results for task in (Prepared(run).task for run in runs.values())}
    name = found[0].removeprefix(RESULTS).removesuffix(f"_{found[1]}")
    known = sorted({one for those in results.values() for one in those})
    if name not in known:
        has = "; ".join(f"{task} has {', '.join(those) or 'none'}" for task, those in results.items())
        raise ConfigError(
            f"{place}: no task has a result '{name}', as {column} asks: {has}.{did_you_mean(name, known)}"
        )


def check_setting(place: str, column: str, known: Collection[str]) -> None:
    """Raises :class:`ConfigError` for a dotted name of a setting that the grid does not vary."""
    if "." in column and not column.startswith(RESULTS) and column not in known:
        raise ConfigError(f"{place}: runs do not differ in {column}; grid.vary has such settings")


def check_numbers(place: str, column: str, known: Mapping[str, Collection[str]]) -> None:
    """Raises :class:`ConfigError` for a column of which the plan knows that it holds text."""
    for value in sorted(known.get(column, ())):
        try:
            float(value)
        except ValueError:
            raise ConfigError(
                f"{place}: the column {column} holds text, such as '{value}', and numbers are needed; name a column of numbers,"
                f" or compare two values by test: difference and between: {{{column}: [...]}}"
            ) from None


def check_groups(experiment: Experiment, levels: LevelsConfig) -> None:
    """Raises :class:`ConfigError` unless training and test levels can be mixed and have the factors of the groups."""
    train, test = (distribution_of(levels, which).sample(1, seed=0, split=which) for which in ("train", "test"))
    with naming(f"grids.{experiment.name}.attribution: {levels.train}", ConfigError):
        check_fits(train, test)
        places(train, experiment.attribution)
