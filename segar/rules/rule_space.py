"""Rule spaces: a distribution over sets of rules and over their constants, all compiled once into one kernel.

Which options are active and their constants are world parameters of a level, so a batch of environments can hold as many rule
sets as it has environments.
"""

import copy
from collections.abc import Collection, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from segar.errors import RuleError, did_you_mean
from segar.language import Entity, Parameter, as_rule, matches
from segar.noise import (
    Bernoulli,
    Choice,
    Deterministic,
    DiscreteRangeNoise,
    LogUniform,
    Mixture,
    Noise,
    UniformNoise,
    as_noise,
)
from segar.rules.combinations import Combinations, make_combinations
from segar.rules.default_rules import DEFAULT_RULES
from segar.rules.rule_option import RuleOption, same_options
from segar.support import counted, is_whole

TWO_TO_FOUR = DiscreteRangeNoise(2, 4)
SPLITS = ("combinations", "rules", "constants")


class RuleSpace:
    """A distribution over sets of rules and over their constants.

    A level draws how many options are active, then which ones: among all combinations of that size, each with a probability
    that is proportional to the product of its options' weights. Then each constant of an active option is drawn from its
    distribution, and constants of others have their defaults.

    ``distribution.with_rules(space)`` and ``World(space)`` have the rules of the space: environments, kernels, the interpreter
    and all measures take such worlds as any other.

    Args:
        options: :class:`RuleOption` objects, rules or typed functions.
        active: how many of them are active in a level: a number or a distribution of whole numbers.
        always: rules that hold in every level.
        exclusive: groups of names of options, of which at most one is active.

    Attributes:
        rules: those that always hold, then those of the options, which hold only where their option is active.
        on_contact: the rules of the options that note a contact.
        combinations: which options can be active together, and how likely that is.
        laws: distribution of each constant in levels in which its option is active.

    Raises:
        RuleError: there are no options, two have one name, a constant belongs to two options, a rule could hold twice in one
            level, ``exclusive`` lists no groups of known names, or no combination is left.
    """

    def __init__(
        self,
        options: Sequence[Any],
        active: int | Noise = TWO_TO_FOUR,
        always: Sequence[Any] = DEFAULT_RULES,
        exclusive: Sequence[Sequence[str]] = (),
    ) -> None:
        self.options = tuple(one if isinstance(one, RuleOption) else RuleOption(rules=one) for one in _listed(options))
        if not self.options:
            raise RuleError("a rule space needs options: rules that hold in some levels")
        self.names = tuple(option.name for option in self.options)
        for name in self.names:
            if self.names.count(name) > 1:
                raise RuleError(f"two options of the rule space are called '{name}'; give one another name=")
        self.always = tuple(map(as_rule, _listed(always)))
        self.exclusive = tuple(tuple(map(self.index, _group(group))) for group in _listed(exclusive))
        self.count, self.splits = _count(active, len(self.options)), ()
        self.combinations = make_combinations(self.names, [o.weight for o in self.options], self.count, self.excludes)
        self.laws: dict[type[Parameter], Noise] = {}
        for option in self.options:
            for parameter, law in option.constants.items():
                if parameter in self.laws:
                    owner = next(o.name for o in self.options if parameter in o.constants)
                    raise RuleError(
                        f"{parameter.__name__} is a constant of the options '{owner}' and '{option.name}'; give each its own"
                    )
                self.laws[parameter] = law
        self._require_once()
        self.rules = (*self.always, *(r.where_active(o.active) for o in self.options for r in o.rules))
        self.on_contact = tuple(r.where_active(o.active) for o in self.options for r in o.on_contact)

    @cached_property
    def parameters(self) -> tuple[type[Parameter], ...]:
        """The world parameters that the space draws: whether each option is active, then the constants."""
        return (*(option.active for option in self.options), *self.laws)

    def index(self, name: str) -> int:
        """The place of the option of that name; raises :class:`RuleError`."""
        if name not in self.names:
            raise RuleError(f"the rule space has no option '{name}'.{did_you_mean(str(name), self.names)}")
        return self.names.index(name)

    def may_meet(self, one: type[Parameter] | None, other: type[Parameter] | None) -> bool:
        """Whether two options, by their activities, are active in one level; None: what always holds."""
        places = {option.active: k for k, option in enumerate(self.options)}
        if one not in places or other not in places:
            return True
        return bool(self.combinations.together[places[one], places[other]])  # type: ignore[index]

    # -- the distribution ----------------------------------------------------------------------------------------

    def sample(self, generator: Any, n: int) -> np.ndarray:
        """The parameters of ``n`` levels, float64 ``(n, parameters)`` in the order of :attr:`parameters`.

        Args:
            generator: from texts that name what is drawn to a generator of random numbers for it.
        """
        active = self.combinations.sample(np.asarray(generator("combination").random(n)))
        found = np.empty((n, len(self.parameters)))
        found[:, : len(self.options)] = active
        for column, (parameter, law, k) in enumerate(self._constants, len(self.options)):
            drawn = np.asarray(law.sample(generator("constant", parameter.__name__), n), dtype=float)
            found[:, column] = np.where(active[:, k], drawn, parameter.default)
        return found

    def log_prob(self, values: np.ndarray) -> np.ndarray:
        """Log mass and density of each row of parameters, float64 ``(n,)``; -inf where the space cannot draw it."""
        switches = values[:, : len(self.options)]
        active = switches != 0
        total = np.where(((switches == 0) | (switches == 1)).all(axis=1), self.combinations.log_prob(active), -np.inf)
        for column, (parameter, law, k) in enumerate(self._constants, len(self.options)):
            value = values[:, column]
            idle = np.where(value == parameter.default, 0.0, -np.inf)
            total = total + np.where(active[:, k], law.log_prob(value), idle)
        return total

    def entropy(self) -> float:
        """Entropy [nats] with respect to the measure of :meth:`log_prob`, in closed form."""
        activity = self.combinations.activity
        return self.combinations.entropy() + sum(float(activity[k] * law.entropy()) for _, law, k in self._constants)

    def marginals(self) -> dict[type[Parameter], Noise]:
        """The distribution of each parameter over all levels."""
        share = self.combinations.activity.tolist()
        found: dict[type[Parameter], Noise] = {}
        for option, p in zip(self.options, share, strict=True):
            found[option.active] = Deterministic(round(p)) if p in (0.0, 1.0) else Bernoulli(p)
        for parameter, law, k in self._constants:
            idle, p = Deterministic(parameter.default), min(share[k], 1.0)
            found[parameter] = law if p == 1 or law == idle else idle if p == 0 else Mixture((idle, law), (1 - p, p))
        return found

    @property
    def content(self) -> list[Any]:
        """What decides which parameters are drawn, as plain data and distributions."""
        laws = [[p.__name__, p.default, law] for p, law in self.laws.items()]
        weights = [option.weight for option in self.options]
        return ["RuleSpace", self.names, weights, self.count, self.exclusive, laws, *self.splits]

    # -- splits --------------------------------------------------------------------------------------------------

    def split(
        self, part: str, by: str = "combinations", share: float = 0.2, seed: int = 0, rules: Sequence[str] = ()
    ) -> "RuleSpace":
        """One part of the space; no rule set of one part is in the other. Both have the same rules, so they share a kernel.

        Args:
            part: ``"train"`` or ``"test"``.
            by: ``"combinations"``: each combination of options is in one part. ``"rules"``: some options are active in test
                alone, and there at least one of them is. ``"constants"``: constants of active options are drawn from the
                lower end of their distributions for training and from the upper end for the test, where at least one
                option with constants is active.
            share: the part of the combinations, of the options, or of the mass of each constant that is for the test.
            seed: decides which combinations and options are for the test.
            rules: names of the options for the test, with ``by="rules"``, instead of ``share`` of them.

        Raises:
            RuleError: an argument is not known, nothing is left of a part, an option is not trained, or two options that do
                the same would be parted.
        """
        if part not in ("train", "test"):
            raise RuleError(f"split: the part must be 'train' or 'test', not {part!r}")
        if by not in SPLITS:
            raise RuleError(f"split: there is no by={by!r}.{did_you_mean(str(by), SPLITS)}")
        if isinstance(share, bool) or not isinstance(share, (int, float)) or not 0 < share < 1:
            raise RuleError(f"split: the share of the test must be a number between 0 and 1, not {share!r}")
        if not is_whole(seed):
            raise RuleError(f"split: the seed must be a whole number, not {seed!r}")
        if rules and by != "rules":
            raise RuleError(f"split: rules= names the options of a split by='rules', and this one is by={by!r}")
        if by == "constants":
            return self._by_constants(part, share)
        for a, b in same_options(self.options):
            if not rules or (a in _listed(rules)) != (b in _listed(rules)):
                raise RuleError(
                    f"split by={by!r}: the options {a} and {b} do the same under two names, so that rule sets of the test could"
                    " be those of training; give their constants different distributions"
                )
        is_test = self._test_combinations(by, share, seed, rules)
        if not is_test.any() or is_test.all():
            nothing = "training" if is_test.all() else "the test"
            mend = "name fewer rules" if rules else "choose another share or seed"
            raise RuleError(f"split by={by!r} leaves nothing for {nothing} of {len(is_test)} combinations; {mend}")
        train = self.combinations.where(~is_test)
        if by == "combinations":
            missing = [n for n, p in zip(self.names, train.activity, strict=True) if not p]
            if missing:
                raise RuleError(
                    f"split by='combinations': no training combination has {', '.join(missing)}; choose a smaller share or"
                    " another seed, or split by='rules'"
                )
        name = [part, by, share, seed, list(rules)]
        return self._restricted(train if part == "train" else self.combinations.where(is_test), self.laws, name)

    def unlike(self, other: "RuleSpace") -> "RuleSpace":
        """The part of the space whose combinations of options another space cannot draw; options are told by their names.

        Raises:
            RuleError: the other space has options that this one lacks, or nothing is left.
        """
        active, shared = self.combinations.active, list(map(self.index, other.names))
        is_known = np.isfinite(other.combinations.log_prob(active[:, shared]))
        is_known &= ~np.delete(active, shared, axis=1).any(axis=1)
        if is_known.all():
            raise RuleError(f"unlike: {other!r} can draw all combinations of {self!r}, so nothing is left")
        return self._restricted(self.combinations.where(~is_known), self.laws, ["unlike", other.content])

    def _test_combinations(self, by: str, share: float, seed: int, rules: Sequence[str]) -> np.ndarray:
        """Which combinations are for the test, bool ``(combinations,)``."""
        if by == "combinations":
            is_test = np.zeros(len(self.combinations), dtype=bool)
            is_test[np.argsort(self.combinations.fraction(seed))[: max(1, round(share * len(is_test)))]] = True
            return is_test
        if rules:
            chosen = list(map(self.index, _listed(rules)))
        else:
            order = make_combinations(self.names, [1.0] * len(self.names), as_noise(1), lambda _: False).fraction(seed)
            chosen = np.argsort(order)[: max(1, round(share * len(self.names)))].tolist()
        return self.combinations.active[:, chosen].any(axis=1)

    def _by_constants(self, part: str, share: float) -> "RuleSpace":
        laws, with_constants = dict(self.laws), np.zeros(len(self.options), dtype=bool)
        for parameter, law, k in self._constants:
            halves = _halves(parameter, law, 1 - share)
            if halves is not None:
                laws[parameter] = halves[part == "test"]
                with_constants[k] = True
        kept = np.asarray(self.combinations.active[:, with_constants].any(axis=1))
        if not kept.any():
            raise RuleError(
                "split by='constants': no option has a constant of more than one value; split by='combinations'"
            )
        name = [part, "constants", share]
        return self._restricted(self.combinations if part == "train" else self.combinations.where(kept), laws, name)

    def _restricted(self, table: Combinations, laws: dict[type[Parameter], Noise], name: list[Any]) -> "RuleSpace":
        part = copy.copy(self)
        part.combinations, part.laws, part.splits = table, laws, (*self.splits, name)
        return part

    @property
    def _constants(self) -> tuple[tuple[type[Parameter], Noise, int], ...]:
        """Each constant, its distribution, and the place of its option."""
        owners = {p: k for k, option in enumerate(self.options) for p in option.constants}
        return tuple((p, law, owners[p]) for p, law in self.laws.items())

    def require_suits(self, types: Sequence[type[Entity]]) -> None:
        """Raise :class:`RuleError` where no entity of these types has what the rules of an option need."""
        for option in self.options:
            for one in (*option.rules, *option.on_contact):
                for pattern in one.needs:
                    if not any(matches(kind, pattern) for kind in types):
                        named = ", ".join(f.__name__ for f in pattern.factors)
                        named = named if pattern.entity_type is None else pattern.entity_type.__name__
                        raise RuleError(
                            f"the option '{option.name}' of the rule space: {one.where} needs an entity with {named}, and the"
                            f" levels have only {', '.join(t.__name__ for t in types)}; leave the option out"
                        )

    def _require_once(self) -> None:
        """Raise :class:`RuleError` where a rule holds twice in some level: always and in an option, or in two options."""
        holders = [("always=", self.always)]
        holders += [(f"the option '{o.name}'", (*o.rules, *o.on_contact)) for o in self.options]
        for k, (holder, rules) in enumerate(holders):
            for other, (name, others) in enumerate(holders[:k]):
                meet = other == 0 or self.combinations.together[other - 1, k - 1]
                for rule in rules:
                    if meet and any(rule.function is one.function and rule.relation is one.relation for one in others):
                        raise RuleError(
                            f"{rule.where}: the rule is in {name} and in {holder}, so its effects would count twice where both"
                            " hold; leave it out of one of them" + (", or exclude one by exclusive=" if other else "")
                        )

    def excludes(self, places: Collection[int]) -> bool:
        """Whether options at these places never hold together."""
        return any(len(set(group) & set(places)) > 1 for group in self.exclusive)

    def __repr__(self) -> str:
        return (
            f"<rule space of {counted(len(self.options), 'option')}, {counted(len(self.combinations), 'combination')}>"
        )


def _listed(given: Any) -> Sequence[Any]:
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise RuleError(f"a list is needed, not {given!r}")
    return given


def _group(given: Any) -> Sequence[Any]:
    if isinstance(given, str) or not isinstance(given, Sequence) or len(given) < 2:
        raise RuleError(
            f"exclusive must list groups of two or more names, as in [('wind', 'water')], and {given!r} is none"
        )
    return given


def _count(active: Any, options: int) -> Noise:
    """The distribution of how many options are active."""
    if not is_whole(active) and not isinstance(active, Noise):
        raise RuleError(f"active must be a whole number or a distribution of such, not {active!r}")
    count = as_noise(active)
    values, masses = count.atoms if count.width == 1 else (np.zeros(0), np.zeros(0))
    if abs(masses.sum() - 1) > 1e-9 or (values != np.rint(values)).any() or (values < 0).any():
        raise RuleError(f"active must be a distribution of whole numbers from 0 up, not {active!r}")
    if values.max() > options:
        raise RuleError(f"{int(values.max())} options cannot be active: the rule space has {options}")
    return count


def _halves(parameter: type[Parameter], law: Noise, at: float) -> tuple[Noise, Noise] | None:
    """The distribution below and above the quantile ``at``; None where it has one value only."""
    values, masses = law.atoms
    if abs(masses.sum() - 1) < 1e-9:
        if len(values) < 2:
            return None
        last = min(max(int(np.searchsorted(np.cumsum(masses), at - 1e-12)), 0), len(values) - 2)
        parts = (values[: last + 1], masses[: last + 1]), (values[last + 1 :], masses[last + 1 :])
        low, high = (Choice(v.tolist(), (m / m.sum()).tolist()) for v, m in parts)
        return low, high
    if isinstance(law, (UniformNoise, LogUniform)):
        low, high = law.support
        middle = float(law.icdf(at))
        return type(law)(low, middle), type(law)(float(np.nextafter(middle, np.inf)), high)
    raise RuleError(
        f"split by='constants': {parameter.__name__} has the distribution {law!r}, which cannot be cut; use UniformNoise,"
        " LogUniform or a Choice, or split by='combinations'"
    )
