"""A run's name is the same on every processor; the run folder says what ``algorithm.precision=auto`` was there."""

import json

import pytest
import torch

from segar.experiments.commands.hydra_app import compose
from segar.experiments.runs.run_folder import use_run_folder
from segar.experiments.settings import ConfigError, RunFolderError
from segar.experiments.settings.processor import BFLOAT16, multiplies_bf16
from tests.synthetic_runs import MADE_WITH

pytestmark = pytest.mark.processor
ASKED = ["levels=empty-easy", "algorithm=ppo_fast", "observation=rgb_stack2"]


@pytest.fixture
def on(monkeypatch):
    """Makes this machine one that multiplies bfloat16, or one that does not."""
    return lambda has: monkeypatch.setenv(BFLOAT16, "yes" if has else "no")


@pytest.fixture
def begun_in_bf16(on, tmp_path):
    """The settings and the folder of a run that says auto, and was begun where auto is bfloat16."""
    config = compose([*ASKED, f"root={tmp_path}"])
    with use_run_folder(config) as folder:
        (folder / "versions.json").write_text(json.dumps({**MADE_WITH, "arithmetic": {"precision": "bf16"}}))
    on(False)
    return config, folder


def test_the_processor_is_asked_the_same_with_and_without_torch(monkeypatch):
    monkeypatch.delenv(BFLOAT16, raising=False)
    has = torch.cpu.get_capabilities()
    assert multiplies_bf16("cpu") == bool(has.get("amx_bf16") or has.get("avx512_bf16"))


def test_an_answer_about_the_processor_that_is_neither_yes_nor_no_is_refused(monkeypatch):
    monkeypatch.setenv(BFLOAT16, "1")
    with pytest.raises(ConfigError, match="SEGAR_BFLOAT16: '1' is neither yes nor no"):
        multiplies_bf16("cpu")


@pytest.mark.parametrize("has", [True, False])
def test_names_are_those_of_the_shipped_runs_on_every_machine(on, has):
    on(has)
    assert compose(ASKED).label() == "empty-easy-n10-rgb_stack2-ppo_fast-s0-625c934a"
    assert compose([*ASKED, "algorithm.precision=fp32"]).label() != compose(ASKED).label()


@pytest.mark.parametrize("has", [True, False])
def test_auto_is_bfloat16_where_the_processor_multiplies_it(on, has):
    on(has)
    assert compose(ASKED).computed_here().algorithm.precision == ("bf16" if has else "fp32")
    assert compose([*ASKED, "determinism=portable"]).computed_here().algorithm.precision == "fp32"


def test_a_folder_of_another_precision_than_the_one_that_is_set_is_refused(begun_in_bf16):
    config, folder = begun_in_bf16
    for precision in ("auto", "bf16"):
        with use_run_folder(config.with_precision(precision)) as found:
            assert found == folder
    (folder / "versions.json").write_text(json.dumps({**MADE_WITH, "arithmetic": {"precision": "fp32"}}))
    with (
        pytest.raises(RunFolderError, match=r"algorithm\.precision is 'fp32' there and 'bf16' here"),
        use_run_folder(config.with_precision("bf16")),
    ):
        pass


def test_portable_is_another_run_in_float32():
    portable, plain = compose([*ASKED, "determinism=portable"]), compose([*ASKED, "algorithm.precision=fp32"])
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
