"""The order of a step is said once: kernel and interpreter both follow it, also where it is another one."""

import pytest

from segar import Ball, Interpreter, Levels, Mass, World, rule
from segar.engine.compiler import kernel
from segar.language import SUB_STEP, Charge, Differential, GoalTile, GolfBall, Operation, Position, SetFactor, Velocity
from tests.segar.engine.worlds import after


def levels() -> Levels:
    ball = Ball({Position: (0.3, 0.0), Velocity: (1.0, 0.0), Mass: 2.0})
    return Levels.from_entities([[GolfBall({Position: (-0.5, 0.0)}), GoalTile({Position: (0.8, 0.8)}), ball]])


def heavier(m: Mass) -> SetFactor[Mass]:
    return SetFactor[Mass](m, 2 * m)


def faster(v: Velocity, m: Mass) -> SetFactor[Velocity]:
    return SetFactor[Velocity](v, v * m)


def go(x: Position, v: Velocity) -> Differential[Position]:
    return Differential[Position](x, v)


def test_the_interpreter_reports_rules_in_the_order_of_the_stages():
    start = levels()
    fired = Interpreter(World(), start.layout).step(start, explain=True).firings
    names = list(dict.fromkeys(firing.stage for firing in fired))
    assert names == [name for name in dict.fromkeys(stage.name for stage in SUB_STEP) if name in names]


@pytest.mark.parametrize("turned", [False, True])
def test_kernel_and_interpreter_follow_the_declared_order(monkeypatch, turned):
    order = (SUB_STEP[1], SUB_STEP[0], *SUB_STEP[2:]) if turned else SUB_STEP
    monkeypatch.setattr(kernel, "_written", kernel._written.__wrapped__)
    for module in ("engine.compiler.kernel", "language"):
        monkeypatch.setattr(f"segar.{module}.SUB_STEP", order)
    start = levels()
    ends = [after(engine, [heavier, faster, go], start).values for engine in ("source", "interpreter")]
    assert ends[0].tobytes() == ends[1].tobytes()
    column = start.layout.columns[Velocity]
    assert ends[0][0, 2, column] == (2.0 if turned else 4.0)


def test_every_effect_counts_in_one_stage_and_those_of_a_rechecked_rule_in_two():
    @rule(recheck=True)
    def again(m: Mass, q: Charge) -> SetFactor[Charge]:
        return SetFactor[Charge](q, m)

    applying = [stage for stage in SUB_STEP if stage.operation is Operation.APPLY_EFFECTS and stage.name != "limit"]
    for factor, stage in ((Charge, "factors"), (Velocity, "velocity"), (Position, "position")):
        names = [s.name for s in applying if s.counts(rule(heavier), SetFactor, factor)]
        assert names == [stage]
        twice = [s.name for s in applying if s.counts(again, SetFactor, factor)]
        assert twice == (["position"] if factor is Position else ["factors", "velocity"])
