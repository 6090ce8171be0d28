"""The entry that takes environments through a step, and what it exports as plain data."""

from typing import Any

from segar.engine.batch import State, StepResult
from segar.engine.compiler.kernel import RANGE_ARGUMENTS, generate_range
from segar.engine.targets.entry import BY_ENTITY, BY_NUMBER, Argument, Entry
from segar.language import Layout, Task, WorldRules

STEP = "advance_range"


def step_entry(world: WorldRules, layout: Layout, task: Task, order: str = BY_ENTITY) -> Entry:
    """The entry ``advance_range``: environments ``start`` to ``stop - 1`` take a step, as those of
    :class:`segar.engine.Simulator` do, to the bit.

    Its arrays are those of :class:`segar.engine.State` (``state_*``), of :class:`segar.engine.LevelArrays` (``level_*``) and of
    :class:`segar.engine.StepResult` (``result_*``); ``actions``, float32 ``(envs, action size)``; and ``errors``, int64
    ``(envs, 5)``, zero at first. Where ``with_task`` is false, the task takes no part.

    Args:
        order: of ``state_values`` in memory: :data:`BY_ENTITY`, or :data:`BY_NUMBER`, by which neighbours in a batch are
            neighbours in memory.

    Raises:
        RuleError, ConflictError: the world does not fit the layout or contradicts itself.
    """
    source = generate_range(layout, world, task.functions(), copies=order == BY_NUMBER)
    entities, width = len(layout.slots), layout.width
    batch = {f"state_{name}": array for name, array in vars(State.empty(0, layout)).items()}
    batch |= {f"result_{name}": array for name, array in vars(StepResult.empty(0)).items()}
    forms: dict[str, tuple[str, tuple[int | str, ...] | None]] = {
        "sub_steps": ("int64", None),
        "with_task": ("bool", None),
        "actions": ("float32", ("envs", len(task.action_low))),
        "errors": ("int64", ("envs", 5)),
        **{name: (array.dtype.name, ("envs", *array.shape[1:])) for name, array in batch.items()},
        "level_bits": ("int64", ("levels", entities)),
        "level_kind": ("int8", ("levels", entities)),
        "level_count": ("int16", ("levels", entities)),
        "level_vertex": ("float64", ("levels", entities, "corners", 2)),
        "level_hull_radius": ("float64", ("levels", entities)),
        "level_parameters": ("float64", ("levels", len(layout.parameters))),
    }
    arguments = tuple(
        Argument(name, *forms[name], order if name == "state_values" else BY_ENTITY)
        for name in RANGE_ARGUMENTS
        if name in forms
    )
    scratch = 8 * (2 * entities * (width + 1) + len(task.action_low) + source.list_length)
    return Entry(STEP, source.text, arguments, scratch=scratch)


def described_world(layout: Layout, task: Task) -> dict[str, Any]:
    """Of a world what a caller needs to know, as plain data: entities, the columns of factors, parameters, the task."""
    return {
        "entities": [{"name": slot.name, "types": [kind.__name__ for kind in slot.types]} for slot in layout.slots],
        "columns": {factor.__name__: column for factor, column in layout.columns.items()},
        "width": layout.width,
        "parameters": [parameter.__name__ for parameter in layout.parameters],
        "task": {
            "name": task.name,
            "action_low": list(task.action_low),
            "action_high": list(task.action_high),
            "sub_steps": task.sub_steps,
            "max_steps": task.max_steps,
        },
    }
