"""Gymnasium ids of suites: ``Segar/<suite>-<train|test>-<rgb|state>``, such as ``Segar/place-between-v1-train-state``.

The version is the one in the suite's name. The ids have none of their own: a second version of a suite is another question, and
does not make the first one out of date, which Gymnasium would say otherwise.
"""

from segar.envs import OBSERVATION_NAMES, register_id
from segar.suites.suite_names import SIDES, suites

MAKERS = "segar.suites.registration"
MAX_STEPS = 50  # of all their tasks


def register_suites() -> None:
    """Register the ids of all suites, of which no file is read; ids that are registered already stay as they are."""
    for name in suites():
        for side in SIDES:
            for observation in OBSERVATION_NAMES:
                options = {"suite_name": name, "side": side, "observation": observation}
                register_id(f"Segar/{name}-{side}-{observation}", MAKERS, MAX_STEPS, **options)
