"""Evaluation by portable networks: what torch's agents do, with results that are the same bits on every processor."""

import json
from functools import cache

import pyarrow.parquet as pq
import pytest

import segar
from segar.evaluation import evaluate_policy
from segar.experiments.evaluation.evaluator import evaluate
from segar.experiments.settings import KINDS, ConfigError, EvaluateConfig, LevelsConfig, ObservationConfig, ScaleConfig
from segar.experiments.settings.algorithms import PPOConfig
from segar.experiments.training.run import run
from segar.policies import Network, NetworkPolicy
from tests.experiments.short_runs import short_run
from tests.experiments.training.test_portable import python

QUICK = {"scores": False, "videos": "none"}
ROLLOUT = {"num_envs": 8, "num_steps": 16, "minibatches": 2, "widths": (32,), "head_width": 16, "precision": "fp32"}
REPLAY = {"num_envs": 2, "num_steps": 16, "warmup": 32, "batch_size": 32, "capacity": 500}
STATE, FRAMES, STACKS = ObservationConfig("state"), ObservationConfig("rgb"), ObservationConfig("rgb_stack2")
RUNS = {
    "ppo": (KINDS["ppo"](**ROLLOUT), STATE),
    "nature": (KINDS["ppo"](**ROLLOUT, encoder="nature"), FRAMES),
    "keypoints": (KINDS["ppo"](**ROLLOUT, encoder="keypoints"), STACKS),
    "gru": (KINDS["ppo_recurrent"](**ROLLOUT, core_width=16, encoder="small"), FRAMES),
    "lstm": (KINDS["ppo_recurrent"](**ROLLOUT, core_width=16, core="lstm"), STATE),
    "sac": (KINDS["sac"](**REPLAY), STATE),
    "drq": (KINDS["drq"](**REPLAY, precision="fp32"), STACKS),
}
# What a processor of fifteen years ago would choose, and numba's plainest.
LIMITED = {
    "ATEN_CPU_CAPABILITY": "default",
    "ONEDNN_MAX_CPU_ISA": "SSE41",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "NUMBA_CPU_NAME": "generic",
}


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folder of the short run of a name, which is trained when it is first asked for."""
    root = tmp_path_factory.mktemp("runs")

    @cache
    def folder(name):
        algorithm, observation = RUNS[name]
        levels = LevelsConfig("objectsx1-easy", count=3, test_count=4)
        scale = ScaleConfig(frames=256 if isinstance(algorithm, PPOConfig) else 96)
        config = short_run(root / name, levels=levels, observation=observation, algorithm=algorithm, scale=scale)
        return run(config, say=lambda line: None).folder

    return folder


def test_a_portable_evaluation_says_so_and_leaves_the_network_that_played(trained):
    said = []
    by_torch = evaluate(EvaluateConfig(str(trained("ppo")), **QUICK), lambda line: None)
    found = evaluate(EvaluateConfig(str(trained("ppo")), portable=True, **QUICK), said.append)
    assert found.folder.name == "test-n4-portable" != by_torch.folder.name
    assert "on its own 4 test levels (portable):" in said[0]
    assert (found.summary["portable"], by_torch.summary["portable"]) == (True, False)
    written = json.loads((found.folder / "summary.json").read_text())
    assert written["portable"] is True and written["players"].keys() == {"deterministic", "sampled", "no-op"}
    assert pq.read_table(found.folder / "episodes.parquet").num_rows == 8
    near = pytest.approx(by_torch.summary["players"]["deterministic"]["return"], abs=0.05)
    assert found.summary["players"]["deterministic"]["return"] == near
    network = Network.load(found.folder / "network.npz")
    levels = segar.Levels.load(found.folder / "levels.npz")
    alone = evaluate_policy(NetworkPolicy(network, unit_actions=True), levels, levels, unit_actions=True)
    returns = [row["return"] for row in found.episodes if row["action_mode"] == "deterministic"]
    assert alone.test.of_levels("return").tolist() == returns
    again = EvaluateConfig(str(trained("ppo")), out=str(found.folder), **QUICK)
    assert not (evaluate(again, lambda line: None).folder / "network.npz").exists()


def hashes(trained, name, folder, **limits):
    folders = (str(trained(one)) for one in RUNS)
    limits |= {"SEGAR_CACHE_DIR": str(folder)}
    done = python("-m", "tests.experiments.evaluation.portable_evaluation", name, *folders, limits=limits)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_results_are_the_same_bits_under_two_limits_of_the_instruction_set(trained, tmp_path):
    host = hashes(trained, "host", tmp_path / "host")
    assert host == hashes(trained, "limited", tmp_path / "limited", **LIMITED)
    assert len({*host.values()}) == len(RUNS)


def test_an_encoder_of_somebodys_own_that_cannot_be_portable_is_refused_before_anything_is_written(
    tmp_path, monkeypatch
):
    (tmp_path / "nets.py").write_text(
        "from torch import nn\n\nclass Twice(nn.Module):\n    def forward(self, x):\n        return 2 * x\n\n"
        "def tiny(height, width, depth):\n"
        "    return nn.Sequential(nn.Conv2d(depth, 4, 16, 16), Twice(), nn.Flatten(), nn.Linear(64, 256))\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    algorithm = KINDS["ppo"](**ROLLOUT, encoder="nets:tiny")
    folder = run(short_run(tmp_path / "run", algorithm=algorithm, observation=FRAMES)).folder
    with pytest.raises(ConfigError, match=r"'actor.encoder.trunk.1' of the policy is a nets.Twice"):
        evaluate(EvaluateConfig(str(folder), portable=True, **QUICK))
    assert not (folder / "evaluations").exists()
