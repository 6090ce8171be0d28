"""MLflow: the store, the sending of runs to it, and its pages. MLflow itself is imported when a store is opened."""

from segar.experiments.commands import process_defaults
