"""Every registered id keeps Gymnasium's contract."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import segar
from segar.errors import SegarError
from segar.suites import suite, suites
from segar.tasks import task_of

IDS = sorted(id_ for id_ in gymnasium.registry if id_.startswith("Segar-"))
QUICK = ("Segar-empty-hard-state-v0", "Segar-objectsx1-hard-rgb-linear-v0", "Segar-billiards-rgb-v0")
make = gymnasium.make


def test_all_families_and_tasks_are_registered_in_both_observations() -> None:
    expected = {f"Segar-{f}-{o}{r}-v0" for f in segar.families() for o in ("rgb", "state") for r in ("", "-linear")}
    expected |= {f"Segar-{t}-{o}-v0" for t in ("puttputt", "billiards", "invisiball") for o in ("rgb", "state")}
    assert len(segar.families()) == 30 and expected == set(IDS)


@pytest.mark.parametrize("id_", ["Segar-empty-hard-state-v0", "segar:Segar-empty-hard-state-linear-v0"])
def test_gymnasium_calls_no_id_out_of_date(id_: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make(id_, num_levels=2)


@pytest.mark.parametrize("id_", [pytest.param(id_, marks=[pytest.mark.slow] * (id_ not in QUICK)) for id_ in IDS])
def test_the_environment_checker_passes(id_: str) -> None:
    env = make(id_, num_levels=3, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


@pytest.mark.slow
def test_linear_ids_reward_minus_the_distance_and_the_others_its_square() -> None:
    rewards = []
    for suffix in ("", "-linear"):
        env = make(f"Segar-empty-medium-state{suffix}-v0", num_levels=5, seed=0)
        env.reset(options={"level": 2})
        rewards.append(env.step(np.array([0.3, 0.1], np.float32))[1])
    assert rewards[0] == pytest.approx(-(rewards[1] ** 2))


@pytest.mark.parametrize("split", ["train", "test"])
def test_an_id_has_the_levels_of_its_family_in_the_split(split: str) -> None:
    levels = make("Segar-empty-hard-state-v0", num_levels=50, split=split).unwrapped.levels
    assert levels == segar.family("empty-hard").sample(50, seed=0, split=split)


WAYS = ["sync", "vector_entry_point"]
SUITE = "Segar/property-heavy-v1-test-state"


def steps_of(env: gymnasium.Env) -> int:
    """How many steps an episode without actions has."""
    env.reset(seed=0)
    for step in range(1, 1000):  # noqa: B007 - it is returned
        _, _, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
        if terminated or truncated:
            break
    return step


def test_environments_without_a_seed_have_the_levels_of_the_id_and_episodes_of_their_own():
    for id_ in (QUICK[0], SUITE):
        made = [make(id_, num_levels=100) for _ in range(4)]
        assert all(env.unwrapped.levels == made[0].unwrapped.levels for env in made)
        assert len({tuple(env.reset()[1]["level"] for _ in range(5)) for env in made}) == 4
        assert len({env.reset(seed=1)[1]["level"] for env in made}) == 1
        seeded = [make(id_, num_levels=100, seed=5) for _ in range(2)]
        assert len({tuple(env.reset()[1]["level"] for _ in range(5)) for env in seeded}) == 1
        for way in WAYS:
            batches = [gymnasium.make_vec(id_, 6, vectorization_mode=way, num_levels=100) for _ in range(2)]
            drawn = [env.reset()[1]["level"] for env in batches]
            assert len({*drawn[0]}) > 1 and not np.array_equal(*drawn)
            np.testing.assert_array_equal(*(env.reset(seed=1)[1]["level"] for env in batches))


@pytest.mark.parametrize("option", ["frameskip", "obs", "max_episode_step"])
def test_an_unknown_option_is_a_type_error_in_pythons_words_too(option):
    for id_ in (QUICK[0], SUITE):
        makers = [lambda **o: make(id_, **o), lambda **o: gymnasium.make_vec(id_, **o)]  # noqa: B023 - called here
        for maker in makers:
            with pytest.raises(TypeError, match=f"got an unexpected keyword argument '{option}'") as refused:
                maker(**{option: 4})
            assert isinstance(refused.value, SegarError)


def test_the_spec_of_every_id_says_the_limit_of_its_task():
    for id_ in IDS:
        family = gymnasium.spec(id_).kwargs["family_name"]
        assert gymnasium.spec(id_).max_episode_steps == task_of(segar.family(family).sample(1, seed=0)).max_steps
    for name in suites():
        limits = {gymnasium.spec(f"Segar/{name}-{side}-rgb").max_episode_steps for side in ("train", "test")}
        assert limits == {suite(name).task.max_steps}


@pytest.mark.parametrize(
    ("options", "steps"),
    [({}, 100), ({"max_episode_steps": 7}, 7), ({"max_episode_steps": 130}, 130), ({"max_steps": 7}, 7)],
    ids=str,
)
def test_an_episode_of_an_id_has_as_many_steps_as_were_asked_for(options, steps):
    env = make(QUICK[0], num_levels=2, **options)
    assert steps_of(env) == steps
    assert "max_steps" in options or env.spec.max_episode_steps == steps
    for way in WAYS:
        batch = gymnasium.make_vec(QUICK[0], 2, vectorization_mode=way, num_levels=2, **options)
        batch.reset(seed=0)
        ends = [batch.step(np.zeros((2, 2), np.float32))[3].all() for _ in range(steps)]
        assert ends[-1] and not any(ends[:-1])
    assert batch.spec.max_episode_steps == steps


def test_a_limit_of_an_id_can_be_taken_off_and_a_suite_can_be_played_longer():
    unlimited = gymnasium.make_vec(QUICK[0], 1, num_levels=2, max_episode_steps=-1)
    unlimited.reset(seed=0)
    assert not any(unlimited.step(np.zeros((1, 2), np.float32))[3].any() for _ in range(150))
    assert steps_of(make(SUITE, num_levels=1)) == 50 and steps_of(make(SUITE, num_levels=1, max_episode_steps=60)) == 60


def test_nothing_is_played_after_close():
    levels = segar.family("empty-hard").sample(2, seed=0)
    for env in (segar.envs.Env(levels), segar.envs.VectorEnv(levels, 2), make(QUICK[0], num_levels=2)):
        env.reset(seed=0)
        env.close()
        env.close()
        for call in (env.reset, lambda env=env: env.step(env.action_space.sample())):
            with pytest.raises(SegarError, match=r"\(\) after close\(\)"):
                call()
