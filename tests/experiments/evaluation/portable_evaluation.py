"""Evaluates the run folders that are named with portable=true, and prints a hash of each one's episodes as JSON."""

import hashlib
import json
import sys

from segar.experiments.evaluation.evaluator import evaluate
from segar.experiments.settings import EvaluateConfig


def main() -> None:
    """The command."""
    found = {}
    for folder in sys.argv[2:]:
        out = f"{folder}/evaluations/{sys.argv[1]}"
        done = evaluate(
            EvaluateConfig(folder, portable=True, scores=False, videos="none", out=out), say=lambda line: None
        )
        text = json.dumps([done.episodes, done.summary["players"], done.summary["portable"]])
        found[folder] = hashlib.sha256(text.encode()).hexdigest()
    print(json.dumps(found))


if __name__ == "__main__":
    main()
