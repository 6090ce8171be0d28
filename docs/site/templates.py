"""Draws docs/images/templates.png, a picture of each template of rules: ``python docs/site/templates.py``.

Each panel shows bodies that start from the circles, with the template (blue) and without it (grey), for two seconds.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from segar.engine import Simulator, State
from segar.language import (
    Ball,
    Charge,
    Entity,
    GoalTile,
    GolfBall,
    Mass,
    Mobile,
    Position,
    SandTile,
    Shape,
    Size,
    Square,
    Velocity,
    Visible,
)
from segar.levels import Levels
from segar.noise import Deterministic
from segar.rules import RuleOption, RuleSpace, World, accelerate, move
from segar.rules import templates as t
from segar.rules.templates.dynamics import free_motion

OUTPUT = Path(__file__).resolve().parents[1] / "images" / "templates.png"
SUB_STEPS = 200
WITH, WITHOUT, GROUND = "#0072B2", "#999999", "#E6C89C"


def ball(x: float, y: float, vx: float = 0.0, vy: float = 0.0, charge: float = 1.0, mobile: bool = True) -> Entity:
    """A small ball."""
    values = {Position: [x, y], Velocity: [vx, vy], Charge: charge, Mobile: mobile, Size: 0.12}
    return Ball(values)


RING = [ball(0.5 * np.cos(a), 0.5 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 5)[:-1] + 0.4]
RUNNERS = [ball(-0.8, y, 0.6, 0.0) for y in (-0.5, 0.0, 0.5)]
PAIR = [ball(-0.35, 0.1), ball(0.35, -0.1)]
HIT = [ball(-0.6, 0.03, 0.8, 0.0, 1.0), ball(0.1, 0.0, 0.0, 0.0, 0.2)]
GOAL = GoalTile({Position: [0.5, 0.4]})
SAND = SandTile({Position: [0.0, 0.0], Shape: Square(0.5), Size: 0.5})

PANELS: Sequence[tuple[RuleOption, list[Entity]]] = [
    (t.central_force("central_force", strength=0.2), PAIR),
    (t.central_force("central_force_attracts", strength=-0.2), PAIR),
    (t.pair_spring("pair_spring", stiffness=2.0, length=0.4), PAIR),
    (t.anchor_spring("anchor_spring", stiffness=1.0, x=0.2, y=0.2), RING),
    (t.drag("drag", 1, coefficient=1.5), RUNNERS),
    (t.uniform_field("uniform_field", x=0.0, y=-0.3), RUNNERS),
    (t.rotating_field("rotating_field", Mass, strength=0.6), RING),
    (t.magnetic_field("magnetic_field", Charge, strength=1.2), RUNNERS),
    (t.portal("portal", x=0.0, y=0.0, to_x=0.4, to_y=-0.7, radius=0.12), RUNNERS),
    (t.one_way_wall("one_way_wall", 0, at=0.1, forward=-1.0), RUNNERS),
    (t.switch("switch", SandTile, Charge, value=-1.0), [*RUNNERS, SAND]),
    (t.growth("growth", Charge, rate=-0.7), RUNNERS),
    (t.contagion("contagion", Charge), HIT),
    (t.sharing("sharing", Charge), HIT),
    (t.unlocking("unlocking"), [ball(-0.6, 0.03, 0.8), ball(0.1, 0.0, 0.0, 0.4, mobile=False)]),
    (t.drifting("drifting", GoalTile, speed=0.4), [GOAL]),
    (t.hiding("hiding", GoalTile), [GOAL]),
]


def path(option: RuleOption, things: Sequence[Entity], active: bool) -> tuple[Levels, np.ndarray]:
    """Values of the entities after each sub-step, float64 ``(SUB_STEPS + 1, entities, columns)``."""
    world = World(RuleSpace([option], 1, always=(free_motion, move, accelerate)))
    far = [GolfBall({Position: [-0.97, -0.97], Size: 0.01, Mobile: False, Charge: 0.0})]
    far += [] if any(isinstance(one, GoalTile) for one in things) else [GoalTile({Position: [0.97, 0.97], Size: 0.01})]
    constants = {p: law.mean for p, law in option.constants.items() if isinstance(law, Deterministic)}
    levels = Levels.from_entities([[*things, *far]], {option.active: float(active), **constants}, world=world)
    simulator, state = Simulator(world, levels.layout), State.empty(1, levels.layout)
    state.values[:] = levels.values
    seen = [state.values[0].copy()]
    for _ in range(SUB_STEPS):
        simulator.step(state, levels, 1)
        seen.append(state.values[0].copy())
    return levels, np.stack(seen)


def draw(axes: Axes, option: RuleOption, things: Sequence[Entity]) -> None:
    """One panel."""
    for active, colour in ((False, WITHOUT), (True, WITH)):
        levels, seen = path(option, things, active)
        column: Callable[[type], int] = levels.layout.columns.__getitem__
        for k, thing in enumerate(things):
            x, y = seen[:, k, column(Position)], seen[:, k, column(Position) + 1]
            if isinstance(thing, SandTile):
                axes.add_patch(plt.Rectangle((x[0] - 0.25, y[0] - 0.25), 0.5, 0.5, color=GROUND, zorder=0))
                continue
            jump = np.hypot(np.diff(x, append=x[-1]), np.diff(y, append=y[-1])) > 0.1
            axes.plot(np.where(jump, np.nan, x), y, color=colour, linewidth=1.6 if active else 1.0, zorder=1 + active)
            if active:
                is_seen = isinstance(thing, Ball) or seen[-1, k, column(Visible)] > 0
                end = {"color": WITH if is_seen else "none", "edgecolor": WITH, "linestyle": "-" if is_seen else ":"}
                axes.scatter(x[-1], y[-1], s=46 if isinstance(thing, Ball) else 160, zorder=3, linewidth=1.2, **end)
                axes.scatter(x[0], y[0], s=24, facecolor="white", edgecolor="black", linewidth=0.8, zorder=3)
                if isinstance(thing, Ball) and seen[0, k, column(Charge)] != seen[-1, k, column(Charge)]:
                    start, end_charge = (seen[n, k, column(Charge)] for n in (0, -1))
                    axes.annotate(f"{start:.2g} → {end_charge:.2g}", (x[-1], y[-1]), (0, 7), textcoords="offset points",
                                  ha="center", fontsize=8)  # fmt: skip
    axes.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal", xticks=[], yticks=[])
    axes.set_title(option.name.replace("_attracts", " that attracts"), fontsize=9.5)


def main() -> None:
    """Draw all panels."""
    figure, axes = plt.subplots(3, 6, figsize=(12.4, 6.8), layout="constrained")
    for one, (option, things) in zip(axes.flat, PANELS, strict=False):
        draw(one, option, things)
    for one in axes.flat[len(PANELS) :]:
        one.axis("off")
    figure.savefig(OUTPUT, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
