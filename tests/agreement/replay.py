"""Replay of the trajectories that were recorded from the 2022 simulator; the schema stands beside the recordings."""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from segar import Acceleration, Action, Charge, Factor, Friction, Magnetism, Mass, Mobile, Position, Velocity, World
from segar.engine.simulator import Simulator, State
from segar.language import CIRCLE, HULL, Differential, Entity, GlobalFriction, Hole, Layout, Object, Slot, Task, Tile
from segar.language.factors import Alive, Done, Heat, InfiniteEnergy, Order, Size, StoredEnergy, Visible
from segar.levels import Levels, Provenance
from tests.places import ROOT
from tests.segar.engine.worlds import compiled

TOLERANCE = 1e-6
ROOM = 15  # things of the largest recorded scene, the floor apart
EXTRA = 20  # sub-steps that a recording which ends in an exception is continued for
GOAL_DISTANCE = 0.01  # share of the diagonal
POCKET_DISTANCE = 1e-4  # share of the diagonal at which billiards' reward takes a ball off the table

RECORDED: dict[str, type[Factor]] = {
    "pos": Position,
    "vel": Velocity,
    "acc": Acceleration,
    "mass": Mass,
    "stored_energy": StoredEnergy,
    "alive": Alive,
    "done": Done,
    "visible": Visible,
    "mobile": Mobile,
}
STATIC = (Order, Size, Charge, Magnetism, InfiniteEnergy, Friction, Heat)
# Powers of length in each unit: an arena of another size is replayed as a similar one of ours.


def folder() -> Path:
    """Where the recordings lie: ``$SEGAR_REFERENCE_DIR``, else the copy beside the tests."""
    beside = ROOT / "tests" / "data" / "reference"
    return Path(os.environ.get("SEGAR_REFERENCE_DIR", beside))


@dataclass(frozen=True)
class Recording:
    """One trajectory: what its metadata say, and its arrays by their names in the schema."""

    meta: dict[str, Any]
    arrays: dict[str, np.ndarray]

    @property
    def length(self) -> int:
        return int(self.meta["n_substeps"])

    @property
    def slots(self) -> list[int]:
        """Place of each slot's entity in the recording: sorted by order, as the 2022 rules went through them."""
        return [self.meta["ids"].index(name) for name in self.meta["sorted_ids"]]

    @property
    def walls(self) -> float:
        """Distance of the walls from the middle of the arena [m]."""
        low, high = map(float, self.meta["boundaries"])
        assert low == -high, f"{self.meta['name']}: an arena from {low} to {high} is not around its middle"
        return high

    def slot_of(self, name: Any) -> int:
        return self.meta["sorted_ids"].index(name)


def recordings(path: Path) -> list[Recording]:
    """All trajectories of a file."""
    with np.load(path) as data:
        metas = json.loads(bytes(data["meta_json"]).decode())
        return [Recording(m, {n[4:]: data[n] for n in data.files if n.startswith(f"{m['index']:03d}_")}) for m in metas]


TYPES: tuple[type[Entity], ...] = (Object, Tile, Hole)
# One layout with room for all scenes, so that one kernel replays them all.
LAYOUT = Layout((*(Slot(f"thing{n}", TYPES, optional=True) for n in range(ROOM)), Slot("floor", (GlobalFriction,))))


def levels_of(many: list[Recording]) -> Levels:
    """The initial states as levels.

    Raises:
        ValueError: a scene has more things than there is room for.
    """
    if max(len(r.slots) for r in many) > ROOM + 1:
        raise ValueError(f"a recorded scene has more than {ROOM} things: make ROOM larger")
    n, slots = len(many), len(LAYOUT.slots)
    types = np.full((n, slots), -1, np.int16)
    values = np.full((n, slots, LAYOUT.width), np.nan)
    kind, count = np.zeros((n, slots), np.int8), np.zeros((n, slots), np.int16)
    vertices = np.zeros((n, slots, 64, 2))
    parameters = np.empty((n, len(LAYOUT.parameters)))
    for e, recording in enumerate(many):
        parameters[e] = _parameters(recording)
        types[e, -1] = LAYOUT.types.index(GlobalFriction)
        values[e, -1, LAYOUT.columns[Friction]] = recording.meta["parameters"]["Friction"]
        for slot, place in enumerate(recording.slots):
            entity = recording.meta["entities"][place]
            if entity["kind"] == "entity":
                continue
            types[e, slot] = LAYOUT.types.index(_type_of(entity))
            values[e, slot] = _row(recording, place, entity)
            shape = entity["factors"]["Shape"]
            # Bodies that are hulls met walls with their extent, and each other not at all: they are replayed as discs.
            kind[e, slot] = CIRCLE if shape["kind"] == "Circle" or entity["kind"] == "object" else HULL
            if kind[e, slot] == HULL:
                corners = np.array(shape["vertices"])
                count[e, slot] = len(corners)
                vertices[e, slot, : len(corners)] = corners
    made = Provenance("recorded in 2022", "", "", 0, "", np.arange(n))
    return Levels(LAYOUT, types, values, kind, count, vertices, parameters, values.copy(), made)


def _type_of(entity: dict[str, Any]) -> type[Entity]:
    if entity["kind"] == "object":
        return Object
    # A hull-shaped hole never consumed, since its area was taken for a truth value.
    swallows = "Consumes" in entity["factors"] and entity["factors"]["Shape"]["kind"] == "Circle"
    return Hole if swallows else Tile


def _row(recording: Recording, place: int, entity: dict[str, Any]) -> np.ndarray:
    row = np.full(LAYOUT.width, np.nan)
    kind = _type_of(entity)
    for factor, column in LAYOUT.columns.items():
        if factor not in kind.declared:
            continue
        name = next((n for n, f in RECORDED.items() if f is factor), None)
        if name is not None:
            value: Any = recording.arrays[name][0, place]
        elif factor in STATIC:
            value = entity["factors"][factor.__name__]
        else:
            value = kind.declared[factor]
        row[column : column + factor.width] = np.asarray(value, float)
    return row


def _parameters(recording: Recording) -> list[float]:
    given = recording.meta["parameters"]
    named = {**given, "FloorFriction": given["Friction"], "Framerate": 1.0 / given["Time"]}
    return [named[p.__name__] for p in LAYOUT.parameters]


def _task() -> Task:
    """A task that is never used: the replay pushes by itself, since recorded pushes are float64."""

    def push(body: Object, action: Action) -> Differential[Velocity]:
        return Differential[Velocity](body[Velocity], action[0])

    return Task("replay", push, action_low=(0.0,), action_high=(1.0,))


CHAOTIC = {"Billiards": 200}  # sub-steps after which many-body chaos has amplified rounding errors
FIRST = 150  # sub-steps over which every trajectory must agree


@dataclass
class Verdict:
    """How one trajectory fared.

    Attributes:
        agrees: sub-steps for which all recorded quantities agree.
        first: what diverged first, and how far; empty where nothing did.
        finite: whether the state stayed finite to the end, beyond a crash of 2022 included.
    """

    recording: Recording
    agrees: int
    first: str = ""
    finite: bool = True

    @property
    def whole(self) -> bool:
        """Whether all quantities agree over the whole length, or over what chaos leaves of it."""
        return self.agrees >= self.counted

    @property
    def counted(self) -> int:
        """The whole length, or what chaos leaves of it."""
        return min(self.recording.length, CHAOTIC.get(self.recording.meta["task"], self.recording.length))

    @property
    def required(self) -> int:
        """Sub-steps over which the trajectory must agree."""
        return min(self.recording.length, FIRST)

    def __str__(self) -> str:
        name = f"{self.recording.meta['name']} ({self.recording.meta['index']})"
        return f"{name}: {self.agrees} of {self.recording.length} sub-steps; {self.first or 'agrees'}"


def replay(path: Path, world_in: Callable[[float], World]) -> list[Verdict]:
    """How the trajectories of a file fared, in their order; ``world_in`` makes the world for the distance of the walls."""
    many = recordings(path)
    arenas = {walls: [r for r in many if r.walls == walls] for walls in {r.walls for r in many}}
    verdicts = [v for walls, inside in arenas.items() for v in Replay(world_in(walls), inside).run()]
    return sorted(verdicts, key=lambda v: v.recording.meta["index"])


@dataclass
class Replay:
    """Trajectories in one world, replayed side by side in one batch."""

    world: World
    many: list[Recording]
    verdicts: list[Verdict] = field(default_factory=list)

    def run(self) -> list[Verdict]:
        many = self.many
        levels = levels_of(many)
        simulator = (compiled if len(many) > 1 else Simulator)(self.world, LAYOUT, _task())
        state = State.empty(len(many), LAYOUT)
        state.level[:] = np.arange(len(many))
        state.values[:] = levels.values
        self.verdicts = [Verdict(r, r.length) for r in many]
        self._compare(state, 0)
        for step in range(1, max(r.length for r in many) + EXTRA + 1):
            if (step - 1) % 5 == 0:
                for e, recording in enumerate(many):
                    push(recording, state.values[e], (step - 1) // recording.meta["sub_steps"])
            before = state.values.copy()
            simulator.step(state, levels)
            for e, recording in enumerate(many):
                said = judge(recording, before[e], state.values[e])
                self._compare_task(e, step, said)
            self._compare(state, step)
        known = ~np.isnan(levels.values)
        for e, verdict in enumerate(self.verdicts):
            verdict.finite = bool(np.isfinite(state.values[e][known[e]]).all())
        return self.verdicts

    def _compare(self, state: State, step: int) -> None:
        for e, verdict in enumerate(self.verdicts):
            recording = verdict.recording
            if step > recording.length or verdict.agrees < step:
                continue
            for name, factor in RECORDED.items():
                column = LAYOUT.columns[factor]
                ours = state.values[e, : len(recording.slots), column : column + factor.width]
                theirs = recording.arrays[name][step][recording.slots].astype(float).reshape(ours.shape)
                has = ~np.isnan(ours)
                apart = np.abs(ours - theirs)[has].max(initial=0.0)
                if not apart <= TOLERANCE:
                    self._diverge(e, step, f"{name} by {apart:.1e}")

    def _compare_task(self, e: int, step: int, said: tuple[float, bool] | None) -> None:
        recording = self.verdicts[e].recording
        if said is None or step > recording.length or self.verdicts[e].agrees < step:
            return
        reward, done = recording.arrays["reward_sub"][step - 1], bool(recording.arrays["done_sub"][step - 1])
        if not abs(said[0] - reward) <= TOLERANCE:
            self._diverge(e, step, f"reward by {abs(said[0] - reward):.1e}")
        if said[1] != done:
            self._diverge(e, step, f"done is {said[1]}")

    def _diverge(self, e: int, step: int, what: str) -> None:
        if self.verdicts[e].agrees >= step:
            self.verdicts[e].agrees = step - 1
            self.verdicts[e].first = f"at sub-step {step}: {what}"


def push(recording: Recording, values: np.ndarray, step: int) -> None:
    """Apply what the recording did before env step ``step``: velocity += impulse / mass."""
    meta = recording.meta
    pushes = list(_pushes(recording, step))
    for name, impulse in pushes:
        row = values[recording.slot_of(name)]
        mass, v = row[LAYOUT.columns[Mass]], LAYOUT.columns[Velocity]
        if mass != 0:
            row[v : v + 2] += np.asarray(impulse, float) / mass
        if meta["task"] == "Invisiball":
            row[LAYOUT.columns[Visible]] = 0.0


def _pushes(recording: Recording, step: int) -> Iterator[tuple[Any, Any]]:
    if recording.meta["actor"] is not None:
        if step < len(recording.arrays["actions"]):
            yield recording.meta["actor"], recording.arrays["actions"][step]
    else:
        yield from recording.meta["pushes"].get(str(step), ())


def judge(recording: Recording, before: np.ndarray, after: np.ndarray) -> tuple[float, bool] | None:
    """Reward and done as 2022 said them: flags from before the sub-step, distances from after it."""
    task = recording.meta["task"]
    if task is None:
        return None
    diagonal = recording.meta["scaling_factor"]
    x, alive, done = (LAYOUT.columns[f] for f in (Position, Alive, Done))
    actor = recording.slot_of(recording.meta["actor"])
    dead, over = not before[actor, alive], bool(before[actor, done])
    if task != "Billiards":
        goal = after[recording.slot_of("goal"), x : x + 2]
        d = float(np.linalg.norm(after[actor, x : x + 2] - goal)) / diagonal
        return -100.0 * dead - d**2, over or dead or d <= GOAL_DISTANCE
    names = recording.meta["sorted_ids"]
    balls = [s for s, n in enumerate(names) if str(n).endswith("_ball")]
    holes = after[[s for s, n in enumerate(names) if str(n).endswith("_hole")], x : x + 2]
    nearest = np.array([np.linalg.norm(holes - after[b, x : x + 2], axis=1).min() for b in balls]) / diagonal
    for ball, d in zip(balls, nearest, strict=True):
        if d <= POCKET_DISTANCE:
            after[ball, [alive, LAYOUT.columns[Visible]]] = 0.0
    finished = all(before[b, done] or not before[b, alive] for b in balls)
    return -100.0 * dead - float((nearest**2).sum()), over or dead or finished
