"""A studio answers what the library answers, to its own page and to nobody else."""

import http.client
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

import segar
from segar.cli import main
from segar.hardness import hardness, influence, plan, replay
from segar.metrics import ks_report, w2_report
from segar.playground import Studio, make_playground
from segar.playground.server import MOST_BYTES, StudioServer
from segar.playground.studio import FORMS
from tests.places import ROOT
from tests.segar.playground.browsers import Chromium
from tests.segar.playground.test_policies import LEVELS as OTHER
from tests.segar.playground.test_policies import perceptron
from tests.waiting import PATIENCE, until

TRAIN = segar.family("empty-hard").sample(6, seed=1)
TEST = segar.family("empty-easy").sample(5, seed=2, split="test")
TEXT = """LevelDistribution(
    numbers=[(GolfBall, 1), (GoalTile, 1)],
    priors=[Prior(Position, RandomUniformLocation()), Prior(Mass, UniformNoise(2.0, 3.0), entity_type=GolfBall)],
)"""


class Client:
    """Asks a server, as its page does unless it is told otherwise."""

    def __init__(self, address: str) -> None:
        self.address, self.version = address, 0
        self.host, self.path = urlsplit(address)[1:3]
        self.headers = {"Origin": f"http://{self.host}", "Content-Type": "application/json"}

    def begin(self, method: str, path: str, body: bytes | None = None, **headers: str) -> http.client.HTTPConnection:
        """A connection on which an answer is waited for."""
        connection = http.client.HTTPConnection(self.host, timeout=PATIENCE)
        connection.request(method, path, body, headers)
        return connection

    def request(self, *question: Any, **headers: str) -> tuple[int, dict[str, str], bytes]:
        connection = self.begin(*question, **headers)
        response = connection.getresponse()
        found = response.status, {name.lower(): value for name, value in response.getheaders()}, response.read()
        connection.close()
        return found

    def page(self) -> bytes:
        status, _, body = self.request("GET", self.path)
        assert status == 200
        return body

    def ask(self, name: str, **question: Any) -> tuple[int, dict[str, Any]]:
        if "version" in FORMS[name]:
            question = {"version": self.version} | question
        body = json.dumps(question).encode()
        status, _, answer = self.request("POST", f"{self.path}{name}", body, **self.headers)
        found = json.loads(answer)
        self.version = found.get("version", self.version)
        return status, found

    def begin_to_ask(self) -> http.client.HTTPConnection:
        return self.begin("POST", self.path + "runs", b"{}", **self.headers)

    def answer(self, name: str, **question: Any) -> dict[str, Any]:
        status, answer = self.ask(name, **question)
        assert status == 200, answer
        return answer


@contextmanager
def serving(studio: Any) -> Iterator[Client]:
    """A client of a server that runs in a thread until the block ends."""
    server = StudioServer(studio)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield Client(server.address)
    finally:
        server.stop()
        thread.join(20)
    assert not thread.is_alive()


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """Of a studio in which nobody draws."""
    with serving(Studio(TRAIN, TEST, observations=["state"])) as found:
        yield found


def test_only_the_page_of_the_studio_is_served_and_only_below_its_token(client: Client) -> None:
    status, headers, body = client.request("GET", client.path)
    assert status == 200
    assert "connect-src 'self'" in body.decode()
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert "access-control-allow-origin" not in headers
    assert "connect-src" not in make_playground(TRAIN, observations=["state"]).html  # a page in a file asks nobody
    own = (client.path.rstrip("/"), client.path + "draw", client.path + "../etc/passwd")
    for path in ("/", "/wrong/", "/static/x", *own):
        assert client.request("GET", path)[::2] == (404, b""), path
    for path in (client.path[:-3] + "xx/runs", client.path + "__class__"):
        assert client.request("POST", path, b"{}", **client.headers)[::2] == (404, b""), path


def test_other_hosts_and_other_origins_are_refused(client: Client) -> None:
    port = int(client.host.partition(":")[2])
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"0.0.0.0:{port}", f"127.0.0.1:{port + 1}"):
        assert client.request("GET", client.path, Host=host)[::2] == (403, b"")
    assert client.request("GET", client.path, Host=f"localhost:{port}")[0] == 200
    for origin in ("null", "http://evil.example", f"http://localhost:{port}", "http://127.0.0.1", None):
        headers = {"Content-Type": "application/json"} | ({"Origin": origin} if origin else {})
        assert client.request("POST", client.path + "runs", b"{}", **headers)[::2] == (403, b""), origin
    assert client.request("OPTIONS", client.path + "runs", **client.headers)[0] == 405


def test_questions_of_another_kind_size_or_form_are_refused(client: Client) -> None:
    def said(body: bytes, **headers: str) -> tuple[int, str]:
        status, _, answer = client.request("POST", client.path + "distance", body, **{**client.headers, **headers})
        return status, json.loads(answer)["error"]

    assert said(b"{}", **{"Content-Type": "text/plain"})[0] == 415
    assert said(b" " * (MOST_BYTES + 1)) == (413, "a question has at most 1,000,000 bytes")
    assert said(b"{")[0] == 400
    assert said(b"[" * 100_000)[0] == 400
    assert said(b"[]") == (422, "distance: 'all' must be a mapping, not a list of 0")
    assert said(b'{"version": "0"}') == (422, "distance: 'version' must be int, not '0'")
    status, why = said(b'{"version": 7}')
    assert status == 422 and "reload the page" in why
    assert client.ask("policy", run="\ud800")[0] == 422  # half of a character, which the answer repeats
    assert client.ask("hardness", set=2) == (422, {"error": "there are 2 level sets here, and no set 2"})


def test_a_draw_is_that_of_the_library_and_the_page_shows_it() -> None:
    names: dict[str, Any] = {}
    exec(f"from segar import *\nexpected = {TEXT}", names)
    expected = names["expected"]
    studio, question = Studio(TRAIN, TEST, observations=["state"]), {"set": 0, "text": TEXT, "seed": 9, "split": "mine"}
    with serving(studio) as client:
        before = client.page()
        answer = client.answer("draw", **question, number=4)
        assert answer["version"] == 1 and answer["name"] == "empty-hard, edited"
        assert answer["distribution"] == expected.hash
        studio.answer("draw", {"version": 0, **question, "number": 4})  # the server's process has a studio of its own
        drawn = studio.sides[0].levels
        assert np.array_equal(drawn.values, expected.sample(4, seed=9, split="mine").values, equal_nan=True)
        assert client.page() == studio.html.encode() != before
        assert client.answer("draw", **question, number=3)["name"] == "empty-hard, edited"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"text": "LevelDistribution(\n numbers=[(Nothing, 1)])"}, "line 2: there is no 'Nothing' here"),
        ({"text": "LevelDistribution(numbers=[(GolfBall, 1), (GoalTile, 1)])"}, "always start 0 apart"),
        ({"text": TEXT.replace("UniformNoise(2.0, 3.0)", "Empirical([])")}, "line 3: Empirical"),
        ({"number": 0}, "1 to 2,000 levels, not 0"),
        ({"number": 2001}, "1 to 2,000 levels, not 2001"),
        ({"number": 1.5}, "'number' must be int, not 1.5"),
        ({"set": -1}, "no set -1"),
        ({"text": TEXT.replace("(GolfBall, 1)", f"(GolfBall, {10**8})")}, "from 0 to 1,000"),
        ({"text": TEXT.replace("(GolfBall, 1)", "(GolfBall, 1000)"), "number": 1000}, "can have 1,001,000 things"),
    ],
)
def test_a_draw_that_cannot_be_leaves_everything_as_it_is(client: Client, change: dict[str, Any], why: str) -> None:
    before = client.page()
    status, answer = client.ask("draw", **({"set": 0, "text": TEXT, "seed": 0, "split": "train", "number": 3} | change))
    assert status == 422 and why in answer["error"]
    assert client.page() == before


def test_distances_are_those_of_the_library(client: Client) -> None:
    found = client.answer("distance")
    w2 = w2_report(TRAIN, TEST, rng=np.random.default_rng(0), resamples=100)
    ks = ks_report(TRAIN, TEST, rng=np.random.default_rng(0), resamples=199)
    assert [found["w2"][name] for name in ("value", "low", "high", "floor", "p_value")] == [
        w2.value, w2.low, w2.high, w2.floor, w2.p_value,
    ]  # fmt: skip
    assert (found["ks"]["value"], found["ks"]["p_value"]) == (ks.value, ks.p_value)
    assert [one["name"] for one in found["ks"]["factors"]] == [one.name for one in ks.factors]


def test_one_set_has_no_distance_and_a_file_no_distribution(tmp_path: Path) -> None:
    TRAIN.save(tmp_path / "levels.npz")
    studio = Studio(segar.Levels.load(tmp_path / "levels.npz"), observations=["state"])
    with pytest.raises(segar.SegarError, match="start the studio with --test"):
        studio.answer("distance", {"version": 0})
    question = {"version": 0, "set": 0, "text": TEXT, "seed": 0, "split": "train", "number": 3}
    with pytest.raises(segar.SegarError, match="come from a file"):
        studio.answer("draw", question)
    assert Studio(TRAIN, observations=["state"]).sides[0].text


def test_a_plan_is_that_of_the_library_on_the_level_as_the_page_has_it(client: Client, tmp_path: Path) -> None:
    TRAIN[2].save(tmp_path / "level.json")
    data = json.loads((tmp_path / "level.json").read_text())
    data["levels"][0]["entities"]["golfball"]["factors"]["Mass"] = 2.5
    (tmp_path / "level.json").write_text(json.dumps(data))
    level = segar.Levels.load(tmp_path / "level.json")
    found = client.answer("plan", set=0, level=json.dumps(data), seed=str(2**59))
    best = plan(level, rng=np.random.default_rng(0), seed=2**59)
    assert replay(level, best).all()
    assert (found["return"], found["steps"], found["solved"]) == (best.returns[0], best.steps[0], best.solved[0])
    assert np.array_equal(np.array(found["actions"], np.float32), best.actions[0, : best.steps[0]])
    assert found["path"][0] == level.values[0, 0, :2].tolist()
    assert found["path"][-1] == best.values[0, 0, :2].tolist()
    for wrong, why in (
        ("{", "the level of the page is not a level file in JSON"),
        ("\ud800", "is not a level"),
        ('{"format": "x"}', "the level of the page"),
    ):
        status, answer = client.ask("plan", set=0, level=wrong, seed="0")
        assert status == 422 and why in answer["error"]
    for seed in ("x", "-1", "", "9" * 19):
        assert client.ask("plan", set=0, level=json.dumps(data), seed=seed)[0] == 422


def test_the_task_that_a_level_names_is_not_imported(client: Client, tmp_path: Path) -> None:
    TRAIN[0].save(tmp_path / "level.json")
    data = json.loads((tmp_path / "level.json").read_text())
    data["description"]["task"] = "antigravity:fly"
    assert client.answer("plan", set=0, level=json.dumps(data), seed="0")["steps"] > 0
    assert "antigravity" not in sys.modules


def test_hardness_is_that_of_the_library(client: Client) -> None:
    found = client.answer("hardness", set=1)
    expected = hardness(TEST, rng=np.random.default_rng(0))
    assert found["summary"] == json.loads(json.dumps(expected.summary()))
    assert found["levels"] == json.loads(json.dumps(expected.rows()))
    factors = influence(TEST, rng=np.random.default_rng(0)).factors
    assert [one["factor"] for one in found["factors"]] == [one.factor for one in factors if one.kind == "endogenous"]


class Greedy:
    """A studio that keeps an array of as many MiB as a question says."""

    def __init__(self) -> None:
        self.html: str = "a page"
        self.kept: list[np.ndarray] = []

    def answer(self, name: str, question: Any) -> dict[str, Any]:
        self.kept.append(np.ones(question["set"] * 2**20 // 8))
        return {"kept": len(self.kept)}


def test_what_takes_more_memory_than_the_studio_may_is_refused_by_its_size_and_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("segar.playground.server.MOST_MEMORY", 2**29)
    with serving(Greedy()) as client:
        status, answer = client.ask("hardness", set=100_000)
        assert status == 422 and "hardness: this takes more memory" in answer["error"]
        assert "Unable to allocate 97.7 GiB" in answer["error"] and "at most 0.5 GiB" in answer["error"]
        taken = [client.ask("hardness", set=150) for _ in range(6)]
        kept = [answer["kept"] for status, answer in taken if status == 200]
        assert kept == list(range(1, len(kept) + 1)) and 1 <= len(kept) <= 3  # of all questions together
        assert taken[-1][0] == 422 and client.answer("hardness", set=1) == {"kept": len(kept) + 1}


class Slow:
    """A studio whose work never ends, in a process and in one that this one starts; it does not even hear signals."""

    def __init__(self, folder: Path) -> None:
        self.html, self.version, self.pids = "a page", 0, folder / "pids"

    def answer(self, name: str, question: Any) -> dict[str, Any]:
        if "x" in question:
            self.version += 1
            self.html = f"page {self.version}"
            return {"version": self.version}
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
        other = subprocess.Popen(["sleep", "1000"])
        self.pids.with_suffix(".new").write_text(f"{os.getpid()} {other.pid}")
        self.pids.with_suffix(".new").rename(self.pids)
        while True:
            pass

    def wait(self) -> list[int]:
        """The processes that work, once they do."""
        until(self.pids.exists)
        found = [int(one) for one in self.pids.read_text().split()]
        self.pids.unlink()
        return found


def is_alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_one_question_at_a_time_and_work_for_nobody_is_ended(tmp_path: Path) -> None:
    slow = Slow(tmp_path)
    with serving(slow) as client:
        for version in (1, 2):
            waiting = client.begin_to_ask()
            pids = slow.wait()
            status, answer = client.ask("runs")
            assert status == 409 and "at work (runs, for" in answer["error"]
            assert client.page() and all(map(is_alive, pids))
            waiting.close()
            until(lambda pids=pids: not any(map(is_alive, pids)))
            assert client.answer("runs", x=1) == {"version": version}  # what was done before is there
            assert client.page() == f"page {version}".encode()
        waiting, pids = client.begin_to_ask(), slow.wait()  # when the server ends
    assert waiting.getresponse().status == 503
    waiting.close()
    until(lambda: not any(map(is_alive, pids)))


def test_work_that_the_system_ends_is_told_and_changes_nothing(tmp_path: Path) -> None:
    slow = Slow(tmp_path)
    with serving(slow) as client:
        waiting = client.begin_to_ask()
        os.kill(slow.wait()[0], signal.SIGKILL)
        response = waiting.getresponse()
        assert response.status == 500 and b"the system ended the work, perhaps for lack of memory" in response.read()
        waiting.close()
        assert client.answer("runs", x=1) == {"version": 1}


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_no_process_outlives_the_server(tmp_path: Path, end: signal.Signals) -> None:
    program = (
        "import pathlib\n"
        "from segar.playground.server import StudioServer\n"
        "from tests.segar.playground.test_studio import Slow\n"
        f"server = StudioServer(Slow(pathlib.Path({str(tmp_path)!r})))\n"
        "print(server.address, flush=True)\n"
        "try:\n    server.run()\nexcept KeyboardInterrupt:\n    pass\n"
    )
    process, line = begun("-c", program)
    waiting = Client(line.strip()).begin_to_ask()
    pids = Slow(tmp_path).wait()
    process.send_signal(end)
    _, errors = process.communicate(timeout=PATIENCE)
    assert errors == ""
    until(lambda: not any(map(is_alive, pids)))
    waiting.close()


def begun(*arguments: str) -> tuple[subprocess.Popen[str], str]:
    """A process of Python, and the first line that it prints."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen([sys.executable, *arguments], cwd=ROOT, text=True, **pipes)
    assert process.stdout is not None
    return process, process.stdout.readline()


@pytest.mark.slow
def test_policies_of_runs_are_listed_and_play_and_none_from_elsewhere(tmp_path: Path) -> None:
    runs, outside = tmp_path / "runs", tmp_path / "outside"
    for folder in (runs / "a" / "evaluations" / "last", outside, runs / "b", runs / "other"):
        folder.mkdir(parents=True)
        perceptron("state", OTHER if folder.name == "other" else TRAIN).save(folder / "network.npz")
    (runs / "linked").symlink_to(outside)
    (runs / "c").mkdir()
    (runs / "c" / "network.npz").symlink_to(outside / "network.npz")
    (runs / "b" / "config.yaml").symlink_to(outside / "config.yaml")
    studio = Studio(TRAIN, observations=["state"], runs=runs)
    assert studio.answer("runs", {}) == {"runs": ["a/evaluations/last", "other"], "run": None}
    before = studio.html
    assert studio.answer("policy", {"version": 0, "run": "a/evaluations/last"}) == {"version": 1}
    assert studio.html != before
    for wrong in ("../outside", "b", "c", "linked", str(outside), ""):
        with pytest.raises(segar.SegarError, match="there is no run"):
            studio.answer("policy", {"version": 1, "run": wrong})
    with pytest.raises(segar.SegarError, match="reads"):
        studio.answer("policy", {"version": 1, "run": "other"})
    assert studio.run == "a/evaluations/last"
    assert studio.answer("policy", {"version": 1, "run": None}) == {"version": 2}


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["empty-harder"], "Did you mean 'empty-hard'"),
        (["empty-hard", "--runs", "nowhere"], "--runs: there is no folder nowhere"),
        (["empty-hard", "--port", "70000"], "--port: there are ports up to 65535, and no 70000"),
        (["empty-hard", "-n", "2001"], "at most 2,000 levels"),
    ],
)
def test_a_studio_that_cannot_be_is_told(arguments: list[str], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["studio", *arguments, "--no-browser"]) == 2
    assert why in capsys.readouterr().err


def test_a_port_that_is_taken_is_told(client: Client) -> None:
    port = int(client.host.partition(":")[2])
    with pytest.raises(segar.SegarError, match=f"--port: {port} cannot be used"):
        StudioServer(Studio(TRAIN, observations=["state"]), port)


def test_the_command_prints_its_address_and_ends_with_ctrl_c() -> None:
    process, line = begun(*shlex.split("-m segar studio empty-hard -n 3 --observation state --no-browser"))
    address = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{43}/", line)
    assert address is not None and Client(address[0]).page()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    assert (process.returncode, [line for line in errors.splitlines() if "compiling" not in line]) == (0, [])


def test_a_person_edits_a_prior_draws_measures_and_plans(chromium: Chromium) -> None:
    with serving(Studio(TRAIN, TEST, observations=["state"])) as client:
        chromium.visit(client.address)
        page = chromium.page
        chromium.until("!!window.playground")
        refused = [
            (TEXT.replace("2.0, 3.0", "3.0, 2.0"), "line 3: UniformNoise"),
            ("LevelDistribution(", "line 1: this is no Python"),
        ]
        for text, why in refused:
            page.fill("#studio-text", text)
            page.click("text=Draw levels")
            chromium.until(f"document.querySelector('[role=alert].note').textContent.includes({why!r})")
        page.fill("#studio-text", TEXT)
        page.fill("#studio-number", "7")
        page.fill("#studio-seed", "3")
        with page.expect_navigation():
            page.click("text=Draw levels")
        chromium.until("window.playground?.levels.count === 7")
        mass = page.evaluate("window.playground.levels.factor(4, 0, 'Mass')")
        assert 2 <= mass[0] <= 3
        assert page.input_value("#studio-text") == TEXT
        page.click("text=Measure distances")
        page.wait_for_selector("text=Between 7 and 5 levels")
        page.click("text=Plan this level")
        page.wait_for_selector("text=/after \\d+ steps, return/")
        steps = page.evaluate("window.playground.studio.ghost().length") - 1
        page.select_option("#speed", "4")
        page.click("text=Play the plan")
        chromium.until("window.playground.world.over")
        said = page.inner_text("#status")
        assert f"step {steps} of" in said and "success" in said
        page.click("#next")
        assert page.evaluate("window.playground.studio.ghost()") is None
        page.click("text=Hardness of this set")
        page.wait_for_selector("text=From the hardest")
        chromium.assert_accessible()
        refusals = [one for one in chromium.messages if "422" not in one]  # the browser's own words on refused draws
        assert refusals == [] and len(chromium.messages) <= 2
        assert all(one.startswith((client.address, "blob:", "data:")) for one in chromium.requests)


def test_a_person_chooses_a_run_whose_policy_then_plays(chromium: Chromium, tmp_path: Path) -> None:
    for name, levels in (("good", TRAIN), ("other", OTHER)):
        (tmp_path / name).mkdir()
        perceptron("state", levels).save(tmp_path / name / "network.npz")
    studio = Studio(TRAIN, observations=["state"], runs=tmp_path)
    with serving(studio) as client:
        chromium.visit(client.address)
        page = chromium.page
        chromium.until("!!window.playground && document.querySelectorAll('option[value=good]').length === 1")
        page.select_option("label:has-text('Policy of the run') select", "other")
        page.click("text=Let it play")
        chromium.until(
            "[...document.querySelectorAll('[role=alert].note')].some((one) => one.textContent.includes('reads'))"
        )
        page.select_option("label:has-text('Policy of the run') select", "good")
        with page.expect_navigation():
            page.click("text=Let it play")
        chromium.until("!!window.playground?.policy")
        chromium.until("document.querySelector('option[value=good]')?.selected === true")


def test_work_is_stopped_by_its_button(chromium: Chromium, tmp_path: Path) -> None:
    studio, slow = Studio(TRAIN, observations=["state"]), Slow(tmp_path)
    studio.answer = slow.answer  # type: ignore[method-assign]
    with serving(studio) as client:
        chromium.visit(client.address)
        page = chromium.page
        chromium.until("!!window.playground")
        page.click("text=Plan this level")
        pids = slow.wait()
        page.click("text=Stop")
        page.wait_for_selector("text=Stopped.")
        assert page.is_enabled("text=Plan this level")
        until(lambda: not any(map(is_alive, pids)))
