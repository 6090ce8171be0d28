"""Billiards: the table of 2022, pockets that pay once, and an end when the table or the cue ball is gone."""

import numpy as np
import pytest

import segar
from segar import Charge, Levels, Mass, Position, RuleError, SegarError, Size, Velocity, World
from segar.engine import Simulator
from segar.envs import VectorEnv
from segar.language import Alive, Done, Visible
from segar.tasks import billiards
from tests.agreement.replay import folder, recordings
from tests.segar.engine.worlds import compare, random_states, uncompiled
from tests.segar.tasks.play import at_random, by_script, episodes

TABLES = segar.family("billiards").sample(40, seed=0)
LAYOUT = TABLES.layout
CUE, BALLS, POCKETS = 0, slice(1, 11), slice(11, 15)
ARENA_DIAGONAL = 8**0.5


def drawn(factor: type, levels: Levels = TABLES) -> np.ndarray:
    column = LAYOUT.columns[factor]
    return levels.values[..., column : column + factor.width].squeeze(-1 if factor.width == 1 else ())


def env_with(reward: str = "potted", num_envs: int = 4) -> tuple[VectorEnv, dict]:
    env = VectorEnv(TABLES, num_envs, task=billiards(reward), seed=0, autoreset_mode="Disabled")
    return env, env.reset(seed=0)[1]


def put_into_a_pocket(env: VectorEnv, name: str, where: np.ndarray) -> None:
    for factor, value in ((Position, (0.85, 0.85)), (Velocity, (0.0, 0.0))):
        env.intervene(name, factor, value, where=where)


def results(env: VectorEnv) -> dict:
    return env.task.results_of(env.factors)


STILL = np.zeros((4, 2), np.float32)
FIRST = np.array([True, False, False, False])


def test_the_table_is_the_one_that_was_recorded_in_2022():
    for recording in recordings(folder() / "billiards.npz"):
        ids, meta = recording.meta["ids"], recording.meta["entities"]
        for name, ours in (("ball", drawn(Position)[0, BALLS]), ("hole", drawn(Position)[0, POCKETS])):
            places = [k for k, id_ in enumerate(ids) if str(id_).endswith(f"_{name}")]
            theirs = recording.arrays["pos"][0, places]
            assert len(theirs) == len(ours)
            apart = np.linalg.norm(theirs[:, None] - ours[None], axis=-1)
            assert apart.min(axis=1).max() < 1e-9 and sorted(apart.argmin(axis=1)) == list(range(len(ours)))
            sizes = {meta[k]["factors"]["Size"] for k in places}
            assert sizes == set(drawn(Size)[0, BALLS if name == "ball" else POCKETS])
        cue = meta[ids.index("cueball")]["factors"]
        assert (cue["Mass"], cue["Charge"]) == (drawn(Mass)[0, CUE], drawn(Charge)[0, CUE])
        assert 0.1 <= cue["Size"] <= 0.3 and -0.95 <= cue["Position"][1] <= -0.475


def test_the_reward_is_minus_the_squared_distances_of_the_balls_to_their_nearest_pockets():
    env = VectorEnv(TABLES, 16, seed=0, autoreset_mode="Disabled")
    policy, (_, info) = at_random(), env.reset(seed=0)
    for _ in range(60):
        _, reward, _, _, info = env.step(policy(info))
        x = info["factors"]["Position"]
        d = np.linalg.norm(x[:, BALLS, None] - x[:, None, POCKETS], axis=-1).min(axis=2) / ARENA_DIAGONAL
        np.testing.assert_allclose(reward, -(d**2).sum(axis=1), rtol=1e-12)
        assert (reward >= -10).all() and (reward <= 0).all()


def test_kernel_and_interpreter_agree_about_states_in_disorder():
    for reward in ("distance", "potted"):
        simulator = uncompiled(World(), LAYOUT, billiards(reward, sub_steps=1))
        state = random_states(TABLES, 3, np.random.default_rng(1), speed=0.5)
        actions = np.random.default_rng(2).uniform(-1, 1, (3, 2)).astype(np.float32)
        assert compare(simulator, TABLES, state, actions).worst < 1e-9


def test_each_ball_pays_once_when_it_falls_and_the_scripted_player_pots_more_than_twice_as_many_as_random_play():
    env, means = VectorEnv(TABLES, 6, task=billiards("potted"), seed=0), []
    for policy in (at_random(), by_script(env)):
        played = episodes(env, policy)
        assert np.array_equal(played["return"], played["balls_potted"]) and played["balls_potted"].max() >= 5
        means.append(played["balls_potted"].mean())
    assert means[1] > 2 * means[0] > 0


def test_a_ball_in_a_pocket_is_paid_in_that_step_and_off_the_table_in_the_next():
    env, _ = env_with()
    put_into_a_pocket(env, "ball3", FIRST)
    _, reward, terminated, _, info = env.step(STILL)
    factors, three = info["factors"], LAYOUT.slot_index("ball3")
    assert reward.tolist() == [1, 0, 0, 0] and not terminated.any()
    assert results(env)["balls_potted"].tolist() == [1, 0, 0, 0]
    assert (factors["Done"][0, three], factors["Visible"][0, three], factors["Alive"][0, three]) == (1, 0, 1)
    _, reward, _, _, info = env.step(STILL)
    assert reward.tolist() == [0, 0, 0, 0] and info["factors"]["Alive"][:, three].tolist() == [0, 1, 1, 1]
    assert results(env)["balls_potted"].tolist() == [1, 0, 0, 0] and not info["death"].any()


def test_a_clear_table_is_success_and_the_end():
    env, _ = env_with()
    for k in range(1, 11):
        for factor, value in ((Done, True), (Visible, False), (Alive, False)):
            env.intervene(f"ball{k}", factor, value, where=FIRST if k == 10 else np.array([True, True, False, False]))
    _, reward, terminated, _, info = env.step(STILL)
    assert terminated.tolist() == info["success"].tolist() == [True, False, False, False]
    assert reward.tolist() == [0, 0, 0, 0] and results(env)["balls_potted"].tolist() == [10, 9, 0, 0]


def test_a_cue_ball_in_a_pocket_is_the_end_but_no_death_and_no_success():
    env, _ = env_with()
    put_into_a_pocket(env, "cueball", FIRST)
    _, reward, terminated, _, info = env.step(STILL)
    assert terminated.tolist() == [True, False, False, False]
    assert not info["success"].any() and not info["death"].any() and reward.tolist() == [0, 0, 0, 0]
    assert results(env)["distance_to_pocket"][0] < 0.02 < results(env)["distance_to_pocket"][1:].min()


def test_a_cue_ball_that_loses_its_mass_is_dead_and_costs_the_penalty():
    env, _ = env_with()
    env.intervene("cueball", Mass, 0.05, where=FIRST)
    _, reward, terminated, _, info = env.step(STILL)
    assert reward.tolist() == [-100, 0, 0, 0]
    assert terminated.tolist() == info["death"].tolist() == [True, False, False, False]
    assert results(env)["alive"].tolist() == [False, True, True, True]


def test_balls_that_are_down_are_not_aimed_at():
    env, info = env_with()
    x = info["factors"]["Position"]
    only = LAYOUT.slot_index("ball1")
    for k in range(2, 11):
        env.intervene(f"ball{k}", Done, True)
    info = env.step(STILL)[-1]
    push = env.task.demo_actions(env.factors)
    towards = x[:, only] - x[:, CUE]
    assert push.shape == (4, 2) and push.dtype == np.float32 and np.abs(push).max() <= 1
    assert ((push * towards).sum(axis=1) > 0).all()


def test_wrong_names_and_wrong_levels_are_refused_with_the_fix():
    with pytest.raises(SegarError, match=r"billiards has no reward 'poted'\. Did you mean 'potted'"):
        billiards("poted")
    with pytest.raises(RuleError, match=r"only CueBall, Ball, Hole.*; choose the task that these levels are for"):
        VectorEnv(TABLES, 2, task=segar.puttputt())
    with pytest.raises(RuleError, match="choose the task that these levels are for"):
        Simulator(World(), segar.family("empty-easy").layout, billiards())
