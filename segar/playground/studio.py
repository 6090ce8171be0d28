"""What a studio answers: new draws from edited distributions, distances, plans and hardness, with the library itself."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from segar.envs import VectorEnv
from segar.errors import LevelError, SegarError, UnseenDifferenceWarning
from segar.hardness import Plan, hardness, influence, plan
from segar.language import Position, Task
from segar.levels import LevelDistribution, Levels, read_distribution, written
from segar.metrics import ks_report, w2_report
from segar.observations import Observation
from segar.playground.page import MOST_LEVELS, make_playground
from segar.playground.run_folder import read_policy
from segar.policies import NETWORK_FILE
from segar.rendering import Stage
from segar.rules import World
from segar.support import misfit
from segar.tasks import task_of

W2_RESAMPLES = 100
KS_RESAMPLES = 199
MOST_THINGS = 200_000  # of all levels of a set, so that it is drawn within seconds
SEED_DIGITS = 18  # of the seed of an episode
SEED = 0  # of resamples, of the search, and of random play
INFLUENCE_LEVELS = 20  # of a set, in which it is tried what actions change
FORMS: dict[str, dict[str, Any]] = {
    "draw": {"version": int, "set": int, "text": str, "seed": int, "split": str, "number": int},
    "distance": {"version": int},
    "plan": {"set": int, "level": str, "seed": str},
    "hardness": {"version": int, "set": int},
    "runs": {},
    "policy": {"version": int, "run": (str, None)},
}
"""What each question to a studio holds; see :func:`segar.support.misfit`."""

Question = Mapping[str, Any]
Observations = Sequence[str | Observation] | Mapping[str, str | Observation]


@dataclass(frozen=True)
class Side:
    """A level set of a studio, and the distribution that it was drawn from, if that is known."""

    levels: Levels
    distribution: LevelDistribution | None
    text: str | None

    @classmethod
    def of(cls, levels: Levels) -> "Side":
        """The set with the text of its distribution; a level file has none."""
        found = levels.distribution if isinstance(levels.distribution, LevelDistribution) else None
        return cls(levels, found, None if found is None else written(found))


class Studio:
    """A page with the library behind it.

    One question at a time may be asked; the sets change only when the answer is complete.

    Args:
        levels: what is shown.
        test: levels of another distribution, or None.
        task: what is played; where it is None, the one that a run plays whose policy was chosen, or that the levels name.
        observations: what agents see, as :func:`make_playground` takes it.
        runs: the folder whose run folders have networks that play, or None.
    """

    def __init__(
        self,
        levels: Levels,
        test: Levels | None = None,
        *,
        task: Task | None = None,
        observations: Observations = ("rgb",),
        runs: Path | None = None,
    ) -> None:
        self.sides = tuple(Side.of(one) for one in (levels, test) if one is not None)
        self._wanted, self.observations = task, observations
        self.runs = None if runs is None else runs.resolve()
        self.run: str | None = None
        self.version = 0
        self.html, self.task = self._page(self.sides, None)

    def answer(self, name: str, question: Question) -> dict[str, Any]:
        """The answer to a question, as plain data.

        Args:
            name: one of :data:`FORMS`.

        Raises:
            SegarError: the question has another form, or has no answer; the message says why.
        """
        if wrong := misfit(question, FORMS[name]):
            raise SegarError(f"{name}: {wrong}")
        if question.get("version", self.version) != self.version:
            raise SegarError("the studio shows other levels now, because they were drawn anew; reload the page")
        if not 0 <= question.get("set", 0) < len(self.sides):
            raise SegarError(f"there are {len(self.sides)} level sets here, and no set {question['set']}")
        return getattr(self, f"_{name}")(question)

    def _draw(self, question: Question) -> dict[str, Any]:
        """Draw a set anew, from the distribution that a text says."""
        at, number = question["set"], question["number"]
        origin = self.sides[at].distribution
        if origin is None:
            raise LevelError("these levels come from a file, which holds no distribution to draw from")
        if not 1 <= number <= MOST_LEVELS:
            raise LevelError(f"a set of a page has 1 to {MOST_LEVELS:,} levels, not {number}")
        distribution = read_distribution(question["text"], origin)
        things = number * (len(distribution.layout.slots) - 1)  # without the floor
        if things > MOST_THINGS:
            raise LevelError(
                f"draw: {number:,} levels of this distribution can have {things:,} things, and the studio draws at most"
                f" {MOST_THINGS:,}; ask for fewer levels, or for fewer things by 'numbers'"
            )
        levels = distribution.sample(number, question["seed"], question["split"])
        sides = list(self.sides)
        # The origin stays, so that its names are known and its name does not grow; the text stays as the person wrote it.
        sides[at] = Side(levels, origin, question["text"])
        self._change(tuple(sides), self.run)
        return {"version": self.version, "name": levels.provenance.name, "distribution": distribution.hash}

    def _distance(self, question: Question) -> dict[str, Any]:
        """How far both sets are apart, as they were drawn."""
        if len(self.sides) < 2:
            raise LevelError("a distance is that of two sets, and here is one; start the studio with --test")
        a, b = (side.levels for side in self.sides)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnseenDifferenceWarning)  # the answer says it
            w2 = w2_report(a, b, rng=np.random.default_rng(SEED), resamples=W2_RESAMPLES)
            ks = ks_report(a, b, rng=np.random.default_rng(SEED), resamples=KS_RESAMPLES)
        known = {name: None if value != value else value for name, value in asdict(w2).items()}  # JSON has no NaN
        return {"w2": known, "ks": asdict(ks), "levels": [len(a), len(b)]}

    def _plan(self, question: Question) -> dict[str, Any]:
        """The best known episode on a level, as it is in the page now, and the way of the agent's body in it."""
        if not (question["seed"].isdecimal() and len(question["seed"]) <= SEED_DIGITS):
            raise SegarError(f"plan: 'seed' must be a whole number of at most {SEED_DIGITS} digits")
        seed = int(question["seed"])
        levels = self.sides[question["set"]].levels
        task = self.task or task_of(levels)  # not that of the text, because the name of a task may import code
        level = _level_of(question["level"], levels.world)
        found = plan(level, task, rng=np.random.default_rng(SEED), seed=seed)
        return {
            "solved": bool(found.solved[0]),
            "died": bool(found.died[0]),
            "steps": int(found.steps[0]),
            "return": float(found.returns[0]),
            "rollouts": found.rollouts,
            "actions": found.actions[0, : found.steps[0]].tolist(),
            "path": _path_of(level, found, task),
        }

    def _hardness(self, question: Question) -> dict[str, Any]:
        """How random play, a script and the planner fare on a set, and what actions change in its first levels."""
        levels = self.sides[question["set"]].levels
        found = hardness(levels, self.task, rng=np.random.default_rng(SEED))
        tried = levels[:INFLUENCE_LEVELS]
        factors = influence(tried, self.task, rng=np.random.default_rng(SEED)).factors
        return {
            "summary": found.summary(),
            "levels": found.rows(),
            "factors": [asdict(one) for one in factors if one.kind == "endogenous"],
            "tried": len(tried),
        }

    def _runs(self, question: Question) -> dict[str, Any]:
        """The folders of runs or evaluations with a network that plays without torch."""
        return {"runs": sorted(self._found_runs()), "run": self.run}

    def _policy(self, question: Question) -> dict[str, Any]:
        """Have the policy of a run play in the page, or none."""
        run = question["run"]
        if run is not None and run not in self._found_runs():
            raise SegarError(f"there is no run {run!r} with a {NETWORK_FILE} below the folder of --runs")
        self._change(self.sides, run)
        return {"version": self.version}

    def _found_runs(self) -> dict[str, Path]:
        """Folders that hold a network, by their path below the folder of runs.

        A folder is left out where a link in it, or in the folder of its run, leads out of the folder of runs.
        """
        if self.runs is None:
            return {}
        found = {}
        for folder in (file.parent for file in self.runs.rglob(NETWORK_FILE)):
            near = [place for place in (folder, folder.parent.parent) if place.is_relative_to(self.runs)]
            if all(one.resolve().is_relative_to(self.runs) for place in near for one in place.iterdir()):
                found[folder.relative_to(self.runs).as_posix()] = folder
        return found

    def _change(self, sides: tuple[Side, ...], run: str | None) -> None:
        """Show other sets or another policy, once the page with them is there."""
        html, task = self._page(sides, run, self.version + 1)
        self.sides, self.run, self.html, self.task, self.version = sides, run, html, task, self.version + 1

    def _page(self, sides: Sequence[Side], run: str | None, version: int = 0) -> tuple[str, Task | None]:
        """The page with these sets, and with the policy of a run; and its task, None for that of the sets."""
        player = None if run is None else read_policy(self._found_runs()[run], sides[0].levels)
        task = self._wanted or (player.task if player else None)
        levels = [side.levels for side in sides]
        drawn = [
            {"text": side.text, "seed": one.provenance.seed, "split": one.provenance.split, "number": len(one)}
            for side, one in zip(sides, levels, strict=True)
        ]
        page = make_playground(
            *levels,
            task=task,
            observations=player.observations or self.observations if player else self.observations,
            policy=player.network if player else None,
            probes=player.probes if player else {},
            title=" and ".join(dict.fromkeys(one.provenance.name or "levels made by hand" for one in levels)),
            studio={"version": version, "sets": drawn, "runs": self.runs is not None, "run": run},
        )
        return page.html, task


def _level_of(text: str, world: World | None) -> Levels:
    """The first level in the text of a level file; raises :class:`LevelError`."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "level.json"
        path.write_bytes(text.encode(errors="replace"))
        try:
            return Levels.load(path, world)[:1]
        except LevelError as error:
            raise LevelError(str(error).replace(str(path), "the level of the page")) from error


def _path_of(level: Levels, found: Plan, task: Task) -> list[list[float]]:
    """The places [m] of the agent's body in a plan on one level; none where no body is the agent's."""
    env = VectorEnv(level, 1, task=task, seed=found.seed, autoreset_mode="Disabled")
    agents = sorted(Stage(level, env.simulator.world, env.task).agents)
    if not agents:
        return []
    column = level.layout.columns[Position]
    env.reset()
    path = [env.state().state.values[0, agents[0], column : column + 2].tolist()]
    for step in range(found.steps[0]):
        env.step(found.actions[:, step])
        path.append(env.state().state.values[0, agents[0], column : column + 2].tolist())
    return path
