"""The examples in docstrings run, and give what they say."""

import doctest
import importlib

import numpy as np
import pytest

import segar
from tests.places import ROOT, sources

pytestmark = pytest.mark.docs

FILES = [path for room in ("segar", "experiments", "analysis") for path in sources(room)]
NAMES = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in FILES if ">>> " in path.read_text()]
MODULES = [name if name.startswith("segar.") else f"segar.{name}" for name in NAMES]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_say(name):
    failed, tried = doctest.testmod(importlib.import_module(name), extraglobs={"segar": segar, "np": np})
    assert tried
    assert not failed


def test_there_are_examples():
    assert len(MODULES) >= 10
