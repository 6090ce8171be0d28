"""Any policy under one evaluation: the numbers of `experiments`, an interval that covers, and clear refusals."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

import segar
from segar import evaluation
from segar.evaluation import QUANTITIES, Evaluation, LevelSetResult, PlayedEpisodes, find_baselines
from segar.experiments.evaluation.episodes import distance_figures, evaluate_run, evaluation_figures, play_episodes
from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import EvaluationConfig, RunConfig, TaskConfig

TRAIN, TEST = (segar.family("tilesx1-medium").sample(8, seed=3, split=split) for split in ("train", "test"))


class Linear:
    """A policy that pushes along a part of what it sees; for evaluation here, and in `experiments`."""

    def __call__(self, observations):
        return np.tanh(observations[:, 2:4]).astype(np.float32)

    def act(self, observation, *, rng):
        return self(observation)


def evaluation_of(returns_train, returns_test, shares=(0.0, 0.0)):
    """An evaluation with these returns, one episode on each level, all of which succeed or none."""
    results = []
    for returns, share in zip((returns_train, returns_test), shares, strict=True):
        n = len(returns)
        results.append(
            segar.evaluation.LevelSetResult(played_with(np.full(n, share == 1.0), np.array(returns, float)), n)
        )
    return segar.evaluation.Evaluation(*results)


def test_the_numbers_are_those_of_experiments_for_the_same_agent():
    config = RunConfig(evaluation=EvaluationConfig(episodes=len(TRAIN)))
    theirs = evaluation_figures(evaluate_run(Linear(), Prepared(config), TRAIN, TEST))
    theirs |= distance_figures(TRAIN, TEST, ("exact", "reference"))
    found = segar.evaluate_policy(
        Linear(),
        TRAIN,
        TEST,
        seed=config.evaluation.seed,
        distances=("exact", "reference"),
        **Prepared(config).env_options(),
    )
    ours = found.figures()
    for name in ("gap", "gap_ref", *(f"{levels}/{q}" for levels in ("train", "test") for q in QUANTITIES)):
        assert ours[name] == pytest.approx(theirs[f"evaluation/{name}/deterministic"], rel=1e-13), name
    assert {name: theirs[name] for name in ("w2/exact", "w2/reference")} == {f"w2/{m}": v for m, v in found.w2.items()}


def test_every_episode_is_that_of_experiments():
    options = Prepared(RunConfig(task=TaskConfig(options={"impulse": 1.0}))).env_options()
    rows = play_episodes(Linear(), TEST, np.arange(len(TEST)), options, rng=None, seed=5)
    episodes = segar.evaluate_policy(Linear(), TRAIN, TEST, seed=5, **options).test.episodes
    for name, column in episodes.columns().items():
        assert column.tolist() == [row[name] for row in rows], name
    for name, column in episodes.results.items():
        assert column.tolist() == [row[f"results/{name}"] for row in rows], name


def test_scores_are_those_of_the_baselines():
    found = segar.evaluate_policy(Linear(), TRAIN[:3], TEST[:3], scores=True, max_steps=20)
    task = dataclasses.replace(segar.puttputt(), max_steps=20)
    baselines = find_baselines(TEST[:3], task, rng=np.random.default_rng(0))
    for player in ("random", "idle", "floor", "oracle"):
        np.testing.assert_array_equal(getattr(found.test.baselines, player), getattr(baselines, player))
        assert found.figures()[f"test/{player}"] == getattr(baselines, player).mean()
    reached = found.test.mean().value
    assert found.test.score() == found.figures()["test/score"] == baselines.normalised(reached)
    assert found.test.regret() == found.figures()["test/regret"] == baselines.regret(reached)
    idle = evaluation.play_episodes(TEST[:3], np.arange(3), evaluation.Idle(), seed=0, max_steps=20)
    assert baselines.idle.tolist() == idle.returns.tolist()
    assert "score" in str(found) and "regret" in str(found)


def test_the_policy_gets_the_observations_of_all_environments_in_every_step():
    seen = []

    def policy(observations):
        seen.append({name: part.shape for name, part in observations.items()})
        return np.zeros((len(observations["state"]), 2), np.float32)

    observation = {"state": "state", "look": segar.observations.Pixels(32)}
    segar.evaluate_policy(policy, TRAIN[:3], TEST, observation=observation, max_steps=4, episodes=2)
    width = segar.envs.VectorEnv(TRAIN, 1).single_observation_space.shape[0]
    expected = [{"state": (n, width), "look": (n, 32, 32, 3)} for n in (6, 16) for _ in range(4)]
    assert seen == expected


def test_rounds_are_averaged_level_by_level():
    found = segar.evaluate_policy(Linear(), TRAIN, TEST, episodes=3)
    assert len(found.train.episodes) == 24 and found.train.episodes.level.tolist() == [*range(8)] * 3
    once = segar.evaluate_policy(Linear(), TRAIN, TEST)
    np.testing.assert_allclose(found.train.of_levels("return"), once.train.of_levels("return"))
    assert found.gap() == pytest.approx(once.gap())  # rounds of a deterministic world tell nothing new about levels


def test_the_intervals_are_student_s_and_welch_s():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=9), rng.normal(1.0, 3.0, size=14)
    found = evaluation_of(a, b)
    welch = stats.ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    assert found.gap() == pytest.approx((b.mean() - a.mean(), welch.low, welch.high))
    student = stats.ttest_1samp(b, 0.0).confidence_interval(0.95)
    assert found.test.mean() == pytest.approx((b.mean(), student.low, student.high))


def test_one_level_and_levels_that_are_alike_have_no_interval():
    one = evaluation_of([-1.0], [-3.0, -4.0]).gap()
    assert one.value == -2.5 and np.isnan([one.low, one.high]).all()
    for equal in (evaluation_of([-1.0, -1.0], [-3.0, -3.0]).gap(), evaluation_of([0.1] * 3, [0.3] * 3).gap()):
        assert np.isnan([equal.low, equal.high]).all() and "(no interval)" in str(equal)
    figures = evaluation_of([-1.0], [-3.0]).figures()
    assert np.isfinite(list(figures.values())).all() and "gap" in figures and "gap_low" not in figures


@pytest.mark.parametrize(("train", "test"), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
def test_shares_that_no_level_breaks_have_wilsons_interval_and_their_gap_newcombes(train, test):
    found = evaluation_of([-1.0] * 20, [-3.0] * 30, shares=(train, test))
    (value, low, high), n = found.test.mean("success"), 30
    assert value == test and 0 <= low <= value <= high <= 1
    assert high - low == pytest.approx(1.96**2 / (n + 1.96**2), rel=1e-3)
    gap = found.gap("success")
    assert gap.value == test - train and -1 <= gap.low <= gap.value <= gap.high <= 1 and gap.high - gap.low > 0.1
    if test == train:
        assert gap.low < 0 < gap.high


def test_the_gap_counts_what_levels_that_are_alike_leave_open():
    """One of two or three levels more or less would have been another share, however much the other set's levels vary."""
    few, many = (LevelSetResult(played_with([True] * n), n) for n in (2, 200))
    mixed = LevelSetResult(played_with([True, False] * 20, -np.arange(40.0)), 40)
    wide, narrow = (Evaluation(one, mixed).gap("success") for one in (few, many))
    assert wide.high - wide.value > 0.6 > 0.2 > narrow.high - narrow.value
    assert np.isnan(Evaluation(few, mixed).gap().low)


def test_what_is_printed_names_sets_gap_and_distance():
    found = segar.evaluate_policy(Linear(), TRAIN, TEST, distances=("exact",))
    lines = str(found).splitlines()
    assert [line.split()[0] for line in lines] == ["levels", "train", "test", "gap", "W2"]
    assert lines[3].endswith(str(found.gap()))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": None}, "policy must be a function of observations, not None"),
        ({"train": "empty-hard"}, "evaluate_policy takes level sets .*; a str is not supported"),
        ({"episodes": 0}, "episodes must be a whole number from 1 up, not 0"),
        ({"seed": None}, "a seed is a whole number from 0 .* not None"),
        ({"copy": False}, "'copy' is not to be chosen here"),
        ({"test": segar.family("objectsx1-easy").sample(2, seed=0)}, "would observe Box.* in the training levels"),
        ({"policy": lambda seen: np.zeros(2)}, r"the policy gave for 8 .* must have shape \(8, 2\), not \(2,\)"),
        ({"policy": lambda seen: (seen[:, :2], None)}, r"the policy gave a tuple \(ndarray, NoneType\)"),
        ({"policy": lambda seen: "left"}, r"what the policy gave for 8 observations, \(8, 2\) expected: .*'left'"),
        ({"policy": lambda seen: np.full((8, 2), np.nan)}, "what the policy gave for 8 .* environment 0 is not finite"),
        ({"policy": lambda seen: np.full((8, 2), 1e300)}, "environment 0 is out of the range of float32"),
        ({"obs": "rgb"}, r"evaluate_policy: there is no option 'obs'. Did you mean 'observation'\?"),
        ({"num_envs": 3}, "'num_envs' is not to be chosen here"),
        ({"scores": "yes"}, "scores must be True or False, not 'yes'"),
        ({"distances": "exact"}, r"distances must be a sequence of modes, such as \('exact',\), not 'exact'"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, message):
    arguments = {"policy": Linear(), "train": TRAIN, "test": TEST} | changes
    with pytest.raises(segar.SegarError, match=message):
        segar.evaluate_policy(arguments.pop("policy"), arguments.pop("train"), arguments.pop("test"), **arguments)


def test_a_level_set_is_shown_in_one_line_and_says_where_its_score_is():
    found = segar.evaluate_policy(Linear(), TRAIN, TEST, max_steps=3)
    assert repr(found.test).startswith("<8 levels, 8 episodes, return ") and len(repr(found.test)) < 120
    with pytest.raises(segar.SegarError, match=r"'score' is a figure of a level set.*found\.test\.score\(\)"):
        found.test.mean("score")


@pytest.mark.parametrize("name", ["score", "regret"])
def test_scores_that_were_not_asked_for_are_refused(name):
    with pytest.raises(segar.SegarError, match=r"evaluate_policy\(..., scores=True\)"):
        getattr(evaluation_of([-1.0, -2.0], [-3.0]).train, name)()


def test_both_sets_are_observed_in_the_units_of_training():
    train, test = (segar.family(name).sample(4, seed=0) for name in ("empty-easy", "empty-hard"))
    state = segar.observations.StateVector(normalise=True)
    seen = {}

    def idle(observations):
        seen.setdefault(len(seen), observations.copy())
        return np.zeros((len(observations), 2), np.float32)

    segar.evaluate_policy(idle, train[:1], test, observation=state, max_steps=1)
    env = segar.envs.VectorEnv(test, 4, observation=state.trained_on(train), seed=0)
    np.testing.assert_array_equal(seen[1], env.reset(options={"levels": np.arange(4)})[0])


def test_intervals_of_shares_end_where_shares_do():
    """One success in three levels, and none in three others: Student's interval would go from -1.1 to 1.8."""
    one, none = (LevelSetResult(played_with(success), 3) for success in ([True, False, False], [False] * 3))
    assert one.mean("success") == (pytest.approx(1 / 3), 0.0, 1.0)
    gap = Evaluation(one, none).gap("success")
    assert -1.0 <= gap.low < -0.9 and -1 / 3 < gap.high <= 1.0 and gap.value == pytest.approx(-1 / 3)
    assert np.isnan(LevelSetResult(played_with([True]), 1).mean("success").low)


def played_with(success, returns=None):
    """One episode on each level, one trial each."""
    n = len(success)
    zeros, first, no = np.zeros(n), np.zeros(n, np.int64), np.zeros(n, np.bool_)
    given = zeros if returns is None else returns
    return PlayedEpisodes(np.arange(n), given, zeros, np.ones(n, np.int64), np.array(success), no, first)
