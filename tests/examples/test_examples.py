"""The scripts in examples/ run as they stand, and end with the gap."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch

import segar
from examples import evolution, imitation, nearest, ppo, sb3_off_policy, sb3_ppo
from segar.suites import side_options, suite
from tests.places import ROOT

TINY = ["--levels", "empty-easy", "--count", "4", "--test-count", "5", "--num-envs", "8", "--frames", "1024"]


@pytest.mark.parametrize("script", [ppo, sb3_ppo])
def test_a_script_trains_and_prints_the_gap(script, capsys):
    found = script.main(TINY)
    printed = capsys.readouterr().out
    assert str(found) in printed and f"gap (test - train)  {found.gap()}" in printed
    assert (found.train.levels, found.test.levels) == (4, 5) and found.w2["exact"] > 0


@pytest.mark.parametrize("script", [ppo, sb3_ppo])
@pytest.mark.parametrize("name", ["place-few-v1", "sight-mass-v1"])
def test_a_script_trains_on_a_suite_and_plays_its_test(script, name):
    found = script.main(["--levels", name, "--num-envs", "8", "--frames", "1024"])
    of = suite(name)
    assert (found.train.levels, found.test.levels) == (of.training_levels, len(of.test_levels))
    assert found.test.episodes.length.max() <= of.task.max_steps


def test_imitation_learns_from_the_planner_on_training_levels(capsys):
    found = imitation.main(["--suite", "place-few-v1", "--rounds", "1", "--steps", "200"])
    assert f"success in test: {found.test.mean('success').value:.2f}" in capsys.readouterr().out
    assert found.train.mean("success").value > 0.1  # of random play, which the script has never seen


def test_evolution_raises_the_return_of_its_mean(capsys):
    few, many = (evolution.main(["--suite", "place-few-v1", "--generations", n]) for n in ("1", "12"))
    assert capsys.readouterr().out.count("success in test: ") == 2
    assert many.train.mean("return").value > few.train.mean("return").value


def test_a_plan_that_is_remembered_solves_its_level_and_few_others(capsys):
    found = nearest.main(["--suite", "place-few-v1"])
    assert f"success in test: {found.test.mean('success').value:.2f}" in capsys.readouterr().out
    assert found.train.mean("success").value > 0.9 > 0.6 > found.test.mean("success").value


def test_imitation_begins_anew_in_states_that_its_agent_reached():
    options = side_options(suite("place-few-v1"), "train", 1)
    env = segar.envs.VectorEnv(num_envs=len(options["levels"]), seed=1, **options)
    reached = imitation.states_of(env, lambda seen: np.full((len(seen), 2), 0.1), np.random.default_rng(0))
    assert 0 < len(reached) <= len(env.levels) and not np.isin(reached.values[:, 0], env.levels.values[:, 0]).all()


@pytest.mark.filterwarnings("ignore::FutureWarning:torch", "ignore:.*LeafSpec:FutureWarning")  # of torch's exporter
@pytest.mark.parametrize("learner", ["tqc", "mbpo"])
def test_a_learner_off_the_policy_is_written_as_it_acts_and_not_twice(learner, tmp_path, capsys):
    few = [learner, "--suites", "place-few-v1", "--frames", "5120", "--out", str(tmp_path)]
    sb3_off_policy.main(few)
    file = tmp_path / "place-few-v1-s1.onnx"
    assert capsys.readouterr().out.strip() == str(file) and [*tmp_path.iterdir()] == [file]
    sb3_off_policy.main(few)
    assert capsys.readouterr().out == ""
    settings = sb3_off_policy.Settings(frames=5120)
    model = sb3_off_policy.train(learner, suite("place-few-v1").training_side(1), 1, settings)
    seen = np.random.default_rng(0).normal(size=(64, *model.observation_space.shape)).astype(np.float32)
    played = segar.policies.OnnxPolicy(file)(seen)
    np.testing.assert_allclose(played, model.predict(seen, deterministic=True)[0], atol=1e-5)
    assert played.std(axis=0).min() > 0  # it looks
    assert b".py" not in file.read_bytes(), "bytes would depend on the place of a checkout"


def test_a_model_learns_where_the_ball_goes_and_what_that_earns():
    settings = sb3_off_policy.Settings(frames=4160, fit_steps=400)
    seen = sb3_off_policy.train("mbpo", suite("place-few-v1").training_side(1), 1, settings).replay_buffer
    steps = seen.real(2000)
    then, rewards, ends = seen.model.step(steps.observations, steps.actions)
    wrong = (then - steps.next_observations)[:, :2].square().sum()
    assert wrong < 0.5 * (steps.observations - steps.next_observations)[:, :2].square().sum()
    assert (rewards - steps.rewards).var() < 0.5 * steps.rewards.var() and 0 <= ends.min() <= ends.max() <= 1


@pytest.mark.parametrize("script", [ppo, sb3_ppo])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--levels", "place-fw-v1"], "no family and no suite is called 'place-fw-v1'. Did you mean 'place-few-v1'?"),
        (["--levels", "place-few-v1", "--count", "9"], "the suite place-few-v1 has its own levels; leave --count"),
        (["--levels", "look-far-v1"], "shows the set of textures baseline in training"),
        (["--frames", "-5"], "--frames must be 1 or more, not -5"),
        (["--test-count", "0"], "--test-count must be 1 or more, not 0"),
    ],
)
def test_a_script_refuses_what_it_would_leave_out(script, arguments, message, capsys):
    with pytest.raises(SystemExit):
        script.main(arguments)
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ppo", "sb3_ppo"])
def test_a_script_runs_from_any_folder(name, tmp_path):
    command = [sys.executable, str(ROOT / "examples" / f"{name}.py"), "--help"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "--test-count" in done.stdout, done.stderr


def test_ppo_repeats_itself():
    levels = segar.family("empty-easy").sample(4, seed=0)
    settings = ppo.Settings(num_envs=4, num_steps=8, frames=64, minibatches=2)
    agents = [ppo.train(settings, levels) for _ in range(2)]
    for a, b in zip(agents[0].parameters(), agents[1].parameters(), strict=True):
        assert torch.equal(a, b)


def test_advantages_are_those_of_the_definition_and_stay_within_an_episode():
    settings = ppo.Settings(gamma=0.9, gae_lambda=0.8)
    rewards, values, next_values = torch.randn(3, 7, 2, generator=torch.Generator().manual_seed(0))
    terminal, over = torch.zeros(7, 2), torch.zeros(7, 2)
    over[2, 0] = 1  # a time-out: bootstrapped
    terminal[4, 0] = over[4, 0] = 1  # an end: not bootstrapped
    found = ppo.generalized_advantages(settings, rewards, values, next_values, terminal, over)
    for e in range(2):
        for t in range(7):
            expected, weight = 0.0, 1.0
            for k in range(t, 7):
                error = rewards[k, e] + 0.9 * next_values[k, e] * (1 - terminal[k, e]) - values[k, e]
                expected += weight * float(error)
                if over[k, e]:
                    break
                weight *= 0.9 * 0.8
            assert float(found[t, e]) == pytest.approx(expected, rel=1e-4, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("script", [ppo, sb3_ppo])
def test_a_script_learns(script):
    found = script.main(["--levels", "empty-easy", "--frames", "400000"])
    assert found.train.mean("success").value > 0.8 and np.isfinite(found.gap()).all()
