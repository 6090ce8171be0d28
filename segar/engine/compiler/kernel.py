"""Layout, rules and task -> the source of one module that steps a batch of environments.

The module consists of constants of the layout, contacts (:mod:`segar.engine.runtime.contacts`), the functions that the rules
became, and the entry, which takes each environment through a step: the source of a sub-step follows
:data:`segar.language.SUB_STEP`, stage by stage. What depends on no rule, geometry above all
(:mod:`segar.engine.runtime.geometry`), is a module of its own, compiled once for all worlds of a layout. Nothing in either
depends on sampled values, so all level sets of a distribution share them.
"""

import inspect
import re
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np

from segar import language
from segar.engine.batch import LevelArrays, State, StepResult
from segar.engine.compiler.checks import check_geometry, check_position_rule, check_rule
from segar.engine.compiler.contacts import COLLIDES, Contacts
from segar.engine.compiler.emit import over_group
from segar.engine.compiler.finite import finite_test
from segar.engine.compiler.kernel_cache import kernel_path
from segar.engine.compiler.source import DECORATOR, ENTRY_DECORATOR, STATE, Source, import_line
from segar.engine.compiler.spec import Group
from segar.engine.compiler.stages import StageWriter
from segar.engine.compiler.task_functions import task_functions
from segar.engine.runtime import contacts, gather, geometry, ledger, scratch, sheet
from segar.errors import RuleError
from segar.language import ACT, FIND_RATES, SUB_STEP, Layout, Operation, Rule, Stage
from segar.support import keyed_uniform, mathematics

THREAD_ARGUMENTS = ("ledger", "owns", "sheet")
"""How threads share the parts of a call, whether this thread owns the call, and where observations are written."""

ARGUMENTS = (
    *("part_length", "sub_steps", "with_task", "actions", "errors"),  # the call
    *(f"state_{field.name}" for field in fields(State)),
    *(f"level_{field.name}" for field in fields(LevelArrays)),
    *(f"result_{field.name}" for field in fields(StepResult)),
    *("rows", "reads", "places"),  # observation: environments, what is read of each, numbers per environment
    *("W", "U", "A", "L"),  # scratch of one thread; see STATE
)
"""Names of the other arguments, in order; the simulator gives each of them by its name."""

RANGE_ARGUMENTS = (
    *("start", "stop", "sub_steps", "with_task", "actions", "errors"),
    *(name for name in ARGUMENTS if name.startswith(("state_", "level_", "result_"))),
)
"""Names of the arguments of ``advance_range``, which steps environments ``start`` to ``stop - 1``."""


CONFLICT, STATE_NOT_FINITE, REWARD_NOT_FINITE = 1, 2, 3
"""What the first of an environment's five ``errors`` says; 0 where there is none. See :class:`FactorSetting` for the others
of a conflict, which is kept if a number becomes infinite, too."""

COPY_MARK = "# --- copied from here on ---\n"
COPY_MARK_OF_RULES = "# --- copied from here on, with what the rules became ---\n"
IMPORTS = "import math\n\nimport numpy as np\nfrom numba import njit\n"
MANY_BODIES = 12  # above this number it pays to sort bodies before pairs are compared


@dataclass
class KernelSource:
    """The generated module's text, and the tables that its arguments need.

    Attributes:
        text: source of the module.
        shared: source of the module that it takes geometry from; empty where it has its own.
        type_masks: int64 ``(types + 1,)``, mask of each type of the layout, and last 0 for an absent entity.
        rules: all rules by their numbers in the source.
        list_length: how many integers the argument ``L`` must hold.
        draws: whether a rule, or a function of the task, draws random numbers.
    """

    text: str
    shared: str
    type_masks: np.ndarray
    rules: tuple[Rule, ...]
    list_length: int
    draws: bool


def generate(layout: Layout, world: language.WorldRules, task: language.TaskFunctions) -> KernelSource:
    """The kernel of a world on a layout; what was asked before is not written again.

    Raises:
        RuleError: a rule or the task needs a parameter, an entity or a factor that the layout cannot serve; what a rule reads
            changed since it was made.
        ConflictError: two rules always contradict each other.
    """
    for rule in language.rules_of(world):
        rule.require_current()
    functions = (task.act, task.reward, task.terminated, task.success, task.death)
    meanings = tuple(tuple(map(_meaning, several)) for several in functions)
    return _written(_Asked(layout, world, (meanings, task.action_low, task.action_high), task))


@dataclass(frozen=True)
class _Asked:
    """What a kernel is written of. Functions of a task are traced anew each time, since what they read may have changed; those
    of one meaning are alike."""

    layout: Layout
    world: language.WorldRules
    meaning: tuple[Any, ...]
    task: language.TaskFunctions = field(compare=False)


def _meaning(rule: Rule) -> tuple[Any, ...]:
    """All of a rule that its source and its errors depend on. Equal symbols are one object while somebody holds one."""
    symbols = tuple(map(id, language.parts_of(rule.tree)))
    return rule.where, rule.signature, symbols, rule.relation, rule.priority, rule.recheck, rule.active


@lru_cache(maxsize=64)
def _written(asked: _Asked) -> KernelSource:
    builder, text = _Builder(asked.layout, asked.world, asked.task), _geometry_text()
    functions = builder.functions()
    shared = "\n".join([IMPORTS, builder.constants(), text])
    names = ", ".join(re.findall(r"^(?:def )?(\w+)(?= = |\()", text, re.M))
    imports = [
        import_line(gather, "gather_range"),
        import_line(ledger, "dismiss, finish_part, make_ledger, open_ledger, take_part"),
        import_line(sheet, "make_sheet, sheet_with, table_on"),
        f"from {kernel_path(shared).stem} import {names}",
    ]
    entry = _ENTRY.format(
        decorator=ENTRY_DECORATOR,
        arguments=textwrap.fill(", ".join((*THREAD_ARGUMENTS, *ARGUMENTS)), 108, subsequent_indent=" " * 12),
        environment=textwrap.indent(builder.environment("state_values[e]"), " " * 12),
    )
    return builder.module(imports, functions, entry, shared)


def generate_range(
    layout: Layout, world: language.WorldRules, task: language.TaskFunctions, copies: bool = False
) -> KernelSource:
    """The kernel without threads, for other targets than this processor: ``advance_range(start, stop, ...)``.

    Args:
        copies: whether an environment's state is copied into memory of its own for the step, and back.

    Raises:
        RuleError, ConflictError: see :func:`generate`.
    """
    builder = _Builder(layout, world, task)
    functions = "\n\n\n".join([_geometry_text(), builder.functions()])
    entities, width = len(layout.slots), layout.width
    entry = _RANGE.format(
        decorator=DECORATOR,
        arguments=textwrap.fill(", ".join(RANGE_ARGUMENTS), 108, subsequent_indent=" " * 4),
        shape=f"{entities}, {width}",
        entities=entities,
        actions=len(task.action_low),
        length=builder.length_of_lists(),
        copy=f"V = local_floats({entities}, {width})" if copies else "",
        load="copy_numbers(V, state_values[e])" if copies else "",
        environment=textwrap.indent(builder.environment("V" if copies else "state_values[e]"), " " * 8),
        store="copy_numbers(state_values[e], V)" if copies else "",
    )
    imports = [import_line(scratch, "copy_numbers, local_floats, local_integers")]
    return builder.module(imports, functions, entry)


@dataclass
class _Builder:
    layout: Layout
    world: language.WorldRules
    task: language.TaskFunctions
    source: Source = field(init=False)
    rules: list[Rule] = field(init=False)
    list_length: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.source = Source(self.layout)
        check_geometry(self.layout)
        numbers, world = len(self.task.action_low), self.world
        of_contacts = (world.wall_contact, world.pair_contact, *world.on_contact)
        self.of_contacts = [rule for rule in of_contacts if rule is not None]
        self.rules = [*language.rules_of(world), *self.task.act]
        for rule in (*self.rules, *self.task.of_state):
            allows_action = rule in self.task.act or rule in self.task.reward
            allows_wall = rule is world.wall_contact or rule in world.on_contact
            check_rule(rule, self.layout, numbers, allows_action, allows_wall)
        for rule in world.rules:
            if any(language.moves(rule, e.kind, e.factor) for e in language.effects_of(rule.tree)):
                check_position_rule(rule)

    @property
    def bodies(self) -> list[int]:
        """Slots whose entities may collide."""
        return self._slots(COLLIDES)[0]

    def module(self, imports: Sequence[str], functions: str, entry: str, shared: str = "") -> KernelSource:
        """The module of these functions and an entry that calls them; the header imports what the functions call."""
        resolving = _copied(contacts, COPY_MARK_OF_RULES)
        text = "\n".join([self.header(imports), self.constants(), resolving, "\n\n\n".join([functions, entry])])
        traced = [*self.rules, *self.task.of_state]
        draws = any(symbol.op == "draw" for rule in traced for symbol in language.symbols_of(rule.tree))
        return KernelSource(text, shared, self.source.matcher.masks(), tuple(self.rules), self.length_of_lists(), draws)

    def length_of_lists(self) -> int:
        """Entries of ``L``: bodies in order; behind them near walls and pairs, or partners while rules are applied."""
        bodies = len(self.bodies)
        return bodies + max(_room(bodies), self.list_length)

    def environment(self, values: str) -> str:
        """The lines that take environment ``e`` through a step; ``values``: source of its state."""
        sorts = len(self.bodies) > MANY_BODIES
        test = "any_touch(V, W, U, bits, kind, hull_radius, L)" if sorts else "may_touch(V, bits, kind, hull_radius)"
        return _ENVIRONMENT.format(
            values=values,
            framerate=self.layout.parameters.index(language.Framerate),
            state=STATE,
            act=stage_call(ACT),
            sub_step="\n".join(" " * 4 + line for stage in SUB_STEP for line in stage_source(stage, test)),
            state_not_finite=STATE_NOT_FINITE,
            reward_not_finite=REWARD_NOT_FINITE,
        )

    def header(self, imports: Sequence[str]) -> str:
        columns = self.layout.columns
        kinds = ["|".join(t.__name__ for t in slot.types) + "?" * slot.optional for slot in self.layout.slots]
        slots = ", ".join(map("{}: {}".format, self.layout.names, kinds))
        named = f"slots: {slots}\ncolumns: {', '.join(f'{f.__name__} {c}' for f, c in columns.items())}"
        # Level files of others name slots, and what ends the text would be code.
        named = named.replace("\\", "/").replace('"', "'")
        lines = [*imports, import_line(sys.modules[keyed_uniform.__module__], "keyed_uniform")]
        if self.source.called:  # elementary functions, which the rules call
            lines.append(import_line(mathematics, ", ".join(sorted(self.source.called))))
        imported = "\n".join(lines)
        return f'''"""Generated by SEGAR from the rules of one world; do not edit.

{named}
"""

{IMPORTS}
{imported}

CONTACT_MOVES = {self._contacts_move()}
'''

    def constants(self) -> str:
        """Columns, slots and bounds of the layout, by the names that geometry and contacts have for them."""
        columns = self.layout.columns
        floors, floor_bits = self._slots(language.Pattern((language.Floor, language.Position)))
        colliders, collider_bits = self._slots(COLLIDES)
        movers = sorted(s for g in self._writer(FIND_RATES).target_groups for s in g.slots)
        return f"""X = {columns.get(language.Position, 0)}
VX = {columns.get(language.Velocity, 0)}
SIZE = {columns.get(language.Size, 0)}
ORDER = {columns.get(language.Order, 0)}
FLOORS = np.array({floors}, np.int64)
COLLIDERS = np.array({colliders}, np.int64)
MOVERS = np.array({movers}, np.int64)
FLOOR_BITS = {floor_bits}
COLLIDER_BITS = {collider_bits}
LOW, HIGH = {-self.world.walls!r}, {self.world.walls!r}
ORDER_AT = 0
NEAR_AT = {len(colliders)}
MANY_BODIES = {len(colliders) > MANY_BODIES}
ROOM = {_room(len(colliders))}
"""

    def functions(self) -> str:
        """The functions that the rules and the task became, and the range of actions."""
        writer = Contacts(self.source, self.world, self.rules)
        parts = [
            writer.solid(),
            writer.movable(),
            self._stage(FIND_RATES, "rates(V, U, bits, P)", inline=False),
            writer.hit_wall(),
            writer.hit_body(),
            self._act(),
            *(
                self._stage_function(stage)
                for stage in SUB_STEP
                if stage.operation is not language.Operation.RESOLVE_CONTACTS
            ),
            writer.may_touch(),
            finite_test(self.source, self.rules),
            *task_functions(self.source, self.task, len(self.rules)),
            f"ACTION_LOW = np.array({list(self.task.action_low)})\nACTION_HIGH = np.array({list(self.task.action_high)})",
        ]
        return "\n\n\n".join(parts)

    def _stage_function(self, stage: Stage) -> str:
        """The function that a stage of a sub-step becomes."""
        return (
            self._move(stage) if stage.operation is language.Operation.MOVE else self._stage(stage, stage_call(stage))
        )

    def _stage(self, stage: Stage, header: str, inline: bool = True) -> str:
        writer = self._writer(stage)
        self.list_length = max(self.list_length, writer.list_length)
        with self.source.function(header, inline=inline) as w:
            self.source.write_parameters(w)
            writer.write(w)
        return w.text()

    def _act(self) -> str:
        if not self._writer(ACT).target_groups:
            raise RuleError(
                f"{self.task.act[0].where}: the task's action changes no entity of this distribution, which has only"
                f" {', '.join(t.__name__ for t in self.layout.types)}; choose the task that these levels are for (task=...)"
            )
        return self._stage_function(ACT)

    def _writer(self, stage: Stage) -> StageWriter:
        rules = [(self.rules.index(rule), rule) for rule in stage.rules(self.world, self.task)]
        return StageWriter(self.source.matcher, stage, rules, self.world.may_meet)

    def _move(self, stage: Stage) -> str:
        with self.source.function(stage_call(stage), inline=True) as w:
            for group in self._writer(FIND_RATES).target_groups:
                with over_group(w, group, "i"):
                    w.line("V[i, X] += U[i, 0] * dt")
                    w.line("V[i, X + 1] += U[i, 1] * dt")
        return w.text()

    def _contacts_move(self) -> bool:
        """Whether some rule of contact puts bodies elsewhere or changes their size."""
        moving = (language.Position, language.Size)
        return any(issubclass(factor, moving) for rule in self.of_contacts for factor in rule.changes)

    def _slots(self, needs: language.Pattern) -> tuple[list[int], int]:
        """Slots whose entities may match, and the mask to test, one for all of them."""
        groups = [g for g in self.source.matcher.groups if self.source.matcher.match(g, needs) is not None]
        slots = [i for g in groups for i in g.slots]
        if not groups:
            return slots, 0
        together = Group((), tuple(dict.fromkeys(t for g in groups for t in g.types)), any(g.optional for g in groups))
        return slots, self.source.matcher.match(together, needs) or 0


def _room(bodies: int) -> int:
    """Entries of the list of near walls and pairs: all of them, and some more for those listed again."""
    return bodies * (bodies + 1) // 2 + 4 * bodies


def _geometry_text() -> str:
    """The source of what depends on no rule."""
    return "\n\n".join([_copied(geometry, COPY_MARK), _copied(contacts, COPY_MARK, COPY_MARK_OF_RULES)])


def _copied(part: ModuleType, begin: str, end: str = "\0") -> str:
    """The source of a module of the runtime from one mark on, to another one or to its end, for numba."""
    return inspect.getsource(part).split(begin, 1)[1].split(end, 1)[0].replace("@njit\n", DECORATOR + "\n")


def stage_source(stage: Stage, may_touch: str) -> list[str]:
    """The lines that run a stage of a sub-step."""
    if stage.operation is not Operation.RESOLVE_CONTACTS:
        return [stage_call(stage)]
    return [
        f"if {may_touch}:",
        "    contacts, unresolved = resolve_contacts(V, W, U, bits, kind, hull_radius, P, err, L, dt)",
        "    state_contacts[e] += contacts",
        "    state_unresolved_contacts[e] += unresolved",
    ]


def stage_call(stage: Stage) -> str:
    """The call of the function that the stage became, which is also that function's header."""
    match stage.operation:
        case Operation.MOVE:
            return "move(V, U, bits, dt)"
        case Operation.FIND_RATES:
            return f"find_rates({STATE}, dt)"
        case _:
            return f"apply_{stage.name}({STATE}, dt)"


# Environment e takes a step.
_ENVIRONMENT = """V, key, tick, err, at = {values}, state_key[e], state_tick[e], errors[e], state_level[e]
bits, kind, count = level_bits[at], level_kind[at], level_count[at]
vertex, hull_radius, P = level_vertex[at], level_hull_radius[at], level_parameters[at]
dt = 1.0 / P[{framerate}]
if with_task:
    for c in range(len(ACTION_LOW)):
        A[c] = min(max(np.float64(actions[e, c]), ACTION_LOW[c]), ACTION_HIGH[c])
    {act}
ended = False
for _ in range(sub_steps):
{sub_step}
    tick += 1
    if with_task:
        ended = terminated_of({state})
        if ended:
            break
state_tick[e] = tick
if err[0] == 0 and not is_finite(V, bits):
    err[0] = {state_not_finite}
if with_task:
    result_terminated[e] = ended
    reward = reward_of({state})
    if err[0] == 0 and not abs(reward) < np.inf:
        err[0] = {reward_not_finite}
    result_reward[e] = reward
    result_success[e] = success_of({state})
    result_death[e] = death_of({state})"""

_ENTRY = '''{decorator}
def advance({arguments}):
    """Take environments through a step: those of each part that this thread takes from the ledger."""
    for a in range(len(COLLIDERS)):
        L[ORDER_AT + a] = COLLIDERS[a]
    if owns:
        open_ledger(ledger)
    part = take_part(ledger, owns)
    while part >= 0:
        start, stop = part * part_length, min((part + 1) * part_length, len(state_level))
        for e in range(start, stop):
{environment}
        if places > 0:
            gather_range(state_values, state_level, rows, start, stop, reads, table_on(sheet, len(state_level), places))
        finish_part(ledger)
        part = take_part(ledger, owns)
'''


# Steps a range of environments, in scratch of its own; of ``U``, only the rates of bodies that move are ever written.
_RANGE = '''{decorator}
def advance_range(
    {arguments}
):
    """Take environments start to stop - 1 through a step."""
    W, U, A, L = local_floats({shape}), local_floats({entities}, 2), local_floats(1, {actions})[0], local_integers({length})
    U[:] = 0.0
    {copy}
    for a in range(len(COLLIDERS)):
        L[ORDER_AT + a] = COLLIDERS[a]
    for e in range(start, stop):
        {load}
{environment}
        {store}
'''
