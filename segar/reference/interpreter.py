"""The same rules run as plain Python on one environment state: the oracle of the kernels, and the debugger of rules.

Nothing here looks at generated code. Entities match by what their types declare, every rule is called on every ordered
tuple of distinct entities, and its effects are combined as in the paper. Some thousand times slower than a kernel.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from segar import language
from segar.errors import ConflictError, SegarError
from segar.language import Number, random
from segar.levels import Levels
from segar.reference.reference_contacts import ContactRules, Rates, move, resolve_contacts
from segar.reference.reference_state import Firing, ReferenceState, Result

Slots = tuple[int, ...]
"""The slots of a rule's entities."""
Place = tuple[int, int]
"""A slot, and the first column of a factor."""
Gathered = dict[Place, list[tuple[language.Rule, language.Effect]]]
Changes = dict[Place, tuple[float, ...]]


@dataclass(frozen=True)
class Interpreter:
    """Steps one state of one level by running the rules themselves.

    >>> levels = segar.family("empty-hard").sample(1, seed=0)
    >>> result = segar.Interpreter(segar.World(), levels.layout).step(levels, action=[1.0, 0.0])
    >>> result.read("golfball", segar.Velocity)[0] > 0
    True

    Args:
        world: rules.
        layout: slots and columns of the level distribution.
        task: action, reward and termination; PuttPutt where it is None.

    Raises:
        RuleError: what a rule reads changed since it was made.
    """

    world: language.WorldRules
    layout: language.Layout
    task: language.Task = field(default_factory=language.default_task)

    def __post_init__(self) -> None:
        for rule in language.rules_of(self.world):
            rule.require_current()

    @cached_property
    def functions(self) -> language.TaskFunctions:
        """The task's rules."""
        return self.task.functions()

    def step(
        self,
        levels: Levels,
        index: int = 0,
        values: np.ndarray | None = None,
        action: Sequence[float] | None = None,
        n: int | None = None,
        key: int = 0,
        tick: int = 0,
        explain: bool = False,
    ) -> Result:
        """One environment step with an ``action``, or ``n`` sub-steps without one (default 1).

        Args:
            levels: levels of this layout; ``index`` is the one whose types, shapes and parameters count.
            values: float64 ``(entities, columns)``, not changed; the level's initial state where it is None.
            key, tick: key of the randomness in rules, and sub-steps since the episode began.
            explain: report which rules fired with which outcomes.

        Raises:
            ConflictError: two rules set a factor to different values and neither is more specific.
        """
        if levels.layout != self.layout:
            raise SegarError("these levels belong to another distribution than the interpreter was made for")
        state = ReferenceState.of_level(levels, index, values, key, tick, self.world.walls)
        run = _Run(self.world, self.functions, state, explain)
        if action is not None:
            run.act(action)
        for _ in range(n or (1 if action is None else self.task.sub_steps)):
            run.sub_step()
            if action is not None and run.task_holds("terminated"):
                break
        result = Result(state, state.values, state.tick, run.contacts, run.unresolved_contacts, firings=run.firings)
        if action is not None:
            result.reward = run.reward()
            result.terminated, result.success, result.death = map(run.task_holds, ("terminated", "success", "death"))
        return result


@dataclass
class _Run:
    """A step in progress."""

    world: language.WorldRules
    functions: language.TaskFunctions
    state: ReferenceState
    explain: bool
    action: tuple[language.Number, ...] = ()
    rates: Rates = field(default_factory=dict)
    contacts: int = 0
    unresolved_contacts: int = 0
    firings: list[Firing] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.dt = 1.0 / self.state.parameters[language.Framerate]

    def act(self, action: Sequence[float]) -> None:
        ranges = zip(action, self.functions.action_low, self.functions.action_high, strict=True)
        self.action = tuple(language.Number(min(max(float(a), low), high)) for a, low, high in ranges)
        self._run_stage(language.ACT)

    def sub_step(self) -> None:
        for stage in language.SUB_STEP:
            self._run_stage(stage)
        self.state.tick += 1

    def _run_stage(self, stage: language.Stage) -> None:
        match stage.operation:
            case language.Operation.APPLY_EFFECTS:
                self._write(self._fold(self._gather(stage), self.dt if stage.scales else 1.0))
            case language.Operation.FIND_RATES:
                self.rates = self.find_rates()
            case language.Operation.MOVE:
                move(self.state, self.rates, self.dt)
            case language.Operation.RESOLVE_CONTACTS:
                rules = ContactRules(self.solid, self.hit_wall, self.hit_body, self.find_rates)
                contacts, unresolved = resolve_contacts(self.state, rules, self.rates, self.dt)
                self.contacts += contacts
                self.unresolved_contacts += unresolved

    # -- rules ---------------------------------------------------------------------------------------------------

    def find_rates(self) -> Rates:
        """The sum of the differentials on each position; zero where a rule sets or aggregates the position."""
        rates = {}
        for (slot, _), pairs in self._gather(language.FIND_RATES).items():
            only_rates = all(effect.kind is language.Differential for _, effect in pairs)
            x, y = _sum(effect for _, effect in pairs) if only_rates else (0.0, 0.0)
            rates[slot] = language.VectorValue(x, y)
        return rates

    def _gather(self, stage: language.Stage) -> Gathered:
        """The effects that count in the stage on each place, in order of rules and entities."""
        gathered: Gathered = {}
        for rule in filter(self._is_active, stage.rules(self.world, self.functions)):
            for slots in self.state.tuples(rule.needs):
                if rule.relation is None or self._is_related(rule.relation, slots):
                    effects = self._effects(rule, slots)
                    counted = [e for e in effects if stage.counts(rule, e.kind, e.target.factor)]
                    self._add(gathered, stage.name, rule, slots, counted)
        return gathered

    def _is_active(self, rule: language.Rule) -> bool:
        """Whether the rule holds in the level."""
        return rule.active is None or self.state.parameters[rule.active] != 0

    def _add(
        self, gathered: Gathered, stage: str, rule: language.Rule, slots: Slots, effects: Sequence[language.Effect]
    ) -> None:
        for effect in effects:
            gathered.setdefault(self._place(slots, effect), []).append((rule, effect))
        self._record(stage, rule, slots, effects)

    def _place(self, slots: Slots, effect: language.Effect) -> Place:
        slot = slots[effect.target.argument]
        return slot, self.state.column(slot, effect.target.factor)

    def _write(self, changes: Changes) -> None:
        for (slot, column), parts in changes.items():
            self.state.write(slot, column, parts)

    def _fold(self, gathered: Gathered, scale: float) -> Changes:
        """The new values: SetFactor wins over Aggregate, and Aggregate over Differential."""
        changes: Changes = {}
        for (slot, column), pairs in gathered.items():
            sets = [(rule, e) for rule, e in pairs if e.kind is language.SetFactor]
            aggregates = [e for _, e in pairs if e.kind is language.Aggregate]
            if sets:
                changes[slot, column] = self._decide(slot, sets)
            elif aggregates:
                changes[slot, column] = _sum(aggregates)
            else:
                change = _sum(e for _, e in pairs)
                old = self.state.values[slot, column : column + len(change)]
                changes[slot, column] = tuple(float(o) + c * scale for o, c in zip(old, change, strict=True))
        return changes

    def _decide(self, slot: int, sets: list[tuple[language.Rule, language.Effect]]) -> tuple[float, ...]:
        """The value of the most specific rule; rules that are equally specific must agree."""
        highest = max(rule.priority for rule, _ in sets)
        (first, chosen), *others = [(rule, e) for rule, e in sets if rule.priority == highest]
        for other, effect in others:
            if _parts(effect) != _parts(chosen):
                raise ConflictError(
                    f"{first.where} and {other.where} set {chosen.target.factor.__name__} of"
                    f" '{self.state.layout.names[slot]}' to different values, {chosen.value!r} and {effect.value!r},"
                    " and neither is more specific; give one a priority"
                )
        return _parts(chosen)

    def _is_related(self, relation: language.Relation, slots: Slots) -> bool:
        """Whether a relation holds: the entities have what it needs, and its function returns true."""
        if relation.parts:
            answers = [self._is_related(part, slots) for part in relation.parts]
            return all(answers) if relation.truth.op == "and" else any(answers)
        if not all(map(self.state.meets, slots, relation.needs)):
            return False
        return bool(relation.function(*self._arguments(relation.signature, slots)))

    def _effects(
        self, rule: language.Rule, slots: Slots, wall: language.VectorValue | None = None
    ) -> list[language.Effect]:
        """The effects of a rule on these entities."""
        returned = self._value(rule, slots, wall)
        effects = returned if isinstance(returned, (tuple, list)) else (returned,)
        return [e for e in effects if e is not None]

    def _value(self, rule: language.Rule, slots: Slots, wall: language.VectorValue | None = None) -> Any:
        """What the rule's function returns for these entities."""
        draws, state = itertools.count(), self.state

        def draw() -> language.Number:
            return keyed_uniform(state.key, state.tick, self._site(rule) * 256 + next(draws), slots)

        with random.drawing_from(draw):
            return rule.function(*self._arguments(rule.signature, slots, wall))

    def _arguments(
        self, signature: language.Signature, slots: Slots, wall: language.VectorValue | None = None
    ) -> list[Any]:
        def read(entity: int, factor: Any) -> Any:
            return self.state.read(slots, entity, factor, wall, self.action)

        def relation(name: str, a: int, b: int) -> bool:
            return self.state.relation(name, slots[a], slots[b])

        return [language.build_argument(a, read, relation) for a in signature.arguments]

    def _site(self, rule: language.Rule) -> int:
        """Place of a rule in the order that keys its draws: the world's rules, the limit, contacts, then the task's."""
        return [*language.rules_of(self.world), *self.functions.act, *self.functions.of_state].index(rule)

    def _record(self, stage: str, rule: language.Rule, slots: Slots, effects: Sequence[language.Effect]) -> None:
        if self.explain and effects:
            names = tuple(self.state.layout.names[s] for s in slots)
            self.firings.append(Firing(stage, rule, names, tuple(effects)))

    # -- contacts ------------------------------------------------------------------------------------------------

    def solid(self, slot: int) -> bool:
        """Whether a body collides with other bodies; a body that the world's function does not take does."""
        rule = self.world.solid
        if self.world.pair_contact is None or rule is None:
            return self.world.pair_contact is not None
        return not self.state.meets(slot, rule.needs[0]) or bool(self._value(rule, (slot,)))

    def hit_wall(self, slot: int, axes: language.VectorValue) -> None:
        notes = self._notes((slot,), axes)
        rule = self.world.wall_contact
        if rule is None:
            v = self.state.vector(slot, language.Velocity)
            parts = tuple(0.0 if blocked else float(c) for c, blocked in zip(v, axes, strict=True))
            self.state.write(slot, self.state.column(slot, language.Velocity), parts)
        else:
            self._exchange(rule, (slot,), axes)
        self._write(notes)

    def hit_body(self, first: int, second: int) -> None:
        assert self.world.pair_contact is not None  # else nothing is solid
        notes = self._notes((first, second))
        self._exchange(self.world.pair_contact, (first, second))
        self._write(notes)

    def _notes(self, bodies: tuple[int, ...], wall: language.VectorValue | None = None) -> Changes:
        """What the rules of ``on_contact`` set, decided on the state in which the bodies meet."""
        gathered: Gathered = {}
        for rule in filter(self._is_active, self.world.on_contact):
            for slots in itertools.permutations(bodies):
                if len(rule.needs) == len(slots) and all(map(self.state.meets, slots, rule.needs)):
                    self._add(gathered, "contact", rule, slots, self._effects(rule, slots, wall))
        return self._fold(gathered, 0.0)

    def _exchange(self, rule: language.Rule, slots: Slots, wall: language.VectorValue | None = None) -> None:
        """Set at once what a rule of contact returns, where it takes these bodies."""
        if all(map(self.state.meets, slots, rule.needs)):
            effects = self._effects(rule, slots, wall)
            self._record("contact", rule, slots, effects)
            for effect in effects:
                self.state.write(*self._place(slots, effect), _parts(effect))

    # -- the task ------------------------------------------------------------------------------------------------

    def reward(self) -> float:
        """Summed over all entities that match."""
        return sum((float(v) for rule in self.functions.reward for v in self._values(rule)), 0.0)

    def task_holds(self, what: str) -> bool:
        """Whether the task's ``terminated``, ``success`` or ``death`` holds for any entities that match."""
        return any(bool(v) for rule in getattr(self.functions, what) for v in self._values(rule))

    def _values(self, rule: language.Rule) -> list[Any]:
        """The value for each tuple that matches, or one for all tuples that differ only in reduced arguments."""
        signature, found = rule.signature, {}
        for slots in self.state.tuples(rule.needs):
            free = slots[: len(slots) - signature.reduced]
            found.setdefault(free, []).append(self._value(rule, slots))
        if not signature.reduced:
            return [value for values in found.values() for value in values]
        return [all(values) if signature.reduction == "every" else max(values) for values in found.values()]


def _parts(effect: language.Effect) -> tuple[float, ...]:
    value = effect.value
    return (float(value.x), float(value.y)) if isinstance(value, language.VectorValue) else (float(value),)


def _sum(effects: Iterable[language.Effect]) -> tuple[float, ...]:
    return tuple(sum(parts, 0.0) for parts in zip(*map(_parts, effects), strict=True))


def keyed_uniform(key: int, tick: int, site: int, slots: Slots) -> Number:
    """The number in [0, 1) of a draw: SplitMix64 over key, sub-step, place of the draw in the rules, and entities."""
    a, b, c = (*slots, 0, 0, 0)[:3]
    z = _scramble(key + (tick + 1) * 0x9E3779B97F4A7C15)
    z = _scramble(z + site * 0xD1B54A32D192ED03)
    z = _scramble(z + (a * 65536 + b) * 0x8CB92BA72F3D8DD7 + c)
    return Number((z >> 11) / 2.0**53)


def _scramble(z: int) -> int:
    z %= 2**64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
    return z ^ (z >> 31)
