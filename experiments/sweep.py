"""Several runs side by side, then their table: ``segar sweep demo``, or ``segar sweep seed=1,2,3 tracking.sweep=mine``.

A name is a choice of ``conf/sweep/``, and may be followed by settings. It is ``segar train --multirun`` and then ``segar runs``
of the runs with the same ``tracking.sweep``, or of all where none is named.
"""

import sys
from collections.abc import Sequence

from segar.experiments.commands.hydra_app import run_command
from segar.experiments.results import results
from segar.experiments.settings import RunConfig
from segar.experiments.train import announce, train


def main() -> None:
    """The command, with what the command line states."""
    first = sys.argv[1:2]
    if first and first[0].isidentifier():
        sys.argv[1] = f"+sweep={first[0]}"
    if not {"--multirun", "-m"} & {*sys.argv}:
        sys.argv.append("--multirun")
    made: list[RunConfig] = []  # some of them, if the command ran a sweep

    def note(runs: Sequence[RunConfig], number: int) -> None:
        announce(runs, number)
        made.extend(runs)

    run_command(train, announce=note)
    if made:
        results(made[0].root, sweep=made[0].tracking.sweep or None)


if __name__ == "__main__":
    main()
