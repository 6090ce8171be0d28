"""On a terminal there are bars, elsewhere a line for each piece of work that ends."""

import io

from rich.console import Console

from experiments.reproduction.display import Display, progress_in
from experiments.reproduction.process_pool import Job, JobResult
from experiments.training.progress import Progress


def display_of(folder, terminal, **weights):
    jobs = {name: Job(name, None, folder / f"{name}.log") for name in weights}
    stream = io.StringIO()
    console = Console(file=stream, force_terminal=terminal, width=100)
    return Display(jobs, weights, lambda outcome: f"{outcome.job.name}: done", console), stream


def test_elsewhere_there_is_one_plain_line_per_ending(tmp_path):
    display, stream = display_of(tmp_path, False, a=1.0, b=3.0)
    with display.shown():
        display.end(JobResult(display.jobs["a"], 1.0, None))
        assert display.share_left() == 0.75
        display.end(JobResult(display.jobs["b"], 1.0, None))
    assert stream.getvalue() == "[1/2] a: done\n[2/2] b: done\n"


def test_a_terminal_shows_bars_of_all_work_and_of_what_runs(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.reproduction.display.LOOK_INTERVAL", 0.01)
    display, stream = display_of(tmp_path, True, first=1.0, second=1.0)
    (tmp_path / "first.log").write_text("first: 512 of 2,048 frames, 900 frames/s\n")
    with display.shown():
        while "first" not in display._own:
            pass
        display.end(JobResult(display.jobs["first"], 1.0, None))
        assert "first" not in display._own
    assert "all" in stream.getvalue() and "first: done" in stream.getvalue()


def test_frames_are_read_from_what_a_run_says(tmp_path, monkeypatch):
    monkeypatch.setattr("experiments.training.progress.LINE_INTERVAL", -1.0)
    log = tmp_path / "run.log"
    assert progress_in(log) == (0, 0, False)
    with log.open("w") as stream:
        progress = Progress("label", 20_000, 0, shown=True, stream=stream)
        for frames in (1_000, 12_345):
            progress.update(frames, {"episode/return": -1.0})
    assert progress_in(log) == (12_345, 20_000, False)
    with log.open("a") as stream:
        stream.write("label: probes\n")
    assert progress_in(log) == (12_345, 20_000, True)
