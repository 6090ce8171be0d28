"""The two sides of a suite, training and test: which levels, task and observation each of them has."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from segar.errors import SuiteError, must_be
from segar.observations import OBSERVATIONS, Observation, StateVector, TexturedPixels, make_observation, trained_on
from segar.suites.suite_file import SIDES, Suite, TrainingSide

TEXTURED = {"rgb": "textures", "rgb_stack2": "textures_stack2", "rgb_stack4": "textures_stack4"}
"""Observations of frames in solid colours, to the ones that show a suite's textures in their place."""
FIXED = ("task", "world", "max_steps", "sub_steps")
"""Options of environments that a suite decides."""


def side_options(
    suite: Suite | TrainingSide,
    side: str,
    seed: int = 1,
    *,
    training_levels: int | None = None,
    observation: Any = "state",
) -> dict[str, Any]:
    """Arguments of environments that play a side of a suite: ``levels``, ``task`` and ``observation``.

    >>> of = segar.suites.suite("look-far-v1")
    >>> options = segar.suites.side_options(of, "train", seed=1, observation="rgb")
    >>> segar.envs.VectorEnv(num_envs=8, seed=1, **options).single_observation_space.shape
    (64, 64, 3)

    Args:
        suite: a suite, or its training side, which a policy of the benchmark is given.
        side: ``"train"`` or ``"test"``.
        seed: draws the training levels. The test levels are frozen.
        training_levels: how many; as many as the suite says where it is None.
        observation: see :func:`observation_on`. A normalised one has the units of training on both sides.

    Raises:
        SuiteError: there is no such side, a training side is asked for the test, or the suite does not show this observation.
    """
    seen = observation_on(suite, side, observation)
    train = suite.sample(seed, training_levels)
    levels = suite.test_levels if side == "test" and isinstance(suite, Suite) else train
    return {"levels": levels, "task": suite.task, "observation": trained_on(seen, train)}


def observation_on(suite: Suite | TrainingSide, side: str, observation: Any = "state") -> Observation:
    """What is observed on a side of a suite.

    Args:
        side: ``"train"`` or ``"test"``.
        observation: a name, such as ``"state"`` or ``"rgb"``: states and patterns are without the factors that the suite
            hides, and frames have the textures of the side. Or an observation, unless the suite is about textures. Or, of
            these suites, a function that makes the observation from the name of a set of textures.

    Raises:
        SuiteError: the suite is about textures, and the observation shows none, or a set of its own; or it shows what the
            suite hides.
    """
    known = SIDES if isinstance(suite, Suite) else SIDES[:1]
    if side not in known:
        raise SuiteError(f"side {must_be(side, known)}")
    if isinstance(observation, str) and (observation in OBSERVATIONS or suite.textures):
        name, options = named_observation(suite, side, observation)
        return OBSERVATIONS[name](**options)
    if suite.textures:
        if not callable(observation):
            raise _no_textures(suite, repr(observation))
        made: Any = observation(suite.textures[SIDES.index(side)])
        return make_observation(made)
    given = make_observation(observation)
    for factor in suite.hidden:
        if any(one.shows(factor) for one in _parts_in(given)):
            raise SuiteError(
                f"observation: this {type(given).__name__} shows {factor.__name__}, which the suite {suite.name} hides; give"
                " StateVector(hidden=suite.hidden), or TexturedPixels likewise, or a name such as 'state'"
            )
    if _is_about_the_unseen(suite) and any(getattr(one, "sees_invisible", False) for one in _parts_in(given)):
        raise SuiteError(
            f"observation: this {type(given).__name__} shows what is invisible, which the suite {suite.name} is about; give"
            " StateVector(sees_invisible=False), or a name such as 'state'"
        )
    return given


def named_observation(
    suite: Suite | TrainingSide, side: str, name: str, options: Mapping[str, Any] | None = None
) -> tuple[str, dict[str, Any]]:
    """The name and options of an observation with what the suite says of it: factors that it hides, and the textures that
    frames show; raises as :func:`observation_on`."""
    options = dict(options or {})
    if suite.textures:
        shown = TEXTURED.get(name, name)
        if shown not in TEXTURED.values() or "textures" in options:
            raise _no_textures(suite, repr(name))
        return shown, {**options, "textures": suite.textures[SIDES.index(side)]}
    if suite.hidden and name.startswith(("state", "textures")):
        hidden = (*options.get("hidden", ()), *(factor.__name__ for factor in suite.hidden))
        options["hidden"] = list(dict.fromkeys(hidden))
    if name.startswith("state") and _is_about_the_unseen(suite):
        options["sees_invisible"] = False
    return name, options


def _is_about_the_unseen(suite: Suite | TrainingSide) -> bool:
    """Whether the task makes things invisible, which states show unless they are told not to: they have no factor to hide."""
    return suite.task.name.startswith("invisiball")


def require_free(suite: Suite, options: Iterable[str]) -> None:
    """Raise :class:`SuiteError` for an option of environments that the suite decides."""
    for name in options:
        if name in FIXED:
            raise SuiteError(
                f"the suite {suite.name} says what is played, so that results compare; leave {name} out, or play its levels"
                " without it: segar.envs.VectorEnv(suite.test_levels, ...)"
            )


def _no_textures(suite: Suite | TrainingSide, given: str) -> SuiteError:
    shown = zip(suite.textures, ("training", "the test"), strict=False)
    sets = " and ".join(f"the set of textures {name} in {where}" for name, where in shown)
    return SuiteError(
        f"observation: the suite {suite.name} shows {sets}, which {given} does not; choose {', '.join(TEXTURED)} or"
        f" {', '.join(TEXTURED.values())}, without the option textures, or a function that makes one from the name of a set,"
        " such as lambda name: TexturedPixels(name)"
    )


def _parts_in(observation: Any) -> Iterator[StateVector | TexturedPixels]:
    """The states and the textured frames that an observation consists of: what can show factors that a suite hides."""
    if isinstance(observation, StateVector | TexturedPixels):
        yield observation
    for member in getattr(observation, "members", ()):
        yield from _parts_in(member)
