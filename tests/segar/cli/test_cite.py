"""``segar cite``: entries for a bibliography, and what a run was made with, read from its folder as data."""

import json
import re

import pytest
import yaml

import segar
from segar import cli
from segar.cli import cite
from segar.experiments.settings import RunConfig
from tests.places import ROOT
from tests.synthetic_runs import settings, write_run

CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())


@pytest.fixture
def run(tmp_path):
    """The folder of a finished run."""
    return write_run(settings(tmp_path, seed=7), code={"kernel": "a" * 16, "learner": "b" * 16})


def shown(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert cli.main(["cite", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert cli.main(["cite", *map(str, arguments)]) == cli.USAGE_ERROR
    return capsys.readouterr().err


def doubled(line: str) -> str:
    """A text of YAML in which each of forty parts mentions the one before it twice."""
    return "\n".join(["a0: &a0 {x: 1}", *(line.format(k, k - 1) for k in range(1, 41))])


def test_without_a_run_it_prints_both_entries_and_the_versions_that_are_installed(capsys):
    text = shown(capsys)
    assert re.findall(r"^@(\w+)\{(\w+),$", text, re.M) == [("software", "segar"), ("misc", "hjelm2022segar")]
    assert f"version = {{{segar.__version__}}}" in text and text.count("{") == text.count("}")
    assert re.search(r"^  gymnasium +\d", text, re.M)


def test_the_entries_say_what_the_citation_file_says():
    (paper,) = CITATION["references"]
    authors = [f"{author['family-names']}, {author['given-names']}" for author in paper["authors"]]
    assert cite.PAPER["author"] == " and ".join(authors)
    assert cite.PAPER["title"].replace("{", "").replace("}", "") == paper["title"]
    assert cite.PAPER["year"] == str(paper["year"])
    assert paper["identifiers"][0]["value"] == f"arXiv:{cite.PAPER['eprint']}"
    assert cite.SOFTWARE["title"].replace("{", "").replace("}", "") == CITATION["title"]
    assert cite.SOFTWARE["author"] == f"{{{CITATION['authors'][0]['name']}}}"


def test_of_a_run_it_states_versions_hashes_seeds_and_settings(capsys, run):
    text = shown(capsys, run)
    lines = ("torch +2.13.0", "commit +(89abcdef){5}", "kernel +a{16}", "learner +b{16}", "seed +7", "levels.train ")
    for line in lines:
        assert re.search(rf"^  {line}", text, re.M), line


def test_the_settings_are_those_that_decide_the_results(capsys, run):
    answer = json.loads(shown(capsys, run, "--json"))
    assert {name.partition(".")[0] for name in answer["settings"]} == {*RunConfig().identity()}
    assert answer["seeds"] == {"seed": 7, "levels.seed": 0, "levels.test_seed": 0, "evaluation.seed": 0}
    assert answer["run"] == {"name": run.name, "finished": True}
    (run / "summary.json").unlink()
    assert json.loads(shown(capsys, run, "--json"))["run"]["finished"] is False


def test_the_entry_of_a_run_has_its_version_and_not_the_one_installed(capsys, run):
    made = json.loads((run / "versions.json").read_text())
    for release in ("0.0.9", None):  # None: a checkout that was not installed
        made["libraries"]["segar"] = release
        (run / "versions.json").write_text(json.dumps(made))
        assert re.findall(r"^  version = \{(.*)\},$", shown(capsys, run), re.M) == ([release] if release else [])


def test_settings_name_no_address_and_no_folder_and_the_code_that_they_name_is_not_imported(
    capsys, run, tmp_path, monkeypatch
):
    (tmp_path / "trap.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    data = yaml.safe_load((run / "config.yaml").read_text())
    data["task"]["name"] = "trap:make"
    data["tracking"]["uri"] = "postgresql://me:secret@server/db"
    (run / "config.yaml").write_text(yaml.safe_dump(data))
    text = shown(capsys, run)
    assert "trap:make" in text and "secret" not in text and str(tmp_path) not in text


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("config.yaml", None, "is no run folder: there is no config.yaml"),
        ("config.yaml", "a: [", "config.yaml is not a file of a run"),
        ("config.yaml", "- 1", "config.yaml: 'all' must be a mapping, not a list of 1"),
        ("config.yaml", "seed: 1", "config.yaml: 'scale' is absent"),
        ("config.yaml", "scale: {frames: 1}\ntask: &a {b: *a}", "a part of it contains itself"),
        ("config.yaml", doubled("a{0}: &a{0} {{x: *a{1}, y: *a{1}}}"), "it stands for more than 1,000,000 values"),
        ("config.yaml", doubled("a{0}: &a{0} {{<<: [*a{1}, *a{1}]}}"), "it stands for more than 1,000,000 values"),
        ("config.yaml", "a: " + "[" * 20_000, "config.yaml is not a file of a run"),
        ("config.yaml", "!!python/object/apply:os.system [exit]", "config.yaml is not a file of a run"),
        ("config.yaml", b"\xff\xfe\x00", "config.yaml is not a file of a run"),
        ("versions.json", None, "never began to train: there is no versions.json"),
        ("versions.json", "{", "versions.json is not a file of a run"),
        ("versions.json", "[]", "versions.json: 'all' must be a mapping, not a list of 0"),
        ("versions.json", "{}", "'libraries' is absent"),
        ("versions.json", '{"libraries": {}, "git": 3}', "'git' must be dict or null, not 3"),
        ("summary.json", "3", "summary.json: 'all' must be dict, not 3"),
    ],
)
def test_what_is_no_run_is_refused_with_the_file_that_says_so(capsys, run, file, content, message):
    (run / file).unlink()
    if content is not None:
        (run / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert message in refusal(capsys, run)
