"""A study of one's own, from a file to a report: ``segar study my_study.yaml``.

The file says which runs are made, and which claims are tested. It has the keys of an experiment (below), and one more,
``settings``: settings of all runs, as for segar.experiments.train. Objects of your own are named as ``module:attribute``, or as
``file.py:attribute`` with a path that begins where the study's file is::

    title: Does wind widen the gap?
    settings:
      algorithm: ppo_fast                  # a choice of conf/algorithm, or module:Class
      observation: state
      task: tasks.py:sail
      scale.frames: 100_000
    grid:
      families: [levels.py:calm, levels.py:windy]
      counts: [1, 10, 50]                  # numbers of training levels
      seeds: 3                             # each with an agent and a level set of its own
    transfers:
      - family: levels.py:gale
    claims:
      distance:
        says: Of equally many levels, those that are farther from the test levels have a worse gap.
        test: correlation
        of: gap
        against: w2                        # exact W2, of all panels and transfers in one unit
        given: [cell]                      # a panel and a number of levels; without it, W2 stands for that number
        expected: negative                 # or positive, or none
      wind:
        says: Agents that trained in wind succeed less in a gale.
        test: difference
        of: success_test
        between: {family: [levels.py:windy, levels.py:calm]}
        tested_on: levels:gale             # the label of a transfer; without it, the run's own test levels
        expected: negative
        margin: 0.05

The command prints a plan first, then makes the runs, tables, figures and a report. Finished runs are found by the hash of
their settings, and interrupted ones are resumed, so the same command goes on where it was.

Settings, as name=value:
  dry_run=true               print the plan and run nothing
  processes=N                runs side by side; 0, the default: one per core
  report=false               tables only
  imported=[FOLDER]          tables of runs that were made on other machines
  root=FOLDER                where run folders are; runs/ of the checkout by default
  scale=NAME                 where the file has scales: which of them
  probes.SCALE.frames=N      how finished runs are probed, see docs/how-to/probe-representations.md
  seed=N                     the first of the seeds of agents and level sets, which go on from there
  levels.test_count, evaluation.episodes, tracking, ... as for segar train, instead of what the file says; what the
                             grid says, such as levels.count, is refused

  --schema                   print the JSON schema of study files, for editors
"""

import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from segar.experiments.commands.hydra_app import ends_with_its_reader, errors_as_messages, run_command
from segar.experiments.reproduce import SETTINGS, build, reproduce
from segar.experiments.reproduction.study_file import StudyFile, check_settings, fields_text, read_study, schema
from segar.experiments.settings import ConfigError


def study_of(arguments: Sequence[str]) -> tuple[StudyFile, list[str]]:
    """The study that a command line names, and the overrides: those of the file, then the others of the command line.

    Raises:
        ConfigError: the file is not named, cannot be read, or says something wrong.
    """
    files = [one for one in arguments if one.endswith((".yaml", ".yml")) and "=" not in one and not one.startswith("-")]
    if len(files) != 1:
        said = f"names {len(files)}: {', '.join(files)}" if files else "names none"
        raise ConfigError(f"name one study, a YAML file; the command line {said}. --help shows an example")
    study, others = read_study(Path(files[0])), [one for one in arguments if one != files[0]]
    given = {name.lstrip("+"): value for name, equals, value in (one.partition("=") for one in others) if equals}
    check_settings(given, study.experiment.get("grid") or {})
    return study, [*study.overrides(), *others]


@ends_with_its_reader()
def main() -> None:
    """Runs the study that the command line names."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        print(f"{(__doc__ or '').strip()}\n\n{fields_text()}")
        return
    if "--schema" in sys.argv[1:]:
        print(json.dumps(schema(), indent=2))
        return
    with errors_as_messages():
        study, sys.argv[1:] = study_of(sys.argv[1:])
    run_command(
        reproduce, "study", partial(build, grids={study.name: study.experiment}, study=study.as_data()), SETTINGS
    )


if __name__ == "__main__":
    main()
