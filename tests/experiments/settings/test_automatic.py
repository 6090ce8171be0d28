"""What ``auto`` means is settled before a run has a name, and the names of earlier runs stay."""

import json

import pytest
import torch

from experiments.commands.hydra_app import compose
from experiments.reproduction.imported_results import names_of
from experiments.runs.run_folder import read_config, use_run_folder
from experiments.settings import ConfigError, label_in_0_1, run
from experiments.settings.processor import multiplies_bf16
from experiments.settings.run import digest

ASKED = ["levels=empty-easy", "algorithm=ppo_fast", "observation=rgb_stack2"]


@pytest.fixture
def on(monkeypatch):
    """Makes this machine one that multiplies bfloat16, or one that does not."""
    return lambda has: monkeypatch.setattr(run, "multiplies_bf16", lambda device: has)


def test_the_processor_is_asked_the_same_with_and_without_torch():
    has = torch.cpu.get_capabilities()
    assert multiplies_bf16("cpu") == bool(has.get("amx_bf16") or has.get("avx512_bf16"))


def test_runs_in_different_precision_have_different_names(on):
    names = {}
    for has in (True, False):
        on(has)
        names[has] = compose(ASKED).label()
        assert names[has] == compose([*ASKED, f"algorithm.precision={'bf16' if has else 'fp32'}"]).label()
    assert names[True] != names[False]


def test_on_machines_like_the_one_of_the_shipped_runs_names_are_what_they_were(on):
    on(True)
    config = compose(ASKED)
    as_before = json.loads(json.dumps(config.identity()))
    as_before["algorithm"]["precision"] = "auto"
    assert config.hash() == digest(as_before)


def test_results_of_other_machines_and_of_0_1_are_found_wherever_one_asks_for_auto(on):
    found = []
    for has in (True, False):
        on(has)
        config = compose(ASKED)
        assert names_of(config)[0] == config.label()
        found.append({*names_of(config)})
    assert found[0] == found[1] and len(found[0]) == 3
    on(True)
    asked = compose([*ASKED, "algorithm.precision=fp32"])
    assert names_of(asked) == [asked.label(), label_in_0_1(asked)]


@pytest.mark.parametrize("has", [True, False])
def test_the_run_folder_says_what_auto_was(on, has, tmp_path):
    on(has)
    with use_run_folder(compose([*ASKED, f"root={tmp_path}"])) as folder:
        on(not has)
        assert read_config(folder).algorithm.precision == ("bf16" if has else "fp32")


def test_portable_is_another_run_in_float32(on):
    on(True)
    portable, plain = compose([*ASKED, "determinism=portable"]), compose([*ASKED, "algorithm.precision=fp32"])
    assert portable.resolved().algorithm.precision == "fp32"
    assert portable.label() != plain.label()
    assert "determinism" not in plain.identity() and portable.identity()["determinism"] == "portable"


@pytest.mark.parametrize("override", ["precision=bf16", "device=cuda", "compile=true"])
def test_what_portable_cannot_hold_to_is_refused(override):
    name, _, value = override.partition("=")
    with pytest.raises(ConfigError, match=rf"algorithm.{name}: .*because determinism=portable allows nothing else"):
        compose([*ASKED, "determinism=portable", f"algorithm.{name}={value}"])


def test_portable_refuses_the_lstm():
    with pytest.raises(ConfigError, match=r"algorithm.core: 'lstm' is not allowed; it must be gru, because"):
        compose(["algorithm=ppo_recurrent", "algorithm.core=lstm", "determinism=portable"])
