"""A run that nobody trains, and of which a store is told; another process imports nothing else for it."""

from pathlib import Path
from unittest.mock import patch

from segar.experiments.settings import RunConfig
from segar.experiments.tracking import mlflow_store
from segar.experiments.tracking.tracker import start_tracking
from tests.waiting import PATIENCE

ROWS = [{"name": "episode/return", "frames": k, "seconds": 0.5 * k, "value": -k} for k in range(5)]


def start(root: str, number: int) -> None:
    """Tells the store in a folder of a run of this number, however long others open the store on a busy machine."""
    with patch.object(mlflow_store, "LONGEST_OPENING", PATIENCE):
        start_tracking(RunConfig(root=root, seed=number), Path(root) / str(number), ROWS).finish("FINISHED")
