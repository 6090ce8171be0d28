"""The entry of a kernel: its arguments in groups, and the loop that takes each environment through a step.

The source of a sub-step follows :data:`segar.language.SUB_STEP`, stage by stage.
"""

import textwrap
from dataclasses import fields

from segar.engine.batch import LevelArrays, State, StepResult
from segar.engine.compiler.source import ENTRY_DECORATOR, STATE
from segar.language import ACT, SUB_STEP, Operation, Stage, TaskFunctions

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


def entry_source(task: TaskFunctions, framerate: int, may_touch: str) -> str:
    """The entry function ``advance``.

    Args:
        framerate: column of the framerate among the world parameters.
        may_touch: source of the test whether any contact is possible.
    """
    sub_step = "\n".join(" " * 16 + line for stage in SUB_STEP for line in stage_source(stage, may_touch))
    return _ENTRY.format(
        decorator=ENTRY_DECORATOR,
        arguments=textwrap.fill(", ".join((*THREAD_ARGUMENTS, *ARGUMENTS)), 108, subsequent_indent=" " * 12),
        low=list(task.action_low),
        high=list(task.action_high),
        framerate=framerate,
        state=STATE,
        act=stage_call(ACT),
        sub_step=sub_step,
    )


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


_ENTRY = '''ACTION_LOW = np.array({low})
ACTION_HIGH = np.array({high})


{decorator}
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
            V, key, tick, err, at = state_values[e], state_key[e], state_tick[e], errors[e], state_level[e]
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
            if with_task:
                result_terminated[e] = ended
                result_reward[e] = reward_of({state})
                result_success[e] = success_of({state})
                result_death[e] = death_of({state})
        if places > 0:
            gather_range(state_values, state_level, rows, start, stop, reads, table_on(sheet, len(state_level), places))
        finish_part(ledger)
        part = take_part(ledger, owns)
'''
