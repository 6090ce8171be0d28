"""Gymnasium ids of suites: ``Segar/<suite>-<train|test>-<rgb|state>``, such as ``Segar/place-between-v1-train-state``.

The version is the one in the suite's name. The ids have none of their own: a second version of a suite is another question, and
does not make the first one out of date, which Gymnasium would say otherwise.
"""

import gymnasium

from segar.suites.suite_names import SIDES, suites

OBSERVATION_NAMES = ("rgb", "state")
ENTRY_POINT, VECTOR_ENTRY_POINT = (f"segar.suites.registration:{name}" for name in ("make_env", "make_vector_env"))


def register_suites() -> None:
    """Register the ids of all suites, of which no file is read; ids that are registered already stay as they are."""
    for name in suites():
        for side in SIDES:
            for observation in OBSERVATION_NAMES:
                id_ = f"Segar/{name}-{side}-{observation}"
                if id_ not in gymnasium.registry:
                    kwargs = {"suite_name": name, "side": side, "observation": observation}
                    gymnasium.register(
                        id_, entry_point=ENTRY_POINT, vector_entry_point=VECTOR_ENTRY_POINT, kwargs=kwargs
                    )
