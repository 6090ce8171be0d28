"""The table of ``make bench``: rows with their bars, and parts that can be chosen."""

import sys
from functools import partial

import pytest

from benchmarks import __main__ as bench
from benchmarks.measure import Row, in_turns
from segar.experiments.commands.command_line import run_from_command_line


def table(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> list[str]:
    monkeypatch.setattr(sys, "argv", ["benchmarks", *arguments])
    run_from_command_line(bench.main)
    return capsys.readouterr().out.splitlines()


def test_parts_are_measured_in_the_order_in_which_they_are_asked_for(monkeypatch, capsys):
    lines = table(monkeypatch, capsys, "--repeats", "1", "--only", "pymunk", "resets")
    assert lines[0].startswith("segar ") and "load" in lines[0]
    rows = [line for line in lines if " M/s " in line or " ms " in line][1 - len(lines) :]
    assert [row.split()[0] for row in rows if not row.startswith("M/s")] == ["pymunk,", "reset", "reset"]
    assert all("<= 1" in row for row in rows if row.startswith("reset"))


def test_an_unknown_part_is_refused_with_those_that_exist(monkeypatch, capsys):
    with pytest.raises(SystemExit, match="threads"):
        table(monkeypatch, capsys, "--only", "thread")


@pytest.mark.parametrize(
    ("row", "bar"),
    [
        (Row("fast", [3.0, 5.0, 4.0], "M/s", at_least=4.0), ">= 4"),
        (Row("slow", [3.0, 5.0, 3.9], "M/s", at_least=4.0), ">= 4 !"),
        (Row("short", [25.0], "µs", at_most=25), "<= 25"),
        (Row("long", [26.0], "µs", at_most=25), "<= 25 !"),
        (Row("whatever", [1.0], "s"), ""),
    ],
)
def test_a_row_marks_a_missed_bar(row, bar):
    assert row.bar == bar and str(row).endswith(bar)


def test_contestants_take_turns_and_their_first_turn_does_not_count():
    calls: list[str] = []
    ticks = iter(range(100))
    first, second = ([partial(calls.append, name) for name in names] for names in ("ab", "AB"))
    seconds = in_turns(first, 2, lambda: next(ticks), second)
    assert calls == ["A", "a", "B", "b"] * 3
    assert seconds == [[1, 1], [1, 1]]
