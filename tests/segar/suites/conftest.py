"""A small suite of one's own, which tests read."""

from pathlib import Path
from typing import Any

import pytest

import segar
from segar.language import Mass
from segar.suites import Suite, freeze

OWN: dict[str, Any] = {
    "axis": "place",
    "shift": "extrapolation",
    "says": "The ball starts below in training, and anywhere in the test.",
    "training_levels": 5,
    "options": {"max_steps": 50},
    "test_levels": 6,
    "samples": 16,
    "iterations": 2,
}


@pytest.fixture(scope="session")
def own_file(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("suites") / "mine-v1.toml"


@pytest.fixture(scope="session")
def own(own_file) -> Suite:
    """The suite as it was frozen into its file, to which nobody writes."""
    return freeze(own_file, train=segar.family("empty-medium"), test=segar.family("empty-hard"), hidden=[Mass], **OWN)
