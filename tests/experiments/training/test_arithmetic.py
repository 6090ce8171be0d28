"""What decides the last bits of a run is recorded, and a run that is resumed with something else says so."""

import json

import pytest
import torch

from segar.experiments.runs.run_folder import VERSIONS, read_versions
from segar.experiments.runs.versions import computed_with
from segar.experiments.settings.processor import BFLOAT16
from segar.experiments.training.run import run
from tests.experiments.short_runs import run_killed, short_run

pytestmark = pytest.mark.processor


def test_a_run_records_what_decided_its_last_bits_and_shows_it(trained_and_said):
    folder, said = trained_and_said
    found = read_versions(folder)
    made = found["arithmetic"]
    assert {*made} == {
        "determinism", "device", "precision", "threads", "instruction_set", "limits", "processor"
    }  # fmt: skip
    assert made["precision"] in ("bf16", "fp32"), "what auto was"
    assert made["instruction_set"] == torch.backends.cpu.get_cpu_capability()
    assert "arithmetic_before" not in found
    assert f"  computed with               {computed_with(found)}" in said[-1].splitlines()


@pytest.mark.parametrize(("differs", "shown"), [({"processor": "Another"}, "Another"), ({"threads": 3}, "3 threads")])
def test_a_run_that_is_resumed_with_something_else_says_so_and_records_both(tmp_path, differs, shown):
    config, said = short_run(tmp_path / "run"), []
    run_killed(config, 2)
    path = tmp_path / "run" / VERSIONS
    versions = json.loads(path.read_text())
    path.write_text(json.dumps({**versions, "arithmetic": {**versions["arithmetic"], **differs}}))
    run_killed(config, 3, said.append)
    told = [line for line in said if ": computed with " in line]
    assert len(told) == 1 and shown in told[0] and "no single machine" in told[0]
    run(config, said.append)
    assert len([line for line in said if ": computed with " in line]) == 1, "nothing changed since"
    assert computed_with(read_versions(tmp_path / "run")).count(", then ") == 1


def test_a_run_goes_on_in_its_precision_where_auto_means_another_and_says_so(tmp_path, monkeypatch):
    config, said = short_run(tmp_path / "run"), []
    monkeypatch.setenv(BFLOAT16, "yes")
    run_killed(config, 2)
    monkeypatch.setenv(BFLOAT16, "no")
    run(config, said.append)
    run(config, said.append)
    told = [line for line in said if "algorithm.precision=auto" in line]
    assert "goes on in bf16" in told[0] and "means fp32 on this machine" in told[0]
    assert "nothing to do (in bf16, which" in told[1] and len(told) == 2
    assert read_versions(tmp_path / "run")["arithmetic"]["precision"] == "bf16"


def test_runs_of_earlier_releases_say_nothing_of_it():
    assert computed_with({"code": "0123456789abcdef"}) == ""


def test_limits_and_portable_are_in_the_words():
    made = {"determinism": "machine", "device": "cpu", "precision": "bf16", "threads": 1, "instruction_set": "AVX512",
            "limits": {"MKL_CBWR": "AVX2"}, "processor": "Xeon"}  # fmt: skip
    assert computed_with({"arithmetic": made}) == "AVX512, bf16, 1 thread, MKL_CBWR=AVX2, Xeon"
    portable = {**made, "determinism": "portable", "precision": "fp32", "instruction_set": "AVX2"}
    assert computed_with({"arithmetic": portable}) == "AVX2, fp32, 1 thread, portable, Xeon"


@pytest.mark.parametrize(
    ("said", "words"),
    [({}, ""), ({"precision": "bf16"}, "bf16"), ({"threads": 2, "processor": "Xeon"}, "2 threads, Xeon")],
)
def test_of_a_run_of_which_little_is_said_the_words_are_what_is_said(said, words):
    assert computed_with({"arithmetic": said}) == words
