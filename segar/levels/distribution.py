"""Level distributions: how many entities of which types, and priors over their factors. Data, from which levels are
sampled and distributions are read."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import LevelError, PriorError, did_you_mean
from segar.language import LARGEST, Entity, Factor, GlobalFriction, Layout, Parameter, Slot, ThingFactory, name_slots
from segar.levels.apart import check_within, near_levels
from segar.levels.explanation import Explanation, explain
from segar.levels.hashing import content_hash
from segar.levels.level_data import SPLIT, LevelData, Provenance, layout_on_floor
from segar.levels.level_set import Levels
from segar.levels.priors import Prior, check_priors
from segar.levels.probability.entropy import acceptance, entropy, log_acceptance
from segar.levels.probability.log_prob import log_probability
from segar.levels.probability.marginals import marginals
from segar.levels.probability.shared import shared_probability
from segar.levels.sampling.draws import Streams, draw_levels
from segar.levels.sampling.placement import MIN_DISTANCE
from segar.levels.sampling.plan import SamplingPlan, SlotGroup, make_sampling_plan
from segar.noise import Noise
from segar.rules import RuleSpace, World
from segar.support import Estimate, ShownInNotebooks, __version__, is_whole

MOST_OF_A_KIND = 1000  # entities of an entry of ``numbers``: more are a slip, which would take memory and time
MOST_LEVELS = 2**62  # indices of a split end before it
MOST_TRIES, FEWEST_TRIES = 10, 1000  # levels per level that is asked for, and in all, before sampling apart gives up


@dataclass(frozen=True, init=False, eq=False, repr=False)
class LevelDistribution(ShownInNotebooks):
    """A distribution of levels, as data: how many entities of which types, and priors over their factors.

    Args:
        numbers: pairs (entity type or ``ThingFactory``, how many), at least one; how many is a whole number or a
            distribution of such.
        priors: :class:`segar.Prior` objects; the most specific one counts. Priors for entity types that ``numbers``
            does not name are left aside, so that distributions can share a list of priors.
        parameters: world parameter class to value or distribution; the same as ``Prior(Gravity, ...)`` in ``priors``.
        positions: pairs (entity type, places ``(k, 2)`` [m]): the first k entities of the type always start there.
        name: for people and provenance.
        world: the rules, a :class:`segar.World`; None for the default ones.
        min_distance: centres of any two things start farther apart than this [m].
        task: name of the task that the levels are for: 'puttputt', 'billiards', 'invisiball', or ``module:attribute``
            of a :class:`segar.Task` or of a function that makes one; None for PuttPutt. Environments have it unless
            they are given another.

    Positions are drawn anew, at most 100 times per level, until all centres are farther apart than ``min_distance``;
    all else keeps exactly the distribution that the priors state.

    Raises:
        LevelError: the configuration has an unknown key, or numbers or positions make no sense.
        PriorError: priors contradict each other, or name a factor that no entity has.
        PlacementError: things always start too close to each other.
    """

    numbers: tuple[tuple[type[Entity] | ThingFactory, int | Noise], ...]
    priors: tuple[Prior, ...]
    parameters: tuple[tuple[type[Parameter], Any], ...]
    positions: tuple[tuple[type[Entity], tuple[tuple[float, float], ...]], ...]
    name: str | None
    world: World | None
    min_distance: float
    task: str | None

    def __init__(
        self,
        numbers: Sequence[tuple[Any, Any]] = (),
        priors: Sequence[Prior] = (),
        parameters: Any = None,
        positions: Any = None,
        name: str | None = None,
        world: World | None = None,
        min_distance: float = MIN_DISTANCE,
        task: str | None = None,
        **unknown: Any,
    ) -> None:
        for key in unknown:
            known = [field.name for field in dataclasses.fields(self)]
            raise LevelError(f"a level distribution has no '{key}'.{did_you_mean(key, known)}")
        if world is not None and not isinstance(world, World):
            raise LevelError(f"world must be a segar.World or None, not {world!r}; with_rules takes a list of rules")
        if not (isinstance(min_distance, (int, float)) and 0 <= min_distance <= LARGEST):
            raise LevelError(f"min_distance must be a number of metres, 0 to {LARGEST:g}, not {min_distance!r}")
        if not isinstance(task, str | None):
            raise LevelError(f"task must be a name such as 'billiards' or 'module:attribute', not {task!r}")
        set_ = object.__setattr__
        set_(self, "name", name)
        set_(self, "task", task)
        set_(self, "world", world)
        set_(self, "min_distance", float(min_distance))
        set_(self, "numbers", tuple(map(_check_number, _sequence("numbers", numbers))))
        set_(self, "priors", tuple(map(_check_prior, _sequence("priors", priors))))
        set_(self, "parameters", _check_parameters(parameters))
        set_(self, "positions", tuple(map(_check_places, _sequence("positions", positions or ()))))
        if not len(self.layout.slots) > 1:
            raise LevelError("numbers must name at least one entity, as in numbers=[(GolfBall, 1), (GoalTile, 1)]")
        if self.rule_space is not None:
            self.rule_space.require_suits(self.layout.types)
        check_priors(self.priors, self.layout.types[:-1])
        _ = self.plan  # contradictions show here, not at the first sample

    def sample(
        self,
        n: int,
        seed: int = 0,
        split: str = "train",
        start: int = 0,
        apart_from: LevelData | None = None,
        within: float = 0.0,
    ) -> Levels:
        """``n`` levels of a split, from index ``start`` on. Level i depends on (distribution, seed, split, i) alone.

        Args:
            apart_from: levels that are left out, such as those of a test: a level is passed over where one of these has the
                same entities and shapes, and all numbers that count differ by at most ``within``. The order of drawing and
                quantities that follow from others do not count. ``provenance.indices`` says which levels were taken.
            within: in standard deviations of this distribution; in their own unit for numbers without spread.

        Raises:
            LevelError: an argument is of the wrong kind, the levels do not fit into memory, or too few lie apart from
                ``apart_from``.
            PlacementError: the things of a level find no place; the message names level and things.
            PriorError: a distribution gave a value that its factor cannot take.
        """
        if not is_whole(n) or n < 1:
            raise LevelError(f"{self}: the number of levels must be a whole number above 0, not {n!r}")
        if not is_whole(seed):
            raise LevelError(f"{self}: the seed must be a whole number, not {seed!r}")
        if not isinstance(split, str) or not SPLIT.fullmatch(split):
            raise LevelError(
                f"{self}: the split must be a word such as 'train' or 'test' (letters, digits, spaces, _ . -), not {split!r}"
            )
        self._check_room(int(n))
        if not is_whole(start) or not 0 <= start <= MOST_LEVELS - n:
            raise LevelError(f"{self}: the start must be the index of a level, a whole number from 0 up, not {start!r}")
        if apart_from is None:
            return self._drawn(np.arange(start, start + n, dtype=np.int64), seed, split)
        if not isinstance(apart_from, LevelData):
            raise LevelError(f"{self}: apart_from takes levels (segar.Levels), not a {type(apart_from).__name__}")
        check_within(within)
        kept, tried = np.empty(0, np.int64), 0
        while len(kept) < n:
            block = self._drawn(np.arange(start + tried, start + tried + n, dtype=np.int64), seed, split)
            tried += n
            is_near = near_levels(block, apart_from, within, self)
            if tried == n and not is_near.any():  # which is usual, and spares a second draw
                return block
            kept = np.append(kept, block.provenance.indices[~is_near])
            if len(kept) < n and tried >= MOST_TRIES * n + FEWEST_TRIES:
                raise LevelError(
                    f"{self}: of {tried} levels only {len(kept)} lie apart from the {len(apart_from)} levels of apart_from, and"
                    f" {n} are asked for; ask for fewer, or for a smaller distance within which two count as the same"
                )
        return self._drawn(kept[:n], seed, split)

    def _drawn(self, indices: np.ndarray, seed: int, split: str) -> Levels:
        """The levels of a split with these indices, int64 ``(n,)``."""
        origin = Provenance(self.name, self.hash, __version__, int(seed), split, indices)
        fields = {"distribution": self, "world": self.world, "task": self.task}
        drawn = LevelData.empty(self.plan.vertices, self.layout, origin, **fields)
        draw_levels(self.plan, Streams(str(self), self._stream, int(seed), split), drawn)
        return Levels(**vars(drawn.closed()))

    def _check_room(self, n: int) -> None:
        """Raise :class:`LevelError` where the states of ``n`` levels would not fit into the memory of this machine."""
        needed = n * len(self.layout.slots) * self.layout.width * 2 * np.float64().itemsize  # as drawn, and as placed
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        if needed > memory:
            raise LevelError(
                f"{self}: {n} levels take more than {needed / 2**30:.4g} GiB, and this machine has {memory / 2**30:.4g};"
                " sample fewer"
            )

    @cached_property
    def layout(self) -> Layout:
        """The slots: those of ``numbers`` in order, then the arena's floor; counts that vary make optional slots."""
        groups = [(types_of(who), counts(many)[1]) for who, many in self.numbers]
        names = iter(name_slots(groups))
        slots = []
        for (types, most), (_, many) in zip(groups, self.numbers, strict=True):
            slots += [Slot(next(names), types, optional=k >= counts(many)[0]) for k in range(most)]
        drawn = () if self.rule_space is None else self.rule_space.parameters
        layout = layout_on_floor(slots, (*self._parameter_priors, *drawn))
        _check_names(layout.slots)
        return layout

    @cached_property
    def hash(self) -> str:
        """Sixteen hexadecimal digits of all that decides which levels are drawn and what their entities hold; name,
        rules and task take no part, but what a rule space draws does. The same on every machine."""
        return content_hash(self._content + ([] if self.rule_space is None else [self.rule_space.content]))

    @property
    def rule_space(self) -> RuleSpace | None:
        """The rule space that each level draws its rules from; None where all have the same."""
        return None if self.world is None else self.world.space

    def with_rules(self, rules: Sequence[Any] | RuleSpace) -> LevelDistribution:
        """The same distribution, with the same levels, in a world with other ``rules``. From a
        :class:`segar.rules.RuleSpace` each level draws rules of its own; all else of it stays as it is.

        Raises:
            RuleError: a rule cannot be traced, or an option of the space needs what no entity has.
        """
        world = self.world if self.world is not None else World()
        return dataclasses.replace(self, world=dataclasses.replace(world, rules=rules))

    def marginals(self) -> dict[str, dict[type[Factor], Noise]]:
        """The distribution of every numeric factor of every slot, given that the slot is filled by an entity that holds it; and
        under ``"parameters"`` that of every world parameter.

        Positions are as their priors say, before placement draws again or moves. Factors with conditional priors have
        no distribution of their own and are left out.
        """
        return marginals(self.plan)

    def log_prob(self, levels: Levels, normalised: bool = True) -> np.ndarray:
        """Log probability of each level, float64 ``(n,)``; -inf where the level cannot be drawn.

        A sum of log masses (how many entities, their types, choices of shapes, ranks in the pile, atoms) and log
        densities (with respect to length, and to area for positions and for each vertex of a random hull), of what was
        drawn: ``levels.sampled_values``, before overlaps are fixed. Positions have the density of their priors given
        that no two things are too close: unless ``normalised`` is False, the log of that event's probability,
        estimated from 200,000 draws with the standard error ``log_acceptance(levels)[1]``, is taken off.

        Raises:
            LevelError: the levels have other entities, factors or parameters.
            PriorError: a prior draws an Order that may be 0, so that a level does not show how it came about.
            PlacementError: placement accepts too rarely for an estimate.
        """
        found = log_probability(self.plan, self._own(levels))
        total = found.simple + found.other
        return total - log_acceptance(self.plan, found)[0] if normalised else total

    def log_acceptance(self, levels: Levels) -> tuple[np.ndarray, np.ndarray]:
        """Log probability that positions drawn for the things of each level are far enough apart, and its standard
        error, float64 ``(n,)`` each; raises as ``log_prob`` does."""
        return log_acceptance(self.plan, log_probability(self.plan, self._own(levels)))

    def acceptance(self, draws: int = 100_000, seed: int = 0) -> Estimate:
        """The share of levels whose things are far enough apart at the first try, with its standard error.

        Placement tries 100 times per level: with a share p, it fails for a level with probability ``(1 - p)^100``.
        """
        return acceptance(self.plan, Streams(str(self), self._stream, int(seed), "acceptance"), draws)

    def shared_probability(self, n: int = 1, other: LevelDistribution | None = None) -> Estimate:
        """The probability that a level of ``other`` (None: of this distribution) is one of ``n`` levels of this one.

        With ``n=1``, that two draws are the same level, as ``sample(apart_from=...)`` understands it. It is 0 for
        distributions in which something always has a density, and exact, with an error of 0, where no two things can be drawn
        too close to each other; else the error bounds what the minimal distance takes off.

        >>> segar.family("empty-hard").shared_probability().value < 1e-6
        True

        Args:
            n: how many independent levels, such as those of training.
            other: whose levels are asked for, such as the distribution of a test.

        Raises:
            LevelError: ``n`` is no whole number above 0.
            PriorError: a factor with atoms depends on other factors, or there are too many kinds of levels to go through.
        """
        if not is_whole(n) or n < 1:
            raise LevelError(f"{self}: the number of levels must be a whole number above 0, not {n!r}")
        return shared_probability(self.plan, (self if other is None else other).plan, int(n))

    def entropy(self, draws: int = 20_000, seed: int = 0) -> Estimate:
        """Entropy [nats] with respect to the measure of ``log_prob``, with its standard error.

        What is independent of all else counts in closed form. Conditional factors, ranks, random hulls and positions
        (given that no two things are too close) count by the mean over ``draws`` levels of a split of their own.
        Raises as ``sample`` and ``log_prob`` do.
        """
        return entropy(self.plan, self.sample(draws, seed, split="entropy"))

    def explain(self, entity: type[Entity] | str | None, factor: type[Factor]) -> Explanation:
        """Which prior sets a factor, and why: an :class:`Explanation`, to be printed.

        Args:
            entity: an entity type, the name of an entity such as ``"golfball"``, or None for a world parameter.

        Raises:
            PriorError: there is no such entity, it may be of several types, or it lacks the factor.
        """
        return explain(self.plan, self.priors, entity, factor)

    def _own(self, levels: Levels) -> Levels:
        if levels.layout != self.layout:
            raise LevelError(
                f"{levels!r} have entities {', '.join(levels.layout.names)}, which are not those of {self},"
                f" {', '.join(self.layout.names)}, or hold other factors or parameters"
            )
        return levels

    def __repr__(self) -> str:
        if self.name:
            return f"level distribution '{self.name}'"
        entities = ", ".join(f"{getattr(who, '__name__', who)}: {many!r}" for who, many in self.numbers)
        return f"level distribution ({entities})"

    @cached_property
    def _parameter_priors(self) -> dict[type[Parameter], Prior]:
        made = {p.factor: p for p in self.priors if issubclass(p.factor, Parameter)}
        for parameter, value in self.parameters:
            prior = Prior(parameter, value)
            if parameter in made:
                raise PriorError(f"{parameter.__name__} is given twice: {made[parameter]} and {prior} in parameters")
            made[parameter] = prior
        drawn = () if self.rule_space is None else self.rule_space.parameters
        for parameter in made:
            if parameter in drawn:
                raise PriorError(
                    f"{made[parameter]}: {parameter.__name__} is drawn by the rule space; remove the prior"
                )
        return made

    @cached_property
    def _content(self) -> list[Any]:
        priors = [p for p in self.priors if not issubclass(p.factor, Parameter)]
        return [self.numbers, priors, list(self._parameter_priors.values()), self.positions, self.min_distance]

    @cached_property
    def _stream(self) -> str:
        """Names the random streams: by class names only, so that a new default of some factor moves nothing else."""
        return content_hash(self._content, with_classes=False)

    @cached_property
    def plan(self) -> SamplingPlan:
        """All that sampling needs, read off numbers, priors, parameters and positions once."""
        groups, slot = [], 0
        for who, many in ((who, many) for who, many in self.numbers if counts(many)[1]):
            probabilities = who.probabilities if isinstance(who, ThingFactory) else (1.0,)
            places = tuple(map(self.layout.types.index, types_of(who)))
            slots = tuple(range(slot, slot + counts(many)[1]))
            groups.append(SlotGroup(slots, many, places, probabilities))
            slot += len(slots)
        priors = [p for p in self.priors if not issubclass(p.factor, Parameter)]
        fixed = _fixed_positions(self.layout, self.positions)
        return make_sampling_plan(
            self.layout, groups, priors, self._parameter_priors, fixed, self.min_distance, self.rule_space
        )


def types_of(who: type[Entity] | ThingFactory) -> tuple[type[Entity], ...]:
    """The entity types that an entry of ``numbers`` can produce."""
    return who.types if isinstance(who, ThingFactory) else (who,)


def counts(many: int | Noise) -> tuple[int, int]:
    """The smallest and the largest number of entities that an entry of ``numbers`` can produce."""
    if not isinstance(many, Noise):
        return many, many
    values = many.atoms[0]
    return int(values.min()), int(values.max())


def _sequence(name: str, entries: Any) -> Sequence[Any]:
    if isinstance(entries, (str, Mapping)) or not isinstance(entries, Sequence):
        raise LevelError(f"{name} must be a list, not {type(entries).__name__}")
    return entries


def _pair(name: str, form: str, entry: Any) -> tuple[Any, Any]:
    if not isinstance(entry, (tuple, list)) or len(entry) != 2:
        raise LevelError(f"{name}: each entry is a pair {form}, not {entry!r}")
    return entry[0], entry[1]


def _check_number(entry: Any) -> tuple[Any, Any]:
    who, many = _pair("numbers", "(entity type or ThingFactory, how many)", entry)
    if not isinstance(who, ThingFactory) and not (
        isinstance(who, type) and issubclass(who, Entity) and who is not Entity
    ):
        raise LevelError(f"numbers: {who!r} is not an entity type or a ThingFactory")
    if isinstance(who, type) and issubclass(who, GlobalFriction):
        raise LevelError("numbers: every level has GlobalFriction already; set parameters={FloorFriction: ...}")
    name = getattr(who, "__name__", repr(who))
    if isinstance(many, Noise):
        values, masses = many.atoms if many.width == 1 else (np.zeros(0), np.zeros(0))
        whole = (values == np.rint(values)) & (values >= 0) & (values <= MOST_OF_A_KIND)
        is_right = abs(masses.sum() - 1) <= 1e-9 and whole.all()
    else:
        is_right = is_whole(many) and 0 <= many <= MOST_OF_A_KIND
    if not is_right:
        raise LevelError(
            f"numbers: how many {name} must be a whole number from 0 to {MOST_OF_A_KIND:,}, or a distribution of whole numbers"
            f" in this range, not {many!r}"
        )
    return who, many if isinstance(many, Noise) else int(many)


def _check_prior(prior: Any) -> Prior:
    if not isinstance(prior, Prior):
        raise LevelError(f"priors: {prior!r} is not a Prior")
    return prior


def _check_parameters(given: Any) -> tuple[tuple[type[Parameter], Any], ...]:
    entries = given.items() if isinstance(given, Mapping) else given or ()
    pairs = [_pair("parameters", "(parameter class, value)", entry) for entry in entries]
    for parameter, _ in pairs:
        if not (isinstance(parameter, type) and issubclass(parameter, Parameter)):
            raise LevelError(f"parameters: {parameter!r} is not a world parameter class such as Gravity")
    return tuple(sorted(pairs, key=lambda pair: pair[0].__name__))


def _check_places(entry: Any) -> tuple[type[Entity], tuple[tuple[float, float], ...]]:
    entity, places = _pair("positions", "(entity type, places)", entry)
    if not (isinstance(entity, type) and issubclass(entity, Entity)):
        raise LevelError(f"positions: {entity!r} is not an entity type")
    array = np.asarray(places, dtype=float)
    if array.ndim != 2 or array.shape[1] != 2 or not np.isfinite(array).all():
        raise LevelError(f"positions: places of {entity.__name__} must be finite numbers of shape (k, 2)")
    return entity, tuple((x, y) for x, y in array.tolist())


def _fixed_positions(layout: Layout, positions: Any) -> dict[int, tuple[float, float]]:
    fixed: dict[int, tuple[float, float]] = {}
    for entity, places in positions:
        slots = [k for k, slot in enumerate(layout.slots) if all(issubclass(t, entity) for t in slot.types)]
        slots = [k for k in slots if k not in fixed]
        if len(slots) < len(places):
            raise LevelError(
                f"positions: {len(places)} places for {entity.__name__}, but numbers has {len(slots)} of them"
            )
        fixed.update(zip(slots, places, strict=False))
    return fixed


def _check_names(slots: Sequence[Slot]) -> None:
    owners: dict[str, Slot] = {}
    for slot in slots:
        if slot.name in owners:
            types = sorted({t.__name__ for s in (slot, owners[slot.name]) for t in s.types})
            raise LevelError(f"two entities are called '{slot.name}' ({', '.join(types)}); give one of them its own id")
        owners[slot.name] = slot
