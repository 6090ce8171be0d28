"""The served report: dots of runs are links, and a link makes the page of that run's agent, for this machine alone."""

import json
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import uvicorn
from starlette.testclient import TestClient

from segar.analysis.report.make import ReportConfig, report
from segar.experiments.settings import RunFolderError
from segar.experiments.training.run import run
from segar.playground import make_playground
from tests.experiments.short_runs import short_run

PAGE = """<figure id="figure_3a">
<div class="scroll" tabindex="0"><img style="--share: 1" alt="a figure" src="data:,"></div>
</figure>
<figure id="figure_2"><div class="scroll" tabindex="0"><img alt="no links" src="data:,"></div></figure>
"""


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    run(short_run(folder / "runs" / "agent"), print)
    (folder / "plan.json").write_text(json.dumps({"runs": str(folder / "runs")}))
    (folder / "figures").mkdir()
    (folder / "figures" / "figure_3a.svg").write_text('<?xml version="1.0"?>\n<svg><a xlink:href="play/agent"/></svg>')
    (folder / "figures" / "figure_2.svg").write_text("<svg></svg>")
    (folder / "report.html").write_text(PAGE)
    apps = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(uvicorn, "run", lambda app, **options: apps.append((app, options["host"])))
        report(ReportConfig(str(folder), serve=True))
    ((app, host),) = apps
    assert host == "127.0.0.1"
    return TestClient(app, base_url="http://127.0.0.1")


def test_a_dot_opens_its_agent_on_the_test_level_of_its_lowest_return(client, monkeypatch):
    made = create_autospec(make_playground, return_value=SimpleNamespace(html="its page"))
    monkeypatch.setattr("segar.analysis.report.serve.make_playground", made)
    page = client.get("/").text
    assert '<svg><a xlink:href="play/agent"/></svg>' in page and page.count("<img") == 1
    found = client.get("/play/agent")
    (levels,), options = made.call_args
    assert (found.status_code, found.text, len(levels)) == (200, "its page", 1)
    assert options["title"].startswith("agent: test level ") and options["policy"] is not None


@pytest.mark.parametrize("name", ["absent", "..", "%2e%2e"])
def test_a_run_that_is_not_there_is_said(client, name):
    found = client.get(f"/play/{name}")
    assert found.status_code == 404 or found.url.path == "/"
    if name == "absent":
        assert "absent is not there; the command that made the results trains the run again there" in found.text


def test_other_hosts_get_no_answer(client):
    assert client.get("/", headers={"host": "elsewhere.org"}).status_code == 400


def test_a_folder_without_a_report_is_refused(tmp_path):
    with pytest.raises(RunFolderError, match=r"report\.html is not there; make the report first"):
        report(ReportConfig(str(tmp_path), serve=True))
