"""Baselines that set the scale of grades: scripted experimenters, and the table of their grades over hidden worlds and budgets.

All but the first three fit laws to what they saw. They know the rule space, and what a session tells.
"""

import csv
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from segar.errors import SegarError
from segar.lab.grading import SETS, Grader
from segar.lab.hidden_world import START_LEVELS, Lab
from segar.lab.laws import EMPTY, laws_of
from segar.lab.session import Session
from segar.language import Velocity
from segar.support import data_in, from_csv, replacing

DRAWS = 1000  # of laws, of which the nearest is taken, and from which searches begin
KEPT, CHILDREN, GENERATIONS = 50, 150, 60  # of the evolutionary search
ROUNDS = 10  # in which the sequential experimenter spends its budget, at most
CANDIDATES = 32  # of experiments of each kind, from which it picks
ENSEMBLE = 20  # of laws, which disagree on them
CLOSE = 0.05  # [m, m/s] errors below it count by their square, others by their logarithm
PER_OPTION = 0.005  # of the loss, so that options without an effect are left out
SLOWER = 0.25  # of the range of velocities, in random experiments
STEPS_TRIED = (0.003, 0.03, 0.3)  # of constants in the search, as a share of their range
GUESSES = 100  # laws that are drawn, whose options are the terms of least squares
BOUNCE = 0.5  # [m/s] changes of velocity in a step that are greater come from contacts, and do not count there
LEAST_GAIN = 0.02  # of the squares, that one more term of least squares explains
SIZES = ("strength", "stiffness", "coefficient", "rate", "speed")  # constants to which an effect is proportional

Law: TypeAlias = dict[str, Any]
Seen: TypeAlias = list[dict[str, Any]]
"""Batches of experiments as the protocol has them, whose arrays lead with the experiment; ``observations`` is what was seen,
float64 ``(n, steps + 1, seen)``."""
Baseline: TypeAlias = Callable[[Session, np.random.Generator], Law]


def empty(session: Session, rng: np.random.Generator) -> Law:
    """No option."""
    return EMPTY


def default_physics(session: Session, rng: np.random.Generator) -> Law:
    """The options that are the default physics."""
    return {"options": {name: {} for name in ("lorentz", "friction") if name in session.lab.space.names}}


def nearest(session: Session, rng: np.random.Generator) -> Law:
    """Of 1,000 laws that are drawn from the rule space, the one that predicts random experiments best."""
    return _best(session, draw_laws(session.lab, DRAWS, rng), see_all(session, rng))[0]


def least_squares(session: Session, rng: np.random.Generator) -> Law:
    """Terms whose sum is nearest to the changes of velocities in experiments of one step, chosen one after the other.

    A term is what an option adds to velocities, for constants that are drawn; its size scales what it is proportional to.
    """
    lab, fast = session.lab, [k for k, name in enumerate(session.lab.places) if ".Velocity." in name]
    steps = random_experiments(session, session.left, rng, 1, set_factors=True)
    options = [(name, own) for law in draw_laws(lab, GUESSES, rng) for name, own in law["options"].items()]
    without = session.predict(EMPTY, **steps)[:, 1, fast]
    missing = session.experiment(**steps)[:, 1, fast] - without
    missing = np.where(abs(missing) < BOUNCE, missing, 0.0).ravel()
    terms = session.predict([{"options": {name: own}} for name, own in options], **steps)[:, :, 1, fast] - without
    terms = np.where(abs(terms) < BOUNCE, terms, 0.0).reshape(len(options), -1)
    norms, rest, sizes, chosen = np.linalg.norm(terms, axis=1), missing, np.zeros(0), list[int]()
    while True:
        names = [options[k][0] for k in chosen]
        may = np.array([norms[k] > 0 and _fits(lab, [*names, name]) for k, (name, _) in enumerate(options)])
        if not may.any():
            break
        gains = np.where(may, (terms @ rest) ** 2 / np.where(may, norms, 1.0) ** 2, -1.0)
        tried = [*chosen, int(gains.argmax())]
        found = np.linalg.lstsq(terms[tried].T, missing, rcond=None)[0]
        left = missing - found @ terms[tried]
        if left @ left > (1 - LEAST_GAIN) * (rest @ rest):
            break
        rest, sizes, chosen = left, found, tried
    return {"options": dict(_scaled(lab, *options[k], size) for k, size in zip(chosen, sizes, strict=True))}


def evolution(session: Session, rng: np.random.Generator) -> Law:
    """An evolutionary search for the law that predicts random experiments best; recordings, where the lab is passive."""
    return _evolved(session, draw_laws(session.lab, DRAWS, rng), see_all(session, rng), rng, GENERATIONS)[0]


def sequential(session: Session, rng: np.random.Generator) -> Law:
    """The same search, between experiments that are, among random ones, those on which the best laws disagree most."""
    number = session.left // session.lab.most_steps
    rounds = min(ROUNDS, number)
    laws = draw_laws(session.lab, DRAWS, rng)
    seen = _see(session, [], random_experiments(session, 1, rng))
    for k in range(1, rounds):
        laws = _evolved(session, [*laws, *draw_laws(session.lab, DRAWS, rng)], seen, rng, GENERATIONS // rounds)
        tried = [random_experiments(session, CANDIDATES, rng, set_factors=own) for own in (False, True)]
        spread = np.concatenate([session.predict(laws[:ENSEMBLE], **one).var(axis=0) for one in tried])
        doubt = np.nanmean(np.log1p(spread / CLOSE**2), axis=(1, 2))
        size = (number * (k + 1)) // rounds - (session.lab.budget - session.left) // session.lab.most_steps
        chosen = np.argsort(-doubt)[:size]
        for kind, one in enumerate(tried):
            seen = _see(session, seen, _picked(one, chosen[chosen // CANDIDATES == kind] % CANDIDATES))
    return _evolved(session, [*laws, *draw_laws(session.lab, DRAWS, rng)], seen, rng, GENERATIONS)[0]


BASELINES: Mapping[str, tuple[Baseline, bool]] = {
    "empty": (empty, False),
    "default physics": (default_physics, False),
    "random draw": (lambda session, rng: draw_laws(session.lab, 1, rng)[0], False),
    "nearest of 1,000": (nearest, False),
    "least squares": (least_squares, False),
    "evolution, passive": (evolution, True),
    "evolution": (evolution, False),
    "sequential": (sequential, False),
}
"""Experimenters by name, and whether the lab is passive."""

COLUMNS: tuple[str, ...] = (
    "lab", "world", "budget", "baseline", "score", "low", "high", *SETS, "precision", "recall", "bits", "seconds",
)  # fmt: skip


def grade_baselines(
    path: str | PathLike[str], lab: Lab, worlds: int = 30, budgets: Sequence[int] = (40, 200, 1000),
    baselines: Sequence[str] = tuple(BASELINES),
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Grade baselines, and write a row for each hidden world, budget and baseline to a CSV file; gives each row when it is
    written. Rows that are there already are kept, so that a command that was stopped goes on.

    Args:
        lab: whose other settings count.

    Raises:
        SegarError: the file is none of this lab, or cannot be written; or a baseline is not known.
    """
    path = Path(path)
    identity = f"{lab.distribution.hash}-{lab.seed}-{lab.most_steps}-{lab.noise:g}"
    rows = read_grades(path) if path.exists() else []
    if other := {row["lab"] for row in rows} - {identity}:
        raise SegarError(f"{path} holds grades of another lab, {', '.join(other)}; name another file")
    done = {(row["world"], row["budget"], row["baseline"]) for row in rows}
    for world in range(worlds):
        missing = [(b, name) for b in budgets for name in baselines if (str(world), str(b), name) not in done]
        if not missing:
            continue
        grader = Grader(replace(lab, world=world))
        for budget, name in missing:
            rows.append({"lab": identity, **_row(grader, world, budget, name)})
            with replacing(path, "the grades") as beside, beside.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(rows)
            yield rows[-1]


def read_grades(path: str | PathLike[str]) -> list[dict[str, Any]]:
    """The rows of a table of grades, as text; raises :class:`SegarError` where the file is none."""
    return data_in(Path(path), "a table of grades", SegarError, lambda text: from_csv(text, COLUMNS))


def _row(grader: Grader, world: int, budget: int, name: str) -> dict[str, Any]:
    if name not in BASELINES:
        raise SegarError(f"there is no baseline '{name}'; they are {', '.join(BASELINES)}")
    baseline, passive = BASELINES[name]
    start = time.process_time()
    session = Session(replace(grader.lab, budget=budget, passive=passive))
    law = baseline(session, np.random.default_rng((grader.lab.seed, world, budget)))
    seconds = time.process_time() - start
    grade = grader.grade(law)
    own = {"precision": grade.precision, "recall": grade.recall, "bits": grade.bits, "seconds": round(seconds, 2)}
    scores = {"score": grade.score.value, "low": grade.score.low, "high": grade.score.high}
    scores |= {name: score.value for name, score in grade.scores.items()}
    return {"world": world, "budget": budget, "baseline": name} | scores | own


# What baselines share: experiments, and laws that fit what was seen.


def draw_laws(lab: Lab, number: int, rng: np.random.Generator) -> list[Law]:
    """Laws that are drawn from the rule space."""
    return laws_of(lab.space, lab.space.sample(lambda *_: rng, number))


def random_experiments(
    session: Session, number: int, rng: np.random.Generator, steps: int | None = None, *, set_factors: bool = False
) -> dict[str, Any]:
    """Experiments with random actions in levels as they are; or in which everything that can be set is drawn within its
    bounds, velocities slower."""
    lab, task, chosen = session.lab, session.lab.task, dict[str, dict[str, np.ndarray]]()
    for slot in lab.hidden.layout.slots[:-1]:
        for factor, (low, high) in lab.settable.items():
            if set_factors and slot.must_have(factor):
                share = SLOWER if factor is Velocity else 1.0
                shape = (number,) if factor.width == 1 else (number, factor.width)
                chosen.setdefault(slot.name, {})[factor.__name__] = share * rng.uniform(low, high, shape)
    actions = rng.uniform(task.action_low, task.action_high, (number, steps or lab.most_steps, len(task.action_low)))
    return {"level": rng.integers(START_LEVELS, size=number), "set": chosen, "actions": actions}


def see_all(session: Session, rng: np.random.Generator) -> Seen:
    """The recordings of a passive lab; else random experiments for all of the budget, half of them with factors set."""
    seen: Seen = []
    for one in session.recordings:
        seen = _with(seen, {"set": {}, **{name: np.asarray(value)[None] for name, value in one.items()}})
    number = session.left // session.lab.most_steps
    for size, own in ((number - number // 2, False), (number // 2, True)):
        seen = _see(session, seen, random_experiments(session, size, rng, set_factors=own))
    return seen


def losses(session: Session, laws: Sequence[Law], seen: Seen) -> np.ndarray:
    """How far laws are from what was seen, float64 ``(laws,)``."""
    apart = list[np.ndarray]()
    for one in seen:
        asked = {name: value for name, value in one.items() if name != "observations"}
        apart.append((session.predict(list(laws), **asked) - one["observations"]).reshape(len(laws), -1))
    options = np.array([len(law["options"]) for law in laws])
    return np.nanmean(np.log1p((np.concatenate(apart, axis=1) / CLOSE) ** 2), axis=1) + PER_OPTION * options


def _see(session: Session, seen: Seen, experiments: dict[str, Any]) -> Seen:
    """What was seen, and these experiments, if there are any."""
    if not len(experiments["level"]):
        return seen
    return _with(seen, {**experiments, "observations": session.experiment(**experiments)})


def _with(seen: Seen, more: dict[str, Any]) -> Seen:
    """What was seen, and one batch more, which joins that of its kind: each batch of predictions costs a check of the laws."""
    rest = list[dict[str, Any]]()
    for one in seen:
        if one["set"].keys() == more["set"].keys() and one["actions"].shape[1:] == more["actions"].shape[1:]:
            more = _joined(one, more)
        else:
            rest.append(one)
    return [*rest, more]


def _best(session: Session, laws: Sequence[Law], seen: Seen) -> list[Law]:
    return [laws[k] for k in np.argsort(losses(session, laws, seen), kind="stable")]


def _evolved(session: Session, laws: list[Law], seen: Seen, rng: np.random.Generator, generations: int) -> list[Law]:
    """The best laws of an evolutionary search, the best one first."""
    lab, kept = session.lab, _best(session, laws, seen)[:KEPT]
    for _ in range(generations):
        pairs = rng.integers(len(kept), size=(CHILDREN, 2))
        drawn = zip(pairs, draw_laws(lab, CHILDREN, rng), strict=True)
        children = [_child(lab, kept[a], kept[b], fresh, rng) for (a, b), fresh in drawn]
        kept = _best(session, kept + children, seen)[:KEPT]
    return kept


def _child(lab: Lab, one: Law, other: Law, fresh: Law, rng: np.random.Generator) -> Law:
    """A law near its parents: constants are moved; an option is taken from the other parent or anew, or left out."""
    options = {name: dict(constants) for name, constants in one["options"].items()}
    sort = rng.integers(4)
    if sort == 0 and options:
        del options[list(options)[rng.integers(len(options))]]
    if sort < 2 or not options:
        source = (other if rng.random() < 0.3 else fresh)["options"]
        for name in rng.permutation(list(source))[: 1 + rng.integers(2)].tolist():
            if _fits(lab, [*options, name]):
                options[name] = dict(source[name])
    else:
        step = STEPS_TRIED[rng.integers(len(STEPS_TRIED))]
        for name, constants in options.items():
            for constant, (low, high) in lab.ranges[name].items():
                if high > low and rng.random() < 0.7:
                    moved = constants[constant] + step * (high - low) * rng.normal()
                    constants[constant] = float(np.clip(moved, low, high))
    return {"options": options}


def _scaled(lab: Lab, name: str, constants: dict[str, float], size: float) -> tuple[str, dict[str, float]]:
    """An option, with the constants to which its effect is proportional times ``size``, within their ranges."""
    sizes, ranges = [c for c in constants if c.endswith(SIZES)] or list(constants), lab.ranges[name]
    return name, constants | {c: float(np.clip(constants[c] * size, *ranges[c])) for c in sizes}


def _fits(lab: Lab, names: Sequence[str]) -> bool:
    """Whether these options can hold together: few enough, each once, and none that excludes another."""
    places = {lab.space.index(name) for name in names}
    few = len(names) == len(places) <= lab.space.count.atoms[0].max()
    return few and not lab.space.excludes(places)


def _picked(batch: Mapping[str, Any], rows: np.ndarray) -> dict[str, Any]:
    """Some experiments of a batch."""
    return {k: _picked(value, rows) if isinstance(value, dict) else value[rows] for k, value in batch.items()}


def _joined(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """The experiments of two batches of one kind."""
    return {
        k: _joined(value, other[k]) if isinstance(value, dict) else np.concatenate([value, other[k]])
        for k, value in one.items()
    }
