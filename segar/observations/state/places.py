"""Which number of a state observation is what: slots by their names and types, factors, types, masks; and its unit.

Numbers may be divided by constants, factor by factor. Others may be measured in units of the prior: from its mean, divided
by its spread. The prior is the distribution of the levels that the agent is trained on, also where it is tested on others.
Equal numbers of training and test levels thus mean equal states. A number that several types may supply has the mean and
the spread of their mixture in equal parts. A vector has one spread, the root mean square of its components', so that
directions stay comparable. A number that the prior does not vary keeps its unit and is measured from its constant. Size
keeps its unit [m] and its zero, since outlines of hulls do not follow it.
"""

from dataclasses import dataclass, field

import numpy as np

from segar.errors import LevelError, did_you_mean
from segar.language import Entity, Factor, Layout, Parameter, Position, Size, Slot, Visible
from segar.levels import Levels, source_moments
from segar.observations.state.state_options import StateOptions

EMPTY = -1  # the slot of a table's row that nothing fills


@dataclass(frozen=True)
class Places:
    """Where the numbers of an observation come from.

    Attributes:
        shape: of the observation.
        names: what each number is, in C order.
        reads: int64 ``[k, 5]``: slot, column, place of the number, column that must be true or -1, place of its mask.
        type_reads: int64 ``[k, 4]``: place of the number, slot, type, place of its mask.
        parameter_reads: int64 ``[p, 3]``: place of the number, column of ``Levels.parameters``, place of its mask.
        seen: bool ``[slot, type + 1]`` (the last for absent ones), which types are shown; None where all are.
        read_factors: what each of ``reads`` is: its factor and component.
        parameters: what each of ``parameter_reads`` is.
    """

    shape: tuple[int, ...]
    names: list[str]
    reads: np.ndarray
    type_reads: np.ndarray
    parameter_reads: np.ndarray
    seen: np.ndarray | None
    read_factors: list[tuple[type[Factor], int]]
    parameters: list[type[Parameter]]


@dataclass
class _Draft:
    """The numbers found so far, by place: ``numbers`` as (slot, factor, component), ``types`` as (slot, type)."""

    layout: Layout
    names: list[str] = field(default_factory=list)
    numbers: dict[int, tuple[int, type[Factor], int]] = field(default_factory=dict)
    types: dict[int, tuple[int, type[Entity]]] = field(default_factory=dict)
    parameters: dict[int, type[Parameter]] = field(default_factory=dict)

    def add_factor(self, slot: int, factor: type[Factor]) -> None:
        for component in range(factor.width):
            self.numbers[len(self.names)] = slot, factor, component
            suffix = f".{'xy'[component]}" if factor.width == 2 else ""
            self.names.append(f"{self._slot_name(slot)}.{factor.__name__}{suffix}")

    def add_type(self, slot: int, kind: type[Entity]) -> None:
        self.types[len(self.names)] = slot, kind
        self.names.append(f"{self._slot_name(slot)}.is_{kind.__name__}")

    def _slot_name(self, slot: int) -> str:
        return self.layout.slots[slot].name if slot != EMPTY else "empty"


def lay_out(options: StateOptions, layout: Layout) -> Places:
    """The places of a state observation on a layout; raises :class:`LevelError` for what is not there."""
    chosen = _chosen_slots(options, layout)
    draft = _Draft(layout)
    rows = (_lay_out_table if options.form == "table" else _lay_out_vector)(options, draft, chosen)
    for parameter in _chosen_parameters(options, layout):
        draft.parameters[len(draft.names)] = parameter
        draft.names.append(f"world.{parameter.__name__}")
    if not draft.names:
        raise LevelError("StateVector: nothing is left to show; give it other entities, factors or hidden factors")
    _require_scaled(options, draft)
    seen = _seen(layout, chosen)
    return _places(options, draft, rows, seen)


def _lay_out_vector(options: StateOptions, draft: _Draft, chosen: dict[int, tuple[type[Entity], ...]]) -> int:
    """Each slot has the numbers of the factors that its types declare. Returns the number of rows, 1."""
    factors = _chosen_factors(options, draft.layout)
    for factor in options.chosen_factors or ():
        if not any(issubclass(f, factor) for kinds in chosen.values() for t in kinds for f in t.declared):
            raise LevelError(_without(factor, draft.layout, list(chosen)))
    for index, kinds in chosen.items():
        for factor in factors:
            if any(factor in t.declared for t in kinds):
                draft.add_factor(index, factor)
        if options.types or (options.types is None and _is_open(draft.layout.slots[index])):
            for kind in kinds:
                draft.add_type(index, kind)
    return 1


def _without(factor: type[Factor], layout: Layout, chosen: list[int]) -> str:
    """What to say of a chosen factor that none of the chosen slots has, and how it can be shown."""
    names = layout.names
    having = [
        k for k, slot in enumerate(layout.slots) if any(issubclass(f, factor) for t in slot.types for f in t.declared)
    ]
    entities = ", ".join(names[k] for k in sorted({*chosen, *having}))
    shown = f", show what has it with entities=[{entities}]" if having else ""
    return (
        f"StateVector: none of the entities shown, {', '.join(names[k] for k in chosen)}, has a factor '{factor.__name__}';"
        f" leave it out{shown}, or take form='table', where it is missing"
    )


def _lay_out_table(options: StateOptions, draft: _Draft, chosen: dict[int, tuple[type[Entity], ...]]) -> int:
    """All slots have the same columns. Returns the number of rows."""
    layout, rows = draft.layout, options.slots or len(chosen)
    if len(chosen) > rows:
        names = ", ".join(layout.slots[k].name for k in chosen)
        raise LevelError(f"StateVector: {len(chosen)} entities do not fit into slots={rows}: {names}")
    factors = _chosen_factors(options, layout)
    if options.factors is None:
        factors = [f for f in factors if any(f in t.declared for kinds in chosen.values() for t in kinds)]
    kinds = tuple(dict.fromkeys(t for types in chosen.values() for t in types))
    if not (options.types or (options.types is None and any(_is_open(layout.slots[k]) for k in chosen))):
        kinds = ()
    for index in [*chosen, *[EMPTY] * (rows - len(chosen))]:
        for factor in factors:
            draft.add_factor(index, factor)
        for kind in kinds:
            draft.add_type(index, kind)
    return rows


def _places(options: StateOptions, draft: _Draft, rows: int, seen: np.ndarray | None) -> Places:
    layout, length = draft.layout, len(draft.names)
    needs = -1 if options.sees_invisible else layout.columns.get(Visible, -1)
    width = length // rows
    place_of, mask_of, names = np.arange(length), np.arange(length), draft.names
    shape: tuple[int, ...] = (rows, width)
    if options.mask == "numbers":
        place_of = place_of + place_of // width * width
        mask_of, shape = place_of + width, (rows, 2 * width)
        masks = [f"{name}.mask" for name in names]
        names = [n for r in range(rows) for part in (names, masks) for n in part[r * width : (r + 1) * width]]
    reads = []
    for at, (slot, factor, component) in draft.numbers.items():
        here = slot != EMPTY and factor in layout.columns
        column = layout.columns[factor] + component if here else 0
        reads.append((slot if here else EMPTY, column, place_of[at], needs if here else -1, mask_of[at]))
    type_reads = [
        (place_of[at], slot, layout.types.index(kind), mask_of[at]) for at, (slot, kind) in draft.types.items()
    ]
    parameter_reads = [(place_of[at], layout.parameters.index(p), mask_of[at]) for at, p in draft.parameters.items()]
    if seen is None and any(read[0] == EMPTY for read in reads):
        seen = np.ones((len(layout.slots), len(layout.types) + 1), np.bool_)
    return Places(
        shape if options.form == "table" else shape[1:],
        names,
        np.array(reads, np.int64).reshape(-1, 5),
        np.array(type_reads, np.int64).reshape(-1, 4),
        np.array(parameter_reads, np.int64).reshape(-1, 3),
        seen,
        [(factor, component) for _, factor, component in draft.numbers.values()],
        list(draft.parameters.values()),
    )


def _require_scaled(options: StateOptions, draft: _Draft) -> None:
    """Raise :class:`LevelError` where ``scale`` names something of which no number is shown."""
    shown = {*(factor for _, factor, _ in draft.numbers.values()), *draft.parameters.values()}
    for scaled in options.scales:
        if not any(issubclass(factor, scaled) for factor in shown):
            names = [factor.__name__ for factor in shown]
            raise LevelError(
                f"StateVector: scale: no {scaled.__name__} is shown.{did_you_mean(scaled.__name__, names)}"
            )


def _chosen_slots(options: StateOptions, layout: Layout) -> dict[int, tuple[type[Entity], ...]]:
    """The slots that are shown, in order, with those of their types that are."""
    if options.entities is None:  # all but abstract entities such as the floor
        return {k: slot.types for k, slot in enumerate(layout.slots) if slot.may_have(Position)}
    chosen: dict[int, tuple[type[Entity], ...]] = {}
    for wanted in options.entities:
        for index in _slots_of(wanted, layout, padded=options.slots is not None):
            kinds = layout.slots[index].types
            if isinstance(wanted, type):
                kinds = tuple(t for t in kinds if issubclass(t, wanted))
            elif wanted not in layout.names:
                kinds = tuple(t for t in kinds if wanted in _names_of(t))
            chosen[index] = tuple(dict.fromkeys((*chosen.get(index, ()), *kinds)))
    return chosen


def _slots_of(wanted: str | type[Entity], layout: Layout, padded: bool) -> list[int]:
    """The slots that an entity type, its name or the name of a slot stands for."""
    if isinstance(wanted, str):
        if wanted in layout.names:
            return [layout.names.index(wanted)]
        known = {name for t in layout.types for name in _names_of(t)}
        found = [k for k, slot in enumerate(layout.slots) if any(wanted in _names_of(t) for t in slot.types)]
        if not found:
            raise LevelError(
                f"StateVector: no entity is called '{wanted}'.{did_you_mean(wanted, {*layout.names, *known})}"
            )
        return found
    if not (isinstance(wanted, type) and issubclass(wanted, Entity)):
        raise LevelError(f"StateVector: entities are names or entity types, not {wanted!r}")
    found = [k for k, slot in enumerate(layout.slots) if any(issubclass(t, wanted) for t in slot.types)]
    if not found and not padded:  # a table of so many slots has room for what some distributions lack
        raise LevelError(
            f"StateVector: none of these levels' entities, {', '.join(layout.names)}, can be a {wanted.__name__}"
        )
    return found


def _names_of(entity: type[Entity]) -> set[str]:
    """Names of the classes of things that an entity type is."""
    return {t.__name__ for t in entity.__mro__ if issubclass(t, Entity)}


def _chosen_factors(options: StateOptions, layout: Layout) -> list[type[Factor]]:
    """The factors that are shown, in order; a chosen one that no entity has stands for itself."""
    found = dict.fromkeys(layout.factors if options.chosen_factors is None else ())
    for factor in options.chosen_factors or ():
        found |= dict.fromkeys([f for f in layout.factors if issubclass(f, factor)] or [factor])
    return [f for f in found if options.has_number_of(f)]


def _chosen_parameters(options: StateOptions, layout: Layout) -> list[type[Parameter]]:
    """The world parameters that are shown, in order; raises :class:`LevelError` for one that the levels do not have."""
    found: dict[type[Parameter], None] = {}
    for parameter in options.chosen_parameters:
        known = [p for p in layout.parameters if issubclass(p, parameter)]
        if not known:
            near = did_you_mean(parameter.__name__, [p.__name__ for p in layout.parameters])
            raise LevelError(
                f"StateVector: these levels have no world parameter {parameter.__name__}; give it in the distribution's"
                f" 'parameters'.{near}"
            )
        found |= dict.fromkeys(known)
    return [p for p in found if options.has_number_of(p)]


def _seen(layout: Layout, chosen: dict[int, tuple[type[Entity], ...]]) -> np.ndarray | None:
    """Which types are shown; see :class:`Places`."""
    if all(set(kinds) == set(layout.slots[k].types) for k, kinds in chosen.items()):
        return None
    seen = np.zeros((len(layout.slots), len(layout.types) + 1), np.bool_)
    for index, kinds in chosen.items():
        seen[index, [layout.types.index(kind) for kind in kinds]] = True
    return seen


def _is_open(slot: Slot) -> bool:
    """Whether the level decides what the slot holds."""
    return slot.optional or len(slot.types) > 1


NO_SPREAD = 1e-9  # standard deviation over mean below which a factor is constant but for rounding


def shift_and_scale(
    options: StateOptions, places: Places, levels: Levels
) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
    """What to subtract from each of ``places.reads`` and then of ``places.parameter_reads``, and what to multiply by then;
    float64 ``[k + p]`` both, or None where numbers are shown as they are.

    Raises:
        LevelError: numbers shall be normalised, and the levels know no distribution.
    """
    if not (options.normalise or options.scales):
        return None, None
    known_by = levels if options.measured_on is None else options.measured_on
    moments = source_moments(known_by) if options.normalise else {}
    if options.normalise and not moments:
        raise LevelError(
            "StateVector(normalise=True) measures by the prior, and these levels know none: they were made by hand, or saved"
            " by an earlier version. Sample them from a LevelDistribution, or leave normalise out"
        )
    types = {slot.name: slot.types for layout in (levels.layout, known_by.layout) for slot in layout.slots}
    owners = [types[levels.layout.slots[slot].name] if slot != EMPTY else () for slot in places.reads[:, 0]]
    of_entities = [(*read, kinds) for read, kinds in zip(places.read_factors, owners, strict=True)]
    numbers = [*of_entities, *((parameter, 0, (Parameter,)) for parameter in places.parameters)]
    shift, scale = np.zeros(len(numbers)), np.ones(len(numbers))
    for k, (factor, component, kinds) in enumerate(numbers):
        constant = options.scale_of(factor)
        known = [moments[kind, factor] for kind in kinds if (kind, factor) in moments]
        if constant is not None:
            scale[k] = 1.0 / constant
        elif known and not issubclass(factor, Size):
            mean, spread = _mean_and_spread(known)
            shift[k], scale[k] = mean[component], 1.0 / spread
    return shift, scale


def _mean_and_spread(known: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, float]:
    """Mean of each component, and the one spread, of a mixture of distributions with these means and variances; a spread of 1
    where the mixture is constant."""
    means, variances = (np.stack(values) for values in zip(*known, strict=True))
    mean, variance = means.mean(axis=0), variances.mean(axis=0) + means.var(axis=0)
    spread = float(np.sqrt(variance.mean()))
    return mean, spread if spread > NO_SPREAD * max(float(np.abs(means).max()), NO_SPREAD) else 1.0
