"""Runs over the trials of levels: what they write, and what they say of agents without a memory."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from segar import GoalTile, GolfBall, Position, family, puttputt
from segar.envs import VectorEnv
from segar.experiments.evaluation.episodes import action_rng, play_episodes
from segar.experiments.evaluation.evaluator import evaluate
from segar.experiments.levels.builders import Prepared
from segar.experiments.reproduction.grid import varied_columns, with_settings
from segar.experiments.runs.run_folder import read_episodes, read_summary
from segar.experiments.settings import EvaluateConfig, ObservationConfig, RunConfig, TaskConfig, as_data, run_config
from segar.experiments.settings.algorithms import PPOConfig, RecurrentPPOConfig
from segar.experiments.training.advice import advice
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run

SMALL = {"num_envs": 8, "num_steps": 8, "widths": (8,), "head_width": 0}
RECURRENT = RecurrentPPOConfig(core_width=8, minibatches=2, **SMALL)
PAST = ObservationConfig("state_past")


def test_a_run_tells_and_writes_each_trial_and_the_gain(tmp_path):
    config, said = short_run(tmp_path / "run", algorithm=RECURRENT, observation=PAST, trials=3), []
    folder = run(config, said.append).folder
    assert not any("no memory" in line for line in said)
    rows = read_episodes(folder).to_pandas()
    assert sorted(rows.trial.unique()) == [0, 1, 2]
    summary = read_summary(folder)
    for levels in ("train", "test"):
        for mode in ("deterministic", "sampled"):
            chosen = rows[(rows.levels == levels) & (rows.action_mode == mode)]
            assert (
                chosen.groupby(["level", "trial"]).size() == chosen.groupby(["level", "trial"]).size().iloc[0]
            ).all()
            of_trials = chosen.groupby("trial")["return"].mean()
            for trial in range(3):
                found = summary[f"evaluation/{levels}/return_trial_{trial}/{mode}"]
                assert found == pytest.approx(of_trials[trial], rel=1e-12)
            gain = summary[f"evaluation/{levels}/adaptation_gain_return/{mode}"]
            assert gain == pytest.approx(of_trials[2] - of_trials[0], abs=1e-12)
            low, high = (summary[f"evaluation/{levels}/adaptation_gain_return_{end}/{mode}"] for end in ("low", "high"))
            assert low <= gain <= high
    printed: list[str] = []
    done = evaluate(
        EvaluateConfig(run=str(folder), planner_samples=8, planner_iterations=1, videos="none"), printed.append
    )
    head, *lines = next(text for text in printed if "± error" in text).splitlines()[1:]
    assert head.split()[-3:] == ["gain", "score", "regret"] and len(lines) == 6
    assert done.summary["players"]["deterministic"]["return_trial_2"] == pytest.approx(
        summary["evaluation/test/return_trial_2/deterministic"], rel=1e-12
    )
    assert done.summary["players"]["no-op"]["adaptation_gain_return"] == 0.0


def test_a_run_without_trials_writes_what_it_wrote(trained_once):
    assert "trial" not in read_episodes(trained_once).column_names
    assert not any("trial" in name or "adaptation" in name for name in read_summary(trained_once))


def test_an_algorithm_without_a_memory_is_told_what_trials_mean_for_it(tmp_path):
    said: list[str] = []
    run(short_run(tmp_path / "run", trials=2), said.append)
    assert "gain over test trials" in said[-1]
    (line,) = (line for line in said if "no memory" in line)
    assert line.startswith("warning: trials=2, and the policy of algorithm=ppo has no memory")
    assert "its trials differ by chance alone" in line and "algorithm=ppo_recurrent" in line


def test_a_recurrent_agent_keeps_its_memory_between_trials_in_evaluation():
    """It acts as its network does when it is stepped through all trials by hand, without a reset between them."""
    from segar.experiments.algorithms.recurrent_ppo import RecurrentPPO

    levels = family("empty-easy").sample(3, seed=0)
    config = RunConfig(algorithm=RECURRENT, observation=PAST, trials=3)
    options = Prepared(config).env_options()
    env = VectorEnv(levels, 3, seed=5, **options)
    policy = RecurrentPPO.make_policy(RECURRENT, env.single_observation_space.shape or (), 2)
    policy.initialize(torch.Generator().manual_seed(0))
    rows = play_episodes(policy, levels, np.arange(3), options, rng=action_rng("deterministic", 0), seed=5)
    seen, _ = env.reset(seed=5, options={"levels": np.arange(3)})
    memory, returns = torch.zeros(3, policy.memory_width), []
    while len(returns) < 9:
        with torch.no_grad():
            loc, _, _, memory = policy.step(torch.from_numpy(seen), memory)
        seen, _, terminated, truncated, info = env.step(loc.tanh().numpy())
        for e in np.flatnonzero(terminated | truncated):
            final = info["final_info"]
            if final["level"][e] == e and len([one for one in returns if one[1] == e]) < 3:
                returns.append((int(final["trial"][e]), int(e), float(final["return"][e])))
    assert sorted(returns) == [(row["trial"], row["level"], row["return"]) for row in rows]


def test_a_study_varies_trials_and_its_tables_say_how_many_also_by_default():
    runs = [with_settings(RunConfig(), {"trials": trials}) for trials in (1, 4)]
    assert [one.trials for one in runs] == [1, 4]
    assert [varied_columns(one, ["trials"]) for one in runs] == [{"trials": "1"}, {"trials": "4"}]


def test_trials_are_part_of_a_run_s_name_only_where_there_are_several():
    assert "trials" not in RunConfig().identity() and RunConfig(trials=2).identity()["trials"] == 2
    ppo = dataclasses.replace(RunConfig(), algorithm=PPOConfig())
    assert ppo.label() != dataclasses.replace(ppo, trials=2).label()
    assert run_config(as_data(RunConfig(trials=4))).trials == 4


@pytest.mark.parametrize(
    ("task", "algorithm", "expected"),
    [
        (TaskConfig(), RECURRENT, True),
        (TaskConfig(), dataclasses.replace(RECURRENT, joins_trials=False), False),
        (TaskConfig(f"{__name__}:for_success"), RECURRENT, False),
    ],
)
def test_an_agent_that_does_well_not_to_end_trials_is_told(tmp_path, task, algorithm, expected):
    policy = SimpleNamespace(begin=None)  # with a memory
    config = dataclasses.replace(short_run(tmp_path, trials=2), algorithm=algorithm, task=task, observation=PAST)
    said = [line for line in advice(Prepared(config), policy) if "trials=2" in line]
    assert [("may learn not to end any" in line) for line in said] == [True] * expected
    assert not any("trials" in line for line in advice(Prepared(dataclasses.replace(config, trials=1)), policy))


def for_success():
    """PuttPutt that rewards arriving, and nothing else."""

    def reached(ball: GolfBall, goal: GoalTile) -> float:
        return 1.0 if (ball[Position] - goal[Position]).norm() < 0.05 else 0.0

    return dataclasses.replace(puttputt(), name="success", reward=reached)
