"""Policies by name: what a row has, from the results that are here or fetched, or a message that says what there is."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

import segar
from segar.policies import Network, NetworkPolicy, load
from tests.places import ROOT

RESULTS = ROOT / "docs" / "results"
ROW, SUITE = "ppo_fast-state-laptop", "place-few-v1"
FILE = f"benchmark/{ROW}/{SUITE}-s1.npz"


@pytest.fixture
def elsewhere(tmp_path):
    """A folder of results that has the manifest, in which one file of the clone is published, and not the file."""
    content = (RESULTS / FILE).read_bytes()
    digest = segar.support.sha256_of(RESULTS / FILE, "file", segar.errors.SegarError)
    (tmp_path / "manifest.csv").write_text(f"path,bytes,sha256,made_by\n{FILE},{len(content)},{digest},again\n")
    return tmp_path


def test_a_policy_by_name_is_that_of_its_file():
    agent, same = load(ROW, SUITE), NetworkPolicy(Network.load(RESULTS / FILE))
    seen = np.random.default_rng(0).normal(size=(5, *agent.network.observation_shape)).astype(np.float32)
    assert (agent(seen) == same(seen)).all() and (agent.act(seen[3]) == same(seen)[3]).all()


def test_every_suite_of_the_core_has_an_agent_in_the_clone():
    published = {one.path for one in segar.support.read_manifest(RESULTS)}
    rows = {name: "ppo_fast-rgb_stack2-laptop" if name == "look-far-v1" else ROW for name in segar.suites.CORE}
    files = {f"benchmark/{row}/{name}-s1.npz" for name, row in rows.items()}
    assert all((RESULTS / file).exists() for file in files) and not files & published


def test_torch_is_not_loaded():
    code = f"import sys, segar; segar.policies.load({ROW!r}, {SUITE!r}); print('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def test_a_policy_that_is_not_here_is_fetched_and_kept(elsewhere, tmp_path_factory, monkeypatch):
    store = tmp_path_factory.mktemp("store")
    (store / FILE).parent.mkdir(parents=True)
    shutil.copy(RESULTS / FILE, store / FILE)
    monkeypatch.setenv("SEGAR_RESULTS_URL", store.as_uri())
    load(ROW, SUITE, results=elsewhere)
    monkeypatch.delenv("SEGAR_RESULTS_URL")
    load(ROW, SUITE, results=elsewhere)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((ROW, "place-fex-v1"), SUITE),
        ((ROW, SUITE, 99), "s99"),
        (("../../" + ROW, SUITE), "benchmark/../../"),
    ],
)
def test_what_is_not_published_is_named(arguments, named):
    with pytest.raises(segar.errors.SegarError, match=named):
        load(*arguments)


def test_without_an_address_the_message_says_so(elsewhere, monkeypatch):
    monkeypatch.delenv("SEGAR_RESULTS_URL", raising=False)
    with pytest.raises(segar.errors.SegarError, match="SEGAR_RESULTS_URL"):
        load(ROW, SUITE, results=elsewhere)
