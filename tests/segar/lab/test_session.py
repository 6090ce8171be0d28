"""Sessions: experiments within a budget, replayed to the bit; the protocol; bad requests cost nothing."""

import io
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import segar
from segar import SegarError, cli
from segar.lab import Lab, Session
from segar.lab.laws import law_in
from tests.segar.lab.conftest import DISTRIBUTION, SPACE, WORLD, replayed

START = {"golfball": {"Position": [0.1, -0.3], "Velocity": [0.5, 0.25], "Mass": 1.5, "Charge": -1.0}}
ACTIONS = [[0.5, 0.0], [0.0, -0.25], [0.0, 0.0]]


def test_an_environment_agrees_to_the_bit(lab):
    seen = Session(lab).experiment(level=3, set=START, actions=ACTIONS)
    states, _ = replayed(lab, {"level": 3}, ACTIONS, START)
    np.testing.assert_array_equal(seen, states.reshape(len(states), -1)[:, list(lab.places.values())])


def test_many_experiments_are_each_of_them(lab):
    session = Session(lab)
    together = session.experiment(level=[0, 1], set={"golfball": {"Mass": [0.5, 2.0]}}, actions=ACTIONS)
    for k, mass in enumerate((0.5, 2.0)):
        alone = session.experiment(level=k, set={"golfball": {"Mass": mass}}, actions=ACTIONS)
        assert np.array_equal(together[k], alone, equal_nan=True)
    assert session.left == lab.budget - 12


def test_the_true_law_predicts_what_is_seen_and_costs_nothing(lab):
    session = Session(lab)
    truth = law_in(lab.hidden, SPACE)
    assert np.array_equal(
        session.predict(truth, set=START, steps=5), session.experiment(set=START, steps=5), equal_nan=True
    )
    both = session.predict([truth, {"options": {}}], level=[1, 2], steps=4)
    assert both.shape == (2, 2, 5, len(lab.places)) and session.left == lab.budget - 5


def test_noise_has_its_size_differs_between_experiments_and_leaves_flags_alone():
    quiet, noisy = (Session(Lab(DISTRIBUTION, noise=noise, budget=8000)) for noise in (0.0, 0.2))
    experiment = {"level": [0] * 400, "steps": 10}
    apart = noisy.experiment(**experiment) - quiet.experiment(**experiment)
    assert not np.array_equal(apart, noisy.experiment(**experiment) - quiet.experiment(**experiment), equal_nan=True)
    is_flag = np.array([name.endswith(("Visible", "Alive")) for name in noisy.lab.places])
    assert (np.nan_to_num(apart[..., is_flag]) == 0).all()
    drawn = apart[..., ~is_flag][~np.isnan(apart[..., ~is_flag])]
    assert drawn.std() == pytest.approx(0.2, rel=0.02) and abs(drawn.mean()) < 0.005


def test_what_the_experimenter_is_told_does_not_depend_on_the_draw(lab):
    said, other = lab.language(), replace(lab, world=WORLD + 1).language()
    assert json.dumps(said) == json.dumps(other)
    assert set(said["options"]) == set(SPACE.names) and "golfball.Position.x" in said["seen"]
    assert said["options"]["force"]["constants"]["force_exponent"] == {"unit": "", "from": 0.0, "to": 3.0}
    assert "def central_power(" in said["options"]["force"]["rules"][0]["code"]
    assert {"Charge", "Magnetism"} <= set(said["unseen"]) and "Mass" not in said["unseen"]
    assert said["task"][0]["numbers"] == {"impulse": 2.0} and not [name for name in said["seen"] if "Charge" in name]


def test_a_passive_lab_gives_recordings_and_no_experiments(lab):
    session = Session(replace(lab, passive=True, budget=50))
    assert [len(one["actions"]) for one in session.recordings] == [20, 20, 10] and session.left == 0
    first = session.recordings[0]
    again = Session(lab).experiment(level=first["level"], actions=first["actions"])
    assert np.array_equal(first["observations"], again, equal_nan=True)
    with pytest.raises(SegarError, match="this lab is passive"):
        session.experiment(steps=1)


BAD_EXPERIMENTS = [
    ({}, "needs 'actions', or 'steps'"),
    ({"steps": 1, "actions": ACTIONS}, "and not both"),
    ({"steps": 0}, "takes 1 to 20 steps"),
    ({"steps": 10**30}, "'steps' must be int"),
    ({"steps": 21}, "takes 1 to 20 steps"),
    ({"level": 16, "steps": 1}, "'level' is 16, and must be from 0 to 15"),
    ({"level": 0.5, "steps": 1}, "'level' must be a whole number"),
    ({"level": [], "steps": 1}, "a list of experiments is empty"),
    ({"level": [0] * 11, "steps": 20}, "costs 220 steps, and 200 of the budget are left"),
    ({"actions": [[2.0, 0.0]]}, "'actions' is 2, and must be from -1 to 1"),
    ({"actions": [[float("nan"), 0.0]]}, "'actions' is nan, and must be"),
    ({"actions": [[0.0, 0.0], [0.0]]}, "'actions' must be lists of 2 numbers"),
    ({"steps": 1, "set": {"golfbal": {}}}, "no entity is called 'golfbal'. Did you mean 'golfball'"),
    ({"steps": 1, "set": {"golfball": {"Magnetism": 1.0}}}, "'set.golfball.Magnetism' cannot be set"),
    ({"steps": 1, "set": {"goal": {"Mass": 1.0}}}, "'set.goal.Mass': the entity has no Mass"),
    ({"steps": 1, "set": {"golfball": {"Mass": 0.1}}}, "'set.golfball.Mass' is 0.1, and must be from 0.5 to 2"),
    ({"steps": 1, "set": {"golfball": {"Position": 0.1}}}, "'set.golfball.Position' must be 2 numbers"),
    ({"level": [0, 1], "steps": 1, "set": {"golfball": {"Mass": [1.0] * 3}}}, "numbers of experiments do not agree"),
    ({"steps": 1, "colour": 1}, "'colour' is not known"),
]  # fmt: skip


@pytest.mark.parametrize(("experiment", "said"), BAD_EXPERIMENTS)
def test_bad_experiments_are_named_and_cost_nothing(lab, experiment, said):
    session = Session(lab)
    with pytest.raises(SegarError, match=said):
        session.experiment(**experiment)
    assert session.left == lab.budget and not session.log


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"{", "the request is no JSON"),
        (b"[" * 5000, "nested too deeply"),
        (b"[]", "'do' must be one of language, experiment, predict, answer, not None"),
        (b'{"do": "experment"}', "Did you mean 'experiment'"),
        (b'{"do": "experiment", "actions": [[NaN, 0]]}', "'actions' is nan"),
        (b'{"do": "experiment", "steps": 1, "x": "' + b"a" * 10_000_000 + b'"}', "may have 1048576 bytes"),
        (b'{"do": "predict", "steps": 1}', "needs 'law', or 'laws'"),
        (b'{"do": "predict", "steps": 1, "laws": []}', "'laws' is empty"),
        (b'{"do": "answer", "law": {"options": {"wind": {}}}}', "'law.options.wind' is not known"),
        (b'{"do": "answer", "answers": {"predict-3": 1}}', "'answers.predict-3' answers no question that waits"),
        (b'{"do": "answer", "answers": {}}', "no question waits for answers"),
        (b'{"do": "answer", "law": {}, "answers": {}}', "'law' or 'answers', and not both"),
    ],
)
def test_bad_requests_are_named_and_the_session_goes_on(lab, line, said):
    session, replies = Session(lab), io.StringIO()
    session.serve(io.BytesIO(line + b'\n{"do": "experiment", "steps": 2}\n'), replies)
    first, second = map(json.loads, replies.getvalue().splitlines())
    assert said in first["error"] and second["left"] == lab.budget - 2


def test_a_law_is_graded_once_and_ends_the_experiments(lab, grader):
    session, law = Session(lab), {"options": {"drag": {"drag_coefficient": 1.0}}}
    session.experiment(steps=1)
    assert session.answer(law=law)["grade"] == grader.grade(law).data()
    for refused in ({"do": "experiment", "steps": 1}, {"do": "answer", "law": law}):
        with pytest.raises(SegarError, match=r"are over|given already"):
            session.do(refused)
    assert session.predict(law, steps=1).shape == (2, len(lab.places))


def test_a_session_is_kept_resumed_and_replayed_to_the_bit(lab, tmp_path):
    noisy, path = replace(lab, noise=0.1), tmp_path / "session.jsonl"
    session, whole = Session(noisy), Session(noisy)
    session.file = path
    for one in (session, whole):
        one.experiment(level=[0, 1], set={"golfball": {"Mass": np.array([0.5, 1 / 3 + 0.5])}}, steps=3)
    resumed = Session.load(path, noisy)
    assert resumed.left == session.left == noisy.budget - 6
    assert np.array_equal(resumed.experiment(steps=2), whole.experiment(steps=2), equal_nan=True)
    assert json.loads(path.read_text().splitlines()[1])["reply"]["left"] == session.left
    with pytest.raises(SegarError, match="no session in this lab"):
        Session.load(path, lab)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[1].replace("0.5", "0.6", 1)]))
    with pytest.raises(SegarError, match="line 2: the reply to this request is another one now"):
        Session.load(path, noisy)
    path.write_text("\n".join([lines[0], '{"request": {"do": "experiment"}, "reply": {}}']))
    with pytest.raises(SegarError, match="line 2: an experiment needs"):
        Session.load(path, noisy)
    for text, said in (
        ("", "no session in this lab"),
        ("{", "is not a session"),
        (f"{lines[0]}\n3", "line 2: 'all' must be"),
    ):
        path.write_text(text)
        with pytest.raises(SegarError, match=said):
            Session.load(path, noisy)
    with pytest.raises(SegarError, match="there is no session"):
        Session.load(tmp_path / "nothing", noisy)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"budget": 0}, "budget must be a whole number from 1"),
        ({"noise": -1.0}, "noise must be"),
        ({"world": True}, "world must"),
    ],
)
def test_wrong_labs_are_named(wrong, said):
    with pytest.raises(SegarError, match=said):
        Lab(DISTRIBUTION, **wrong)


def test_worlds_without_a_rule_space_or_with_chance_are_refused():
    @segar.rule
    def tremble(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
        return segar.Differential[segar.Velocity](v, (segar.random.normal(), segar.random.normal()))

    with pytest.raises(SegarError, match="give them a rule space"):
        Lab(segar.family("objectsx1-hard"))
    with pytest.raises(SegarError, match="draws random numbers"):
        Lab(segar.family("objectsx1-hard").with_rules(segar.rules.RuleSpace([tremble], active=1)))


SERVE = ["lab", "serve", "--world", "tests.segar.lab.conftest:SPACE", "--hidden", str(WORLD), "--noise", "0"]


def test_the_command_serves_lines_and_goes_on_with_a_session(lab, tmp_path, monkeypatch, capsys):
    request = b'{"do": "experiment", "level": 3, "actions": [[0.5, 0.0], [0.0, -0.25], [0.0, 0.0]]}\n'
    for left in (27, 24):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(request)))
        assert cli.main([*SERVE, "--budget", "30", "--session", str(tmp_path / "s.jsonl")]) == 0
        reply = json.loads(capsys.readouterr().out)
        seen = Session(lab).experiment(level=3, actions=ACTIONS)
        assert reply["left"] == left
        assert np.array_equal(np.array(reply["observations"], float), seen, equal_nan=True)


@pytest.mark.slow
def test_an_agent_speaks_the_model_context_protocol(lab):
    anyio, mcp = pytest.importorskip("anyio"), pytest.importorskip("mcp")
    truth = law_in(lab.hidden, SPACE)

    async def speak():
        server = mcp.StdioServerParameters(command=sys.executable, args=["-m", "segar", *SERVE, "--mcp"])
        async with mcp.stdio_client(server) as streams, mcp.ClientSession(*streams) as client:
            said = await client.initialize()
            tools = await client.list_tools()

            async def call(name, **arguments):
                found = await client.call_tool(name, arguments)
                return json.loads(found.content[0].text)

            seen = await call("experiment", level=1, steps=4)
            foreseen = await call("predict", law=truth, level=1, steps=4)
            wrong = await call("experiment", steps=500)
            questions = await call("answer")
            grade = await call("answer", law=truth)
            return said, [tool.name for tool in tools.tools], seen, foreseen, wrong, questions, grade

    with ThreadPoolExecutor(1) as apart:  # tests in a browser leave a loop in their thread
        said, tools, seen, foreseen, wrong, questions, grade = apart.submit(anyio.run, speak).result()
    assert (
        tools == ["experiment", "predict", "answer"] and json.loads(said.instructions)["aim"] == lab.language()["aim"]
    )
    assert seen["observations"] == foreseen["observations"] and seen["left"] == lab.budget - 4
    assert "takes 1 to 20 steps" in wrong["error"] and len(questions["questions"]) == 9
    assert grade["grade"]["score"]["value"] == 1.0
