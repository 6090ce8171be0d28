"""The paper's claims as data, ``statements.yaml``, and their tests in each metric."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from segar.analysis.plotting import style
from segar.analysis.plotting.names import panel_name, word_for
from segar.analysis.report.claims.claim import METRIC_2022, METRIC_OURS, Finding
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.tests import StatedTest, finding_of

STATEMENTS: Mapping[str, Mapping[str, Any]] = yaml.safe_load(Path(__file__).with_name("statements.yaml").read_bytes())
# What the names in braces stand for in each metric.
METRICS: Mapping[str, Mapping[str, str]] = {
    METRIC_2022: {
        "w2": "w2_reference", "gap": "gap_2022", "metric": "W2 and returns of 2022", "probe": "paper",
        "accuracy": "accuracy and returns of 2022", "accuracies": "accuracy and returns of 2022",
    },
    METRIC_OURS: {
        "w2": "w2_exact", "gap": "gap", "metric": "exact W2, full returns", "probe": "jsd",
        "accuracy": "corrected accuracy", "accuracies": "corrected accuracy, full returns",
    },
}  # fmt: skip
ALL = "all"  # of the values of a column
# How values stand in the words of a test.
NAMES: Mapping[str, Callable[[str], str]] = {"family": word_for, "panel": panel_name, "auxiliary": word_for}


def tested(evidence: Evidence, rows: pd.DataFrame, name: str, **changes: Any) -> list[Finding]:
    """What the rows say of the tests of a claim, metric by metric, each by itself; ``changes`` replace what the tests state."""
    found = (
        finding_of(evidence, rows, dataclasses.replace(test, **changes), settings)
        for settings in METRICS
        for test in stated(name, settings, rows)
    )
    return [one for one in found if one is not None and one.found.n]


def stated(name: str, settings: str, rows: pd.DataFrame) -> Iterator[StatedTest]:
    """The tests of a claim in a metric, one for each combination of the values that they are for."""
    for one in STATEMENTS["claims"][name]["tests"]:
        asked = dict(one)
        each, metrics = asked.pop("each", {}), asked.pop("metrics", list(METRICS))
        if settings not in metrics:
            continue
        values = (style.ordered(filter(None, map(str, rows[key]))) if of == ALL else of for key, of in each.items())
        for chosen in product(*values):
            braces = dict(zip(each, chosen, strict=True))
            shown = {key: NAMES.get(key, str)(value) for key, value in braces.items()}
            words = asked["words"].format(**METRICS[settings], **shown)
            yield StatedTest(**filled(asked, {**METRICS[settings], **braces}) | {"words": words})


def filled(value: Any, braces: Mapping[str, str]) -> Any:
    """Data with names in braces replaced."""
    if isinstance(value, str):
        return value.format(**braces)
    if isinstance(value, Mapping):
        return {key: filled(one, braces) for key, one in value.items()}
    return [filled(one, braces) for one in value] if isinstance(value, list) else value
