"""The generalization gap of any policy: episodes on training levels and on test levels, and an interval over levels."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from segar.envs import Policy, VectorEnv, actions_of, begin_policy, known_options
from segar.errors import ActionError, SegarError, did_you_mean
from segar.evaluation.baselines import ROUNDING, Baselines, find_baselines
from segar.evaluation.episodes import QUANTITIES, PlayedEpisodes, play_episodes
from segar.hardness import wilson_interval
from segar.levels import Levels, checks
from segar.metrics import w2
from segar.observations import trained_on
from segar.support import ShownInNotebooks, aligned, counted, is_whole

CONFIDENCE = 0.95
TRIAL_QUANTITIES = ("return", "success")  # quantities that are told trial by trial
SHARES = ("success", "death")  # quantities that are shares of episodes
OF_SETS = ("score", "regret")  # figures of level sets, which are not means of quantities of episodes
NOT_CHOSEN = ("autoreset_mode", "copy", "render_mode")  # options of environments that evaluation decides


class Interval(NamedTuple):
    """A value and its interval of 95 %; ``low`` and ``high`` are NaN where there is too little to tell."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        interval = f"[{self.low:.4g}, {self.high:.4g}]" if np.isfinite(self.low) else "(no interval)"
        return f"{self.value:.4g} {interval}"


@dataclass(frozen=True, eq=False, repr=False)
class LevelSetResult(ShownInNotebooks):
    """What a policy achieves on a level set.

    Attributes:
        episodes: all that were played, level by level in rounds.
        levels: how many there are.
        baselines: returns of random play, of an idle agent and of the planner on each level; None where no scores were
            asked for.
    """

    episodes: PlayedEpisodes
    levels: int
    baselines: Baselines | None = None

    def __repr__(self) -> str:
        shown = [counted(self.levels, "level"), counted(len(self.episodes), "episode"), f"return {self.mean()}"]
        shown += [f"success {self.mean('success').value:.3f}"]
        return f"<{', '.join(shown)}{'' if self.baselines is None else f', score {self.score():.3f}'}>"

    @property
    def trials(self) -> int:
        """How many episodes in a row were played on each level."""
        return int(self.episodes.trial.max()) + 1

    def of_levels(self, quantity: str, trial: int | None = None) -> np.ndarray:
        """The mean of one of :data:`segar.evaluation.QUANTITIES` on each level, float64 ``(levels,)``.

        Args:
            trial: the one that counts, from 0; all where it is None.

        Raises:
            SegarError: there is no such trial or quantity.
        """
        if trial is not None and not 0 <= trial < self.trials:
            raise SegarError(f"trial must lie in 0..{self.trials - 1}, as so many were played, not {trial!r}")
        counts = np.ones(len(self.episodes), np.bool_) if trial is None else self.episodes.trial == trial
        return self._of_episodes(quantity)[counts].astype(float).reshape(-1, self.levels).mean(axis=0)

    def mean(self, quantity: str = "return", trial: int | None = None) -> Interval:
        """The mean over levels, with Student's interval over levels; that of a share, ``success`` or ``death``, ends at 0 and
        1, and is Wilson's where all levels have one share. Of one level, or of levels that are all alike, there is none.
        Arguments as of :meth:`of_levels`."""
        return _interval([self.of_levels(quantity, trial)], quantity in SHARES)

    def adaptation_gain(self, quantity: str = "return") -> Interval:
        """What the policy gains from the first trial on a level to the last one; see :func:`adaptation_gain`.

        Raises:
            SegarError: each level was played once in a row.
        """
        return adaptation_gain(self.episodes.level, self.episodes.trial, self._of_episodes(quantity))

    def score(self) -> float:
        """The normalised score, a ratio of means over the levels: 0 where the mean return is that of the better of idle and
        random play on each level, 1 where it is the planner's.

        Raises:
            SegarError: no scores were asked for.
        """
        return float(self._known_baselines().normalised(self.mean().value))

    def regret(self) -> float:
        """What the mean return lacks of the planner's, in units of return.

        Raises:
            SegarError: no scores were asked for.
        """
        return float(self._known_baselines().regret(self.mean().value))

    def _of_episodes(self, quantity: str) -> np.ndarray:
        columns = self.episodes.columns()
        if quantity in OF_SETS:
            raise SegarError(
                f"'{quantity}' is a figure of a level set, not a mean of one per episode; call {quantity}(), as in"
                f" found.test.{quantity}()"
            )
        if quantity not in columns:
            raise SegarError(f"no quantity of episodes is called '{quantity}'.{did_you_mean(str(quantity), columns)}")
        return columns[quantity]

    def _known_baselines(self) -> Baselines:
        if self.baselines is None:
            raise SegarError(
                "there are no scores: call evaluate_policy(..., scores=True) or evaluate_on_suite(..., scores=True)"
            )
        return self.baselines


@dataclass(frozen=True, eq=False)
class Evaluation(ShownInNotebooks):
    """A policy on training levels and on test levels; ``print`` shows a table of it.

    Attributes:
        train, test: what it achieves there.
        w2: how far test levels are from training levels, by the mode of the distance; empty where none was asked for.
    """

    train: LevelSetResult
    test: LevelSetResult
    w2: Mapping[str, float] = field(default_factory=dict)

    def gap(self, quantity: str = "return") -> Interval:
        """The mean on test levels minus that on training levels, with Welch's interval over levels.

        The interval says what other levels of the same distributions might give, training levels included; the ``gap_se``
        of runs takes the training levels as they are. It says nothing of other seeds of training: for these, evaluate
        several trained policies. The interval of a share ends at -1 and 1; where the levels of a set are all alike, it is
        made of both sets' intervals as Newcombe's, and returns have none.
        """
        return _interval([self.test.of_levels(quantity), self.train.of_levels(quantity)], quantity in SHARES)

    def figures(self) -> dict[str, float]:
        """All figures as plain numbers by name, e.g. ``test/return``, ``test/return_low``, ``gap``, ``w2/exact``; the ends of
        intervals that do not exist are left out."""
        found: dict[str, float] = {}
        for name, result in (("train", self.train), ("test", self.test)):
            for quantity in QUANTITIES:
                found |= _ends(f"{name}/{quantity}", result.mean(quantity))
            found |= _of_trials(name, result)
            if result.baselines is not None:
                for player in ("random", "idle", "floor", "oracle"):
                    found[f"{name}/{player}"] = float(getattr(result.baselines, player).mean())
                found |= {f"{name}/score": result.score(), f"{name}/regret": result.regret()}
        found |= _ends("gap", self.gap()) | _ends("gap_ref", self.gap("return_ref"))
        return found | {f"w2/{mode}": value for mode, value in self.w2.items()}

    def __str__(self) -> str:
        rows = [["", "levels", "episodes", "return [95 %]", "success", "death", "length"]]
        scored = self.train.baselines is not None and self.test.baselines is not None
        rows[0] += ["score", "regret"] if scored else []
        for name, result in (("train", self.train), ("test", self.test)):
            shown = [f"{result.mean(key).value:.3f}" for key in ("success", "death")]
            row = [name, str(result.levels), str(len(result.episodes)), str(result.mean()), *shown]
            row += [f"{result.mean('length').value:.1f}"]
            rows.append(row + ([f"{result.score():.3f}", f"{result.regret():.4g}"] if scored else []))
        lines = [aligned(rows), f"gap (test - train)  {self.gap()}"]
        for name, result in (("train", self.train), ("test", self.test)) if self.train.trials > 1 else ():
            of_trials = [f"{result.mean('success', trial).value:.3f}" for trial in range(result.trials)]
            gain = f"adaptation gain of the return {result.adaptation_gain()}"
            lines.append(f"{name}: success in trials 0 to {result.trials - 1}  {' '.join(of_trials)}; {gain}")
        lines += [f"W2 ({mode})  {value:.4g}" for mode, value in self.w2.items()]
        return "\n".join(lines)


def evaluate_policy(
    policy: Policy,
    train: Levels,
    test: Levels,
    *,
    episodes: int = 1,
    seed: int = 0,
    scores: bool = False,
    distances: Sequence[Any] = (),
    **options: Any,
) -> Evaluation:
    """What a policy achieves on the levels that it was trained on and on others, and the gap with its interval.

    >>> train, test = (segar.family("empty-easy").sample(20, seed=0, split=s) for s in ("train", "test"))
    >>> found = segar.evaluate_policy(lambda seen: np.zeros((len(seen), 2), np.float32), train, test)
    >>> found.gap().low < found.gap().value < found.gap().high
    True

    Each level is played ``episodes`` times, up to 512 episodes side by side; with ``trials=k``, each time by k episodes in a
    row, and a policy that remembers can adapt to the level. The policy gets the observations of all
    environments of a batch in each step, also those whose episode is over; the actions of these have no effect.

    Args:
        policy: a function of observations that gives actions; see :class:`segar.envs.Policy`. Whether it samples
            its actions is its own affair.
        episodes: on each level.
        seed: of the environments, for tasks whose physics is random, and of the agents behind the scores.
        scores: also find what a random agent, an idle one and the planner achieve, about 0.1 s per level; see
            :class:`segar.evaluation.Baselines`.
        distances: modes of :func:`segar.metrics.w2` between the level sets to measure, e.g. ``("exact",)``.
        options: of :class:`segar.envs.VectorEnv`: ``observation``, ``task``, ``num_threads``, ``unit_actions``, ``world``
            and so on, as in training. An observation that is normalised has the units of ``train`` on both sets.

    Raises:
        SegarError: an argument is out of range, or the policy would observe arrays of different shapes in the two sets.
        ActionError: the policy gives actions of the wrong shape, or such as are not finite.
    """
    require_options("evaluate_policy", options, ("distances", *_OWN))
    _require_arguments(policy, episodes, scores)
    require_modes(distances)
    sets = {"train": train, "test": test}
    checks.require_levels("evaluate_policy", train, test)
    options["observation"] = trained_on(options.get("observation", "state"), train)  # a test has the units of training
    _require_one_space(sets, options)
    found = {name: _result(policy, levels, episodes, seed, scores, options) for name, levels in sets.items()}
    return Evaluation(**found, w2={mode: float(w2(train, test, mode=mode)) for mode in distances})


def evaluate_levels(
    policy: Policy, levels: Levels, *, episodes: int = 1, seed: int = 0, scores: bool = False, **options: Any
) -> LevelSetResult:
    """What a policy achieves on one level set; arguments as of :func:`evaluate_policy`."""
    require_options("evaluate_levels", options, _OWN)
    _require_arguments(policy, episodes, scores)
    return _result(policy, levels, episodes, seed, scores, options)


_OWN = ("episodes", "seed", "scores")  # arguments of evaluation that are no options of environments


def require_options(where: str, options: Iterable[str], own: Iterable[str], fixed: Iterable[str] = ()) -> None:
    """Raise :class:`SegarError` for an option that environments do not have, or that evaluation decides.

    Args:
        own: arguments of ``where`` itself, one of which may be meant. fixed: options that it decides, too.
    """
    known = (known_options(VectorEnv) | {*own}) - {*NOT_CHOSEN, *fixed, "num_envs"}
    for name in options:
        if name in (*NOT_CHOSEN, *fixed, "num_envs"):
            raise SegarError(f"{where}: '{name}' is not to be chosen here")
        if name not in known:
            longer = sorted(one for one in known if len(name) > 1 and one.startswith(name))
            raise SegarError(f"{where}: there is no option '{name}'.{did_you_mean((longer or [name])[0], known)}")


def require_modes(distances: Any) -> None:
    """Raise :class:`SegarError` unless these are several modes of :func:`segar.metrics.w2`."""
    if isinstance(distances, str):
        raise SegarError(f"distances must be a sequence of modes, such as ({distances!r},), not {distances!r}")


def mean_of_levels(values: np.ndarray, least: float = -np.inf, most: float = np.inf) -> Interval:
    """The mean of one number per level, with Student's interval over levels, which ends at ``least`` and ``most``; none of
    levels that are all alike."""
    if not len(values):
        return Interval(np.nan, np.nan, np.nan)
    return _within(_interval([values]), least, most)


def adaptation_gain(level: ArrayLike, trial: ArrayLike, values: ArrayLike) -> Interval:
    """The mean over levels of the last trial's value minus the first trial's, with Student's interval over levels.

    It is 0 on average for a policy that carries nothing from one trial of a level to the next. That of a share (bool values)
    ends at -1 and 1.

    Args:
        level, trial: int ``(n,)``, the level of each episode, and which episode in a row on it it was, from 0.
        values: ``(n,)``, such as returns or successes.

    Raises:
        SegarError: a level lacks its first or its last trial, there are no two trials, or the lengths differ.
    """
    level, trial, values = map(np.asarray, (level, trial, values))
    if not level.shape == trial.shape == values.shape or level.ndim != 1:
        shapes = ", ".join(str(one.shape) for one in (level, trial, values))
        raise SegarError(f"adaptation_gain: level, trial and values must be of one length, not of {shapes}")
    if not len(trial) or trial.max() < 1:
        raise SegarError("adaptation_gain: each level was played once in a row; play several trials on it, by trials=")
    names, place = np.unique(level, return_inverse=True)
    ends = []
    for which in (trial == trial.max(), trial == 0):
        counts = np.bincount(place[which], minlength=len(names))
        if not counts.all():
            raise SegarError(f"adaptation_gain: level {names[counts.argmin()]} lacks its first or its last trial")
        ends.append(np.bincount(place[which], values.astype(float)[which], len(names)) / counts)
    gains = ends[0] - ends[1]
    found = _interval([gains])
    return _within(found, -1.0, 1.0) if values.dtype == np.bool_ else found


def _of_trials(name: str, result: LevelSetResult) -> dict[str, float]:
    """Figures of a level set's trials; none where each level was played once in a row."""
    if result.trials == 1:
        return {}
    found = {}
    for quantity in TRIAL_QUANTITIES:
        for trial in range(result.trials):
            found |= _ends(f"{name}/{quantity}_trial_{trial}", result.mean(quantity, trial))
        found |= _ends(f"{name}/adaptation_gain_{quantity}", result.adaptation_gain(quantity))
    return found


def _require_arguments(policy: Any, episodes: Any, scores: Any) -> None:
    if not callable(policy):
        raise SegarError(f"evaluate_policy: policy must be a function of observations, not {policy!r}")
    if not is_whole(episodes) or episodes < 1:
        raise SegarError(f"evaluate_policy: episodes must be a whole number from 1 up, not {episodes!r}")
    if not isinstance(scores, bool):
        raise SegarError(f"evaluate_policy: scores must be True or False, not {scores!r}")


def _require_one_space(sets: Mapping[str, Levels], options: Mapping[str, Any]) -> None:
    spaces = [VectorEnv(levels, 1, seed=0, **options).single_observation_space for levels in sets.values()]
    if spaces[0] != spaces[1]:
        raise SegarError(
            f"evaluate_policy: the policy would observe {spaces[0]} in the training levels and {spaces[1]} in the test"
            " levels. A state vector depends on the entities that there can be; observe pixels, or let both sets be of one"
            " distribution"
        )


def _result(
    policy: Policy, levels: Levels, episodes: int, seed: int, scores: bool, options: Mapping[str, Any]
) -> LevelSetResult:
    """What the policy achieves on one level set."""
    indices = np.tile(np.arange(len(levels)), episodes)
    played = play_episodes(levels, indices, CheckedPolicy(policy), seed=seed, **options)
    if not scores:
        return LevelSetResult(played, len(levels))
    env = VectorEnv(levels, 1, seed=seed, **options)
    baselines = find_baselines(
        replace(levels, world=env.simulator.world),
        env.task,
        rng=np.random.default_rng(seed),
        seed=seed,
        num_threads=options.get("num_threads", 1),
    )
    return LevelSetResult(played, len(levels), baselines)


class CheckedPolicy:
    """A policy of somebody else's, whose actions are checked; the message says what it gave, and what was wanted."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy

    def begin(self, env: VectorEnv) -> None:
        self.env = env
        begin_policy(self.policy, env)

    def __call__(self, observations: Any) -> Any:
        return checked_actions(self.policy(observations), self.env)


def checked_actions(given: Any, env: VectorEnv) -> Any:
    """What a policy gave, as actions float32 ``(num_envs, action size)``; tensors on a GPU are left to the environments.

    Raises:
        ActionError: it is something else; the message says what, and what was wanted.
    """
    if env.runs_on_gpu:
        return given
    n, shape = env.num_envs, (env.num_envs, len(env.task.action_low))
    try:
        return actions_of(given, shape)
    except ActionError as error:
        if isinstance(given, tuple):
            parts = ", ".join(type(part).__name__ for part in given[:3])
            raise ActionError(
                f"the policy gave a tuple ({parts}{', ...' if len(given) > 3 else ''}) for {n} observations; give its actions"
                f" alone, {shape}, such as the first part of what predict of Stable-Baselines3 returns"
            ) from error
        raise ActionError(f"what the policy gave for {n} observations, {shape} expected: {error}") from error


def _interval(groups: Sequence[np.ndarray], is_share: bool = False) -> Interval:
    """The mean of a group, or what it is above that of a second one, with the interval of Student, or of Welch, over their
    entries. A group that does not vary says nothing of others: its share has Wilson's interval, and that of a difference is
    made of both groups' as Newcombe's (1998); of other numbers there is none."""
    from scipy.special import stdtrit

    means, counts = [float(group.mean()) for group in groups], [len(group) for group in groups]
    value, least = means[0] - sum(means[1:]), 1.0 - len(groups)
    vary = all(np.ptp(group) > ROUNDING * abs(group).max() for group in groups)
    if min(counts) < 2 or not (is_share or vary):
        return Interval(value, np.nan, np.nan)
    if not vary and len(groups) == 1:
        return Interval(value, *map(float, wilson_interval(value, counts[0])))
    if not vary:
        one, other = (_interval([group], is_share) for group in groups)
        below = np.hypot(one.value - one.low, other.high - other.value)
        above = np.hypot(one.high - one.value, other.value - other.low)
        return Interval(value, float(value - below), float(value + above))
    squares = [float(group.var(ddof=1)) / len(group) for group in groups]
    freedom = sum(squares) ** 2 / sum(s**2 / (n - 1) for s, n in zip(squares, counts, strict=True))
    margin = float(stdtrit(freedom, (1 + CONFIDENCE) / 2)) * sum(squares) ** 0.5
    found = Interval(value, value - margin, value + margin)
    return _within(found, least, 1.0) if is_share else found


def _within(found: Interval, least: float, most: float) -> Interval:
    """The interval, cut off where no value can lie; NaN stays NaN."""
    low, high = np.clip([found.low, found.high], least, most)
    return Interval(found.value, float(low), float(high))


def _ends(name: str, interval: Interval) -> dict[str, float]:
    """A value and its interval by name; without the interval where there is none."""
    ends = {f"{name}_low": interval.low, f"{name}_high": interval.high}
    return {name: interval.value} | {end: value for end, value in ends.items() if np.isfinite(value)}
