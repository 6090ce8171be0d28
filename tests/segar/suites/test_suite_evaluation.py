"""A suite played whole: what is seen is what the Gymnasium ids show, and scores are made of the frozen plans."""

import gymnasium
import numpy as np
import pytest

import segar
from segar import Mass
from segar.errors import SegarError, SuiteError
from segar.evaluation import RecordedActions
from segar.observations import SHIPPED, Stack, StateVector, TexturedPixels
from segar.suites import TEXTURED, evaluate_on_side, evaluate_on_suite, observation_on, side_options, suite

SIDES = ("train", "test")


def still(seen):
    return np.zeros((len(seen), 2), np.float32)


@pytest.mark.parametrize(("name", "observation"), [("look-far-v1", "rgb"), ("sight-mass-v1", "state")])
def test_what_is_seen_and_played_is_that_of_the_gymnasium_ids_to_the_bit(name, observation):
    """An agent that acts by what it sees has the same observations and returns on both sides."""
    of, seen = suite(name), {side: [] for side in SIDES}

    def act(observations):
        numbers = observations.reshape(len(observations), -1)[:, 1000:1002] / 255.0
        return (observations[:, :2] if observation == "state" else numbers).astype(np.float32)

    for side in SIDES:

        def policy(observations, side=side):
            seen[side].append(observations.copy())
            return act(observations)

        levels = of.sample(3) if side == "train" else of.test_levels
        id_ = f"Segar/{name}-{side}-{observation}"
        mode = {"vectorization_mode": "vector_entry_point"}
        env = gymnasium.make_vec(id_, num_envs=len(levels), seed=3, **mode).unwrapped
        played = evaluate_on_side(policy, of, side, seed=3, observation=observation)
        now, _ = env.reset(seed=0, options={"levels": np.arange(len(levels))})
        returns, running = np.zeros(len(levels)), np.ones(len(levels), np.bool_)
        for known in seen[side]:
            np.testing.assert_array_equal(known, now)
            now, reward, terminated, truncated, _ = env.step(act(now))
            returns += reward * running
            running &= ~(terminated | truncated)
        assert not running.any() and (played.episodes.returns == returns).all()
        assert env.levels == levels and played.levels == len(levels)


@pytest.mark.parametrize("name", ["own", pytest.param("place-few-v1", marks=pytest.mark.slow)])
def test_the_plans_of_a_suite_score_exactly_1_with_no_regret(name, own):
    of = own if name == "own" else suite(name)
    found = evaluate_on_side(RecordedActions(of.plans.actions), of, "test", scores=True)
    assert (found.score(), found.regret()) == (1.0, 0.0)


def test_scores_of_a_deterministic_policy_do_not_depend_on_the_seed_of_the_environments(own):
    first, second = (evaluate_on_suite(still, own, scores=True, environment_seed=seed) for seed in (0, 7))
    for side in SIDES:
        assert getattr(first, side).score() == getattr(second, side).score()
        assert getattr(first, side).baselines.plan.solved.all()
    assert (first.test.baselines.oracle == own.plans.returns).all()
    other = evaluate_on_suite(still, own, seed=2, scores=True)
    assert other.test.score() == first.test.score() and other.train.score() != first.train.score()


def test_both_sides_are_those_of_evaluate_policy_where_training_and_test_look_alike():
    of = suite("place-between-v1")
    ours = evaluate_on_suite(lambda seen: np.tanh(seen[:, :2]), of, seed=2, distances=("exact",), unit_actions=True)
    options = {"task": of.task, "observation": "state", "unit_actions": True, "distances": ("exact",)}
    theirs = segar.evaluate_policy(lambda seen: np.tanh(seen[:, :2]), of.sample(seed=2), of.test_levels, **options)
    assert ours.figures() == theirs.figures()
    assert segar.evaluate_on_suite is evaluate_on_suite


@pytest.mark.parametrize("name", [*TEXTURED, *TEXTURED.values()])
def test_frames_of_a_suite_about_looks_have_the_textures_of_the_side(name):
    of = suite("look-far-v1")
    for side, textures in zip(SIDES, of.textures, strict=True):
        shown = observation_on(of, side, name)
        frames = shown.observation if isinstance(shown, Stack) else shown
        assert frames == TexturedPixels(textures)
        assert observation_on(of, side, lambda one: TexturedPixels(one, resolution=32)) == TexturedPixels(textures, 32)


def test_every_observation_hides_what_the_suite_hides_and_those_that_show_it_are_refused():
    of = suite("sight-mass-v1")
    for name in SHIPPED:
        given = observation_on(of, "test", name)
        parts = getattr(given, "members", (getattr(given, "observation", given),))
        assert not any(part.shows(Mass) for part in parts if isinstance(part, StateVector | TexturedPixels))
    shown = (StateVector(), Stack(StateVector(), 2), {"state": "state", "look": "rgb"}, TexturedPixels())
    for given in (*shown, Stack(TexturedPixels(), 2), {"look": "textures"}):
        with pytest.raises(SuiteError, match=r"shows Mass, which the suite sight-mass-v1 hides"):
            observation_on(of, "train", given)
    hides = StateVector(hidden=of.hidden)
    assert (
        observation_on(of, "train", hides) is hides and observation_on(suite("place-few-v1"), "test") == StateVector()
    )


def test_a_normalised_state_has_the_units_of_training_on_both_sides():
    of = suite("place-between-v1")
    train, test = (side_options(of, side, seed=2, observation="state_normalised")["observation"] for side in SIDES)
    assert train.measured_on == test.measured_on == of.sample(2)[:1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"obs": "rgb"}, r"evaluate_on_suite: there is no option 'obs'. Did you mean 'observation'\?"),
        ({"max_steps": 10}, "the suite place-few-v1 says what is played, .*; leave max_steps out"),
        ({"task": segar.puttputt()}, "the suite place-few-v1 says what is played, .*; leave task out"),
        ({"seed": -1}, "place-few-v1: a seed is a whole number from 0"),
        ({"training_levels": 2.5}, "number of training levels must be a whole number from 1 up, not 2.5"),
    ],
)
def test_what_makes_no_sense_on_a_suite_is_refused(options, message):
    with pytest.raises(SegarError, match=message):
        evaluate_on_suite(still, suite("place-few-v1"), **options)


def test_what_is_no_suite_or_no_side_is_refused():
    with pytest.raises(SuiteError, match=r"suite must be a suite, such as .*, not 'place-few-v1'"):
        evaluate_on_suite(still, "place-few-v1")
    with pytest.raises(SuiteError, match=r"side must be 'train' or 'test', not 'tst'. Did you mean 'test'"):
        evaluate_on_side(still, suite("place-few-v1"), "tst")
    with pytest.raises(SuiteError, match=r"A suite in a file is read by segar.suites.read_suite\('folder/x.toml'\)"):
        suite("folder/x.toml")
    with pytest.raises(SuiteError, match="'state' does not; choose rgb, rgb_stack2"):
        evaluate_on_suite(still, suite("look-far-v1"))
