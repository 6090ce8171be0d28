"""The same rules run as plain Python on one environment state: the oracle of the kernels, and the debugger of rules.

Nothing here looks at generated code. Entities match by what their types declare, every rule is called on every ordered
tuple of distinct entities, and its outcomes are folded as the paper says. Some thousand times slower than a kernel.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

from segar.engine import Needs, needs_of
from segar.errors import ConflictError, SegarError
from segar.language import (
    Aggregate,
    Differential,
    Effect,
    Factor,
    Framerate,
    Layout,
    Number,
    Position,
    Relation,
    Rule,
    SetFactor,
    Signature,
    Task,
    TaskFunctions,
    VectorValue,
    Velocity,
    WorldRules,
    build_argument,
    default_task,
    random,
)
from segar.reference.reference_contacts import ContactRules, Rates, move, resolve_contacts
from segar.reference.reference_state import Scene
from segar.reference.result import Firing, Result

Takes = Callable[[Rule, Effect], bool]


@dataclass(frozen=True)
class Interpreter:
    """Steps one state of one level by running the rules themselves.

    Args:
        world: rules.
        layout: slots and columns of the level distribution.
        task: action, reward and termination; PuttPutt where it is None.
    """

    world: WorldRules
    layout: Layout
    task: Task = field(default_factory=default_task)

    @cached_property
    def functions(self) -> TaskFunctions:
        """The task's rules."""
        return self.task.functions()

    def step(
        self,
        levels: Any,
        index: int = 0,
        values: Any = None,
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
        run = _Run(
            self.world, self.functions, Scene.of_level(levels, index, values, key, tick, self.world.walls), explain
        )
        if action is not None:
            run.act(action)
        for _ in range(n or (1 if action is None else self.task.sub_steps)):
            run.sub_step()
            if action is not None and run.task_holds("terminated"):
                break
        scene = run.scene
        result = Result(scene, scene.values, scene.tick, run.contacts, run.gave_up, firings=run.firings)
        if action is not None:
            result.reward = run.reward()
            result.terminated, result.success, result.death = map(run.task_holds, ("terminated", "success", "death"))
        return result


@dataclass
class _Run:
    """A step in progress."""

    world: WorldRules
    functions: TaskFunctions
    scene: Scene
    explain: bool
    action: tuple[Number, ...] = ()
    contacts: int = 0
    gave_up: int = 0
    firings: list[Firing] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.dt = 1.0 / self.scene.parameters[Framerate]

    def act(self, action: Sequence[float]) -> None:
        ranges = zip(action, self.functions.action_low, self.functions.action_high, strict=True)
        self.action = tuple(Number(min(max(float(a), low), high)) for a, low, high in ranges)
        self._stage("act", list(self.functions.act), lambda rule, effect: True, scale=1.0)

    def sub_step(self) -> None:
        rules = list(self.world.rules)
        # What a rule says about positions counts in the stage of positions alone, even if it is checked again.
        self._stage("factors", rules, lambda r, e: _stage_of(e) == "factors" or (r.recheck and not _moves(e)))
        self._stage("velocity", rules, lambda r, e: _stage_of(e) == "velocity" or (r.recheck and not _moves(e)))
        if self.world.limit is not None:
            self._stage("limit", [self.world.limit], lambda r, e: True)
        rates = self.rates()
        self._stage("position", rules, lambda r, e: _moves(e) and e.kind is not Differential)
        move(self.scene, rates, self.dt)
        contact_rules = ContactRules(self.solid, self.hit_wall, self.hit_body, self.rates)
        contacts, jammed = resolve_contacts(self.scene, contact_rules, rates, self.dt)
        self.contacts += contacts
        self.gave_up += jammed
        self.scene.tick += 1

    # -- rules ---------------------------------------------------------------------------------------------------

    def _stage(self, name: str, rules: list[Rule], takes: Takes, scale: float | None = None) -> None:
        """All rules see the state from before the stage; what they say is written when all have spoken."""
        self._write(self._fold(self._gather(name, rules, takes), self.dt if scale is None else scale))

    def rates(self) -> Rates:
        """The sum of the differentials on each position; nothing where a rule sets or aggregates the position."""
        gathered = self._gather("position", list(self.world.rules), lambda r, e: _moves(e))
        rates = {}
        for (slot, _), said in gathered.items():
            only_rates = all(effect.kind is Differential for _, effect in said)
            x, y = _sum(effect for _, effect in said) if only_rates else (0.0, 0.0)
            rates[slot] = VectorValue(x, y)
        return rates

    def _gather(self, stage: str, rules: list[Rule], takes: Takes) -> dict[tuple[int, int], list[tuple[Rule, Effect]]]:
        """What the rules say on each (slot, column), in order of rules and entities."""
        gathered: dict[tuple[int, int], list[tuple[Rule, Effect]]] = {}
        for rule in rules:
            for slots in self.scene.tuples(own_needs(rule)):
                if rule.relation is not None and not self._related(rule.relation, slots):
                    continue
                effects = self._call(rule, slots)
                taken = tuple(e for e in effects if takes(rule, e))
                for effect in taken:
                    self._put(gathered, rule, slots, effect)
                self._note(stage, rule, slots, taken)
        return gathered

    def _put(self, gathered: dict, rule: Rule, slots: tuple[int, ...], effect: Effect) -> None:
        slot = slots[effect.target.argument]
        gathered.setdefault((slot, self.scene.column(slot, effect.target.factor)), []).append((rule, effect))

    def _write(self, changed: dict[tuple[int, int], tuple[float, ...]]) -> None:
        for (slot, column), parts in changed.items():
            self.scene.write(slot, column, parts)

    def _fold(self, gathered: dict, scale: float) -> dict[tuple[int, int], tuple[float, ...]]:
        """SetFactor beats Aggregate beats Differential."""
        changed = {}
        for (slot, column), said in gathered.items():
            sets = [(rule, e) for rule, e in said if e.kind is SetFactor]
            sums = [e for _, e in said if e.kind is Aggregate]
            if sets:
                changed[slot, column] = self._decide(slot, sets)
            elif sums:
                changed[slot, column] = _sum(sums)
            else:
                change = _sum(e for _, e in said)
                old = self.scene.values[slot, column : column + len(change)]
                changed[slot, column] = tuple(float(o) + c * scale for o, c in zip(old, change, strict=True))
        return changed

    def _decide(self, slot: int, sets: list[tuple[Rule, Effect]]) -> tuple[float, ...]:
        """The value of the most specific rule; rules that are equally specific must agree."""
        highest = max(rule.priority for rule, _ in sets)
        (first, chosen), *others = [(rule, e) for rule, e in sets if rule.priority == highest]
        for other, effect in others:
            if _parts(effect) != _parts(chosen):
                raise ConflictError(
                    f"{first.where} and {other.where} set {chosen.target.factor.__name__} of"
                    f" '{self.scene.layout.names[slot]}' to different values, {chosen.value!r} and {effect.value!r},"
                    " and neither is more specific; give one a priority"
                )
        return _parts(chosen)

    def _related(self, relation: Relation, slots: tuple[int, ...]) -> bool:
        """Whether a relation holds: its entities match what it takes, and its function says so."""
        if relation.parts:
            answers = [self._related(part, slots) for part in relation.parts]
            return all(answers) if relation.truth.op == "and" else any(answers)
        patterns = zip(slots, relation.signature.entities, strict=False)
        if not all(self.scene.meets(s, Needs(p.factors, p.entity_type)) for s, p in patterns):
            return False
        try:
            return bool(relation.function(*self._arguments(relation.signature, slots)))
        except _Lacking:
            return False

    def _call(self, rule: Rule, slots: tuple[int, ...], wall: VectorValue | None = None) -> list[Effect]:
        """The effects of a rule on these entities."""
        returned = self._value(rule, slots, wall)
        effects = returned if isinstance(returned, (tuple, list)) else (returned,)
        return [e for e in effects if e is not None]

    def _value(self, rule: Rule, slots: tuple[int, ...], wall: VectorValue | None = None) -> Any:
        """What the rule's function returns for these entities."""
        draws = itertools.count()
        random._uniform_source.append(
            lambda: keyed_uniform(self.scene.key, self.scene.tick, self._site(rule) * 256 + next(draws), slots)
        )
        try:
            return rule.function(*self._arguments(rule.signature, slots, wall))
        finally:
            random._uniform_source.pop()

    def _arguments(self, signature: Signature, slots: tuple[int, ...], wall: VectorValue | None = None) -> list[Any]:
        def read(entity: int, factor: Any) -> Any:
            if entity >= 0 and factor.width and not self.scene.has(slots[entity], factor):
                raise _Lacking(factor)
            return self.scene.read(slots, entity, factor, wall, self.action)

        def ask(name: str, a: int, b: int) -> bool:
            return self.scene.relation(name, slots[a], slots[b])

        return [build_argument(a, signature, read, ask) for a in signature.arguments]

    def _site(self, rule: Rule) -> int:
        """Place of a rule in the order that keys its draws: the world's rules, the limit, contacts, then the task's."""
        world, task = self.world, self.functions
        order = [*world.rules, world.limit, world.wall_contact, world.pair_contact, *world.on_contact]
        order += [*task.act, *task.of_state]
        return [r for r in order if r is not None].index(rule)

    def _note(self, stage: str, rule: Rule, slots: tuple[int, ...], effects: tuple[Effect, ...]) -> None:
        if self.explain and effects:
            names = tuple(self.scene.layout.names[s] for s in slots)
            self.firings.append(Firing(stage, rule, names, effects))

    # -- contacts ------------------------------------------------------------------------------------------------

    def solid(self, slot: int) -> bool:
        """Whether a body collides with other bodies; what the world's function cannot judge does."""
        rule = self.world.solid
        if self.world.pair_contact is None or rule is None:
            return self.world.pair_contact is not None
        return not self.scene.meets(slot, own_needs(rule)[0]) or bool(self._value(rule, (slot,)))

    def hit_wall(self, slot: int, axes: VectorValue) -> None:
        noted = self._notes((slot,), axes)
        rule = self.world.wall_contact
        if rule is None:
            v = self.scene.vector(slot, Velocity)
            parts = tuple(0.0 if blocked else float(c) for c, blocked in zip(v, axes, strict=True))
            self.scene.write(slot, self.scene.column(slot, Velocity), parts)
        else:
            self._assign(rule, (slot,), axes)
        self._write(noted)

    def hit_body(self, first: int, second: int) -> None:
        assert self.world.pair_contact is not None  # else nothing is solid
        noted = self._notes((first, second))
        self._assign(self.world.pair_contact, (first, second))
        self._write(noted)

    def _notes(
        self, bodies: tuple[int, ...], wall: VectorValue | None = None
    ) -> dict[tuple[int, int], tuple[float, ...]]:
        """What the rules of ``on_contact`` set, decided on the state in which the bodies meet."""
        gathered: dict[tuple[int, int], list[tuple[Rule, Effect]]] = {}
        for rule in self.world.on_contact:
            for slots in itertools.permutations(bodies):
                needs = own_needs(rule)
                if len(needs) != len(slots) or not all(map(self.scene.meets, slots, needs)):
                    continue
                effects = tuple(self._call(rule, slots, wall))
                for effect in effects:
                    self._put(gathered, rule, slots, effect)
                self._note("contact", rule, slots, effects)
        return self._fold(gathered, 0.0)

    def _assign(self, rule: Rule, slots: tuple[int, ...], wall: VectorValue | None = None) -> None:
        if not all(self.scene.meets(s, n) for s, n in zip(slots, own_needs(rule), strict=True)):
            return
        effects = tuple(self._call(rule, slots, wall=wall))
        self._note("contact", rule, slots, effects)
        for effect in effects:
            slot = slots[effect.target.argument]
            self.scene.write(slot, self.scene.column(slot, effect.target.factor), _parts(effect))

    # -- the task ------------------------------------------------------------------------------------------------

    def reward(self) -> float:
        """Summed over all entities that match."""
        return sum((float(v) for rule in self.functions.reward for v in self._values(rule)), 0.0)

    def task_holds(self, what: str) -> bool:
        """Whether the task's ``terminated``, ``success`` or ``death`` holds for any entities that match."""
        return any(bool(v) for rule in getattr(self.functions, what) for v in self._values(rule))

    def _values(self, rule: Rule) -> list[Any]:
        """The value for each tuple that matches, or one for all tuples that differ only in reduced arguments."""
        signature, found = rule.signature, {}
        for slots in self.scene.tuples(own_needs(rule)):
            free = slots[: len(slots) - signature.reduced]
            found.setdefault(free, []).append(self._value(rule, slots))
        if not signature.reduced:
            return [value for values in found.values() for value in values]
        return [all(values) if signature.reduction == "every" else max(values) for values in found.values()]


own_needs = lru_cache(maxsize=1024)(needs_of)


class _Lacking(SegarError):
    """A relation reads a factor that the entity lacks: then it does not hold."""

    def __init__(self, factor: type[Factor]) -> None:
        super().__init__(f"no {factor.__name__}")


def keyed_uniform(key: int, tick: int, site: int, slots: tuple[int, ...]) -> Number:
    """The uniform number in [0, 1) of a key: SplitMix64 over (key, tick, site, entities), in plain integers."""
    a, b, c = (*slots, 0, 0, 0)[:3]
    z = _mix(key + (tick + 1) * 0x9E3779B97F4A7C15)
    z = _mix(z + site * 0xD1B54A32D192ED03)
    z = _mix(z + (a * 65536 + b) * 0x8CB92BA72F3D8DD7 + c)
    return Number((z >> 11) / 2.0**53)


def _mix(z: int) -> int:
    z %= 2**64
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) % 2**64
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % 2**64
    return z ^ (z >> 31)


def _stage_of(effect: Effect) -> str:
    factor = effect.target.factor
    return "position" if issubclass(factor, Position) else "velocity" if issubclass(factor, Velocity) else "factors"


def _moves(effect: Effect) -> bool:
    return _stage_of(effect) == "position"


def _parts(effect: Effect) -> tuple[float, ...]:
    value = effect.value
    return (float(value.x), float(value.y)) if isinstance(value, VectorValue) else (float(value),)


def _sum(effects: Any) -> tuple[float, ...]:
    return tuple(sum(parts, 0.0) for parts in zip(*map(_parts, effects), strict=True))
