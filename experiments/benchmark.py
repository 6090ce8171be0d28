"""A method on suites, from training to a row that anybody can play again: ``segar benchmark suite=core``.

Each suite is trained on with each seed, side by side; finished runs are found, and interrupted ones resumed. The networks play
the frozen test levels and their training levels by functions that give the same bits on every processor, and episodes and
networks become a *row*: a folder with the hash of all that it depends on. The command prints the plan and what it costs first,
and a table at the end.

  segar benchmark suite=core budget=laptop algorithm=ppo_fast observation=state seeds=5 dry_run=true
  segar benchmark verify=ppo_fast-state-laptop

Settings, as name=value:
  suite=core                 core, all, the name of a suite, or a list of names
  budget=laptop              frames on each suite with each seed: laptop 200,000, server 5,000,000; open: scale.frames
  algorithm=NAME             a choice of conf/algorithm, or module:Class; or a player: idle, random, script, planner
  observation, algorithm.learning_rate, tracking, num_threads, ... as for segar train
  seeds=N, seed=1            how many seeds, from which one on; each is that of an agent and of its training levels
  policy=module:function     a method that was trained elsewhere: function(side, seed) gives its policy, a function of
                             observations, for the training side of a suite. It acts in a process of its own, and its actions
                             are recorded. It needs row=NAME; privileged=true says that it plans in the simulator
  policy=FILE.onnx           a policy that was trained elsewhere, as data: ONNX, which the row carries and onnxruntime plays;
                             or a folder with files <suite>-s<seed>.onnx
  policy_seconds=600         the longest wait for an answer of that process
  actions=FOLDER             what a method did, as files <suite>-s<seed>.npz with an array "test" [levels, steps, components],
                             and "train"; needs row=NAME
  row=NAME                   the name of the row; by default made of algorithm, observation and budget
  rows=FOLDER                where rows are; benchmark/ under root by default, and docs/results/benchmark for those shipped
  verify=ROW                 play a row again and compare every episode to the bit; a list of rows, or all
  salt=WORDS                 beside verify=ROW: also play levels that follow from these words, and print the difference
  trust=true                 import the modules that such a row names; without it, rows of others import nothing
  again=ROW                  make a row anew from its description, under root=FOLDER; a list of rows, or all
  panel=true                 play the panel on drawn levels of the suites: players whose place is known; red where one stands
                             otherwise
  table=true                 make tables, figures and page of the rows that are there, and nothing else
  dry_run=true               print the plan and run nothing
  processes=N                runs side by side; 0, the default: one per core
  report=false               no table and no figure

Networks, policies and the script are then played on levels that are drawn from the hash of the row, 1,000 for each suite and
seed, beside the planner and random play. What scores on the suites need of the rows idle, random and planner is made, too,
where no folder of rows has it. On a cluster: --multirun hydra/launcher=slurm suite=NAME,NAME,... seed=1,2,3 seeds=1 adds each
run to one row.
"""

import dataclasses
import sys
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from segar.cli import table
from segar.errors import SegarError
from segar.experiments.benchmarking.drawn import DrawTask, draw_piece
from segar.experiments.benchmarking.panel import PANEL, PanelTask, network_for, play_panel, read_panel
from segar.experiments.benchmarking.players import PlayerTask, action_file, make_piece, onnx_file
from segar.experiments.benchmarking.protocol import ALL, PLAYERS, REFERENCES, piece_name, row_folder, suites_named
from segar.experiments.benchmarking.row import (
    DRAWN,
    FETCH,
    ROW,
    TABLE,
    Method,
    NewPiece,
    Piece,
    Row,
    add_pieces,
    commitment_of_row,
    file_hash,
    read_piece,
    read_row,
    row_of,
    write_drawn,
)
from segar.experiments.benchmarking.settings import ROWS, BenchmarkConfig, again, method_of, settings_of
from segar.experiments.benchmarking.verification import verify
from segar.experiments.commands.hydra_app import errors_as_messages, run_command, to_plain
from segar.experiments.commands.kernels import choose_kernels
from segar.experiments.commands.plugin import REPORTS, run_plugin
from segar.experiments.evaluation.transfers import RunTask
from segar.experiments.reproduce import ReproduceConfig, Work, carry_out, do_all, failures, reproduce
from segar.experiments.reproduction.grid import grid_runs
from segar.experiments.reproduction.plan import ReproductionPlan, in_minutes, measure_speeds
from segar.experiments.runs.executed_code import differing_parts
from segar.experiments.runs.run_folder import folder_path, is_finished, runs_root, write_json
from segar.experiments.settings import (
    ConfigError,
    RunConfig,
    RunFolderError,
    TrainingError,
    as_data,
    construct,
    require,
    run_config,
)
from segar.suites import outline, suite
from segar.support import cores, counted

REPORT = "benchmark"
PLANNER_SECONDS, PLAYER_SECONDS, DRAW_SECONDS = 20.0, 3.0, 6.0  # assumed, per piece
PANEL_SECONDS = 40.0  # assumed, per suite
RED = "\x1b[31mRED\x1b[0m"
Key = tuple[str, int]  # a suite and a seed


def benchmark(config: BenchmarkConfig) -> None:
    """Verifies rows, or makes what a row lacks, and what scores on its suites lack.

    Raises:
        SegarError: a row is not what it says; settings are wrong; or some runs failed, and the others are in the row.
    """
    if config.verify:
        verify_rows(config)
    elif config.panel:
        make_panel(config)
    elif config.again:
        make_again(config)
    elif config.table:
        for row in named_rows([ALL], [config.folder]):
            draw_row(config, row)
        report(config)
    else:
        name = make_row(config)
        if config.report and not config.dry_run:
            draw_row(config, read_row(config.folder / name))
        for reference in references_of(config) if config.report else ():
            make_row(reference)
        if config.report and not config.dry_run:
            report(config, row=name, tracking=as_data(config.run.tracking), root=str(runs_root(config.run)))


def report(config: BenchmarkConfig, **options: Any) -> None:
    """Makes tables, figures and the page of the rows, in a process of its own; raises :class:`TrainingError` if that fails."""
    if not run_plugin(REPORTS, REPORT, config.folder, options):
        raise TrainingError(
            f"the tables of {config.folder} were not made, or not tracked; see above. The rows are complete, and table=true"
            " makes their tables"
        )


def make_row(config: BenchmarkConfig) -> str:
    """Makes what a row lacks; returns its name."""
    method = method_of(config)
    left = missing(config, method)
    pieces = len(config.chosen_suites()) * config.seeds
    print(f"row {method.name}: {method.says}; {pieces - len(left)} of {pieces} pieces are there", flush=True)
    if left and method.kind == "networks":
        train_pieces(config, method, left)
    elif left:
        play_pieces(config, method, left)
    return method.name


def missing(config: BenchmarkConfig, method: Method) -> list[Key]:
    """The suites and seeds that a row lacks, or has of another version of the suite."""
    there = row_of(config.folder / method.name, method)
    pieces = there.pieces if there else ()
    left = lacking(config, {(one.suite, one.suite_hash, one.seed) for one in pieces})
    asked = {(name, seed) for name in config.chosen_suites() for seed in config.all_seeds()} - {*left}
    for piece in (one for one in pieces if (one.suite, one.seed) in asked and config.run.stale != "keep"):
        changed = made_otherwise(config, piece, there.files if there else {})
        if changed and config.run.stale == "refuse":
            raise RunFolderError(
                f"row {method.name}: {piece.suite}, seed {piece.seed}, was made by other files than today's; changed since:"
                f" {', '.join(changed)}. Name another row (row=...); stale=anew makes the piece again, stale=keep takes it as"
                " it is"
            )
        left += [(piece.suite, piece.seed)] if changed else []
    return sorted(left)


def made_otherwise(config: BenchmarkConfig, piece: Piece, files: Mapping[str, str]) -> list[str]:
    """The user's own files, of code, actions or a model, that are others than those that a piece was made by.

    Args:
        files: the hashes of the row's files.
    """
    if config.actions:
        path, known = action_file(Path(config.actions), piece.suite, piece.seed), piece.made_with.get("actions")
    elif config.is_onnx:
        path, known = onnx_file(Path(config.policy), piece.suite, piece.seed), files[piece.file]
    else:
        return differing_parts(piece.made_with.get("code", {}), {})
    return [str(path)] if path.exists() and file_hash(path) != known else []


def lacking(config: BenchmarkConfig, known: Collection[tuple[str, str, int]]) -> list[Key]:
    """The suites and seeds that are asked for and not among those known, which have the hashes of suites."""
    wanted = [(name, suite(name).hash, seed) for name in config.chosen_suites() for seed in config.all_seeds()]
    return sorted((name, seed) for name, hashed, seed in wanted if (name, hashed, seed) not in known)


def references_of(config: BenchmarkConfig) -> Iterator[BenchmarkConfig]:
    """The rows of idle, random and planner as far as scores on these suites need them and no folder of rows has them."""
    for player in (one for one in REFERENCES if one != config.player):
        rows = [read_row(place / player) for place in config.places if (place / player / ROW).exists()]
        if left := lacking(config, {(one.suite, one.suite_hash, one.seed) for row in rows for one in row.pieces}):
            names = tuple(dict.fromkeys(name for name, _ in left))
            other = {"policy": "", "actions": "", "privileged": False, "row": ""}
            yield dataclasses.replace(config, player=player, suites=names, **other)


def make_again(config: BenchmarkConfig) -> None:
    """Makes rows anew from their descriptions, each after the cost of all was printed.

    Raises:
        ConfigError: the rows would be written over themselves.
    """
    elsewhere = [place for place in config.places if place != config.folder]  # so that the same command goes on
    every = tuple(config.again) == (ALL,)
    rows = named_rows(config.again, elsewhere if every and elsewhere else [*elsewhere, config.folder])
    if any(row.folder.parent == config.folder for row in rows):
        raise ConfigError(f"rows: {config.folder} holds the rows themselves; name another folder: rows=FOLDER")
    known = [row for row in rows if row.method.kind == "networks" or row.method.name in PLAYERS]
    for row in (row for row in rows if row not in known):
        print(f"row {row.method.name}: {row.method.says}: it was made elsewhere, and is verified, not made again")
    asked, todo = asked_suites(config), list[BenchmarkConfig]()
    for row in known:
        pieces = tuple(one for one in row.pieces if one.suite in (asked or row.suites()))
        todo += again(config, dataclasses.replace(row, pieces=pieces))
    require(bool(todo or not asked), "suite", list(asked), f"one that {', '.join(config.again)} was made on")
    for one in todo:
        make_row(dataclasses.replace(one, dry_run=True))
    processes = config.processes or cores()
    seconds = sum(map(seconds_of, todo)) / processes
    print(f"all rows: about {in_minutes(seconds)} with {processes} at a time", flush=True)
    for one in () if config.dry_run else todo:
        make_row(one)
    if config.report and not config.dry_run:
        report(config)


def seconds_of(config: BenchmarkConfig) -> float:
    """How long what a row lacks takes, in seconds, if all of it is made one after the other."""
    method, speeds = method_of(config), measure_speeds(runs_root(config.run))
    left = set(missing(config, method))
    if not left:
        return 0.0
    if method.kind != "networks":
        return len(left) * seconds_per_piece(config)
    runs = (run for run in runs_of(plan_of(config, method, left)) if (run.levels.train, run.seed) in left)
    return sum(speeds.seconds(RunTask(run)) for run in runs)


def train_pieces(config: BenchmarkConfig, method: Method, left: Sequence[Key]) -> None:
    """Trains what a row lacks, and adds it to the row; raises as :func:`segar.experiments.reproduce.reproduce`."""
    plan = plan_of(config, method, left)
    there = [run for run in runs_of(plan) if (run.levels.train, run.seed) not in set(left)]

    def finish(_: ReproduceConfig, made: ReproductionPlan) -> bool:
        if runs := [work.run for work in made.runs if is_finished(folder_path(work.run))]:
            show(add(config, method, [trained_piece(one) for one in runs]))
        return True

    reproduce(plan, train_and_play, finish, frozenset(run.label() for run in there))


def plan_of(config: BenchmarkConfig, method: Method, left: Collection[Key]) -> ReproduceConfig:
    """The suites of which a row lacks something, as experiments; their runs share a tag in MLflow, the name of the row."""
    run = config.trained_run()
    run = dataclasses.replace(run, tracking=dataclasses.replace(run.tracking, sweep=run.tracking.sweep or method.name))
    grids = {name: experiment_of(name, config) for name in dict.fromkeys(name for name, _ in left)}
    return ReproduceConfig(run, config.processes, grids=grids, dry_run=config.dry_run, report=False)


def runs_of(plan: ReproduceConfig) -> list[RunConfig]:
    """All runs of a plan, those that a row has included."""
    return [run for one in plan.at_scale() if one.grid for run in grid_runs(one.grid, plan.run)]


def experiment_of(name: str, config: BenchmarkConfig) -> dict[str, Any]:
    """A suite as an experiment: as many runs as there are seeds."""
    about = outline(name)
    count = config.training_levels or about["training_levels"]
    return {
        "title": about["says"],
        "grid": {
            "families": [name], "counts": [count], "seeds": config.seeds,
            "vary": {"levels.test_count": [about["test_levels"]]},
        },
    }  # fmt: skip


def train_and_play(work: Work) -> dict[str, float]:
    """Trains or resumes a run, and plays its network; returns the final figures of the training."""
    assert isinstance(work, RunTask)
    figures = carry_out(work)
    trained_piece(work.run)
    return figures


def trained_piece(run: RunConfig) -> NewPiece:
    """The piece of a finished run. Torch is imported here, so that planning and verifying do not load it."""
    choose_kernels(run.determinism)
    from segar.experiments.benchmarking.trained import piece_of

    count = outline(run.levels.train)["training_levels"]
    own = None if run.levels.count == count else run.levels.count
    return piece_of(run, Method("", "networks", "", settings=settings_of(run, own)))


def play_pieces(config: BenchmarkConfig, method: Method, left: Sequence[Key]) -> None:
    """Plays what a row without training lacks, and adds it to the row; raises :class:`TrainingError` where something failed."""
    place = pieces_folder(config, method)
    player = config.policy, config.actions, config.policy_seconds
    tasks = [PlayerTask(method, name, seed, place / piece_name(name, seed), *player) for name, seed in left]
    waiting = [task for task in tasks if not task.is_done()]
    processes = config.processes or cores()
    seconds = seconds_per_piece(config)
    head, rows = ["suite", "seeds", "about"], []
    for name in dict.fromkeys(name for name, _ in left):
        seeds = [task.seed for task in waiting if task.suite == name]
        rows.append([name, ", ".join(map(str, seeds)), in_minutes(seconds * len(seeds) / processes)])
    print(table(head, rows))
    is_code = config.policy and not config.is_onnx
    beside = f", and as long as {config.policy} itself takes, which only it knows" if is_code else ""
    print(f"about {in_minutes(seconds * len(waiting) / processes)} with {processes} at a time{beside}", flush=True)
    if config.dry_run:
        return
    failed = do_all(place / "logs", {one.folder.name: (one, seconds) for one in waiting}, processes, make_piece)
    not_made = {one.job.name for one in failed}  # there may lie what another policy or other files made before
    made = (read_piece(task.folder) for task in tasks if task.folder.name not in not_made)
    if found := [piece for piece in made if piece is not None]:
        show(add(config, method, found))
    if failed:
        raise TrainingError(failures(failed, len(waiting)))


def draw_row(config: BenchmarkConfig, row: Row) -> None:
    """Draws and plays the levels of a row that has none yet, and writes what came of them, once all pieces are there.

    Rows of recorded actions, of the references, and those that lack a file or name code that is not trusted are left as they
    are; raises :class:`TrainingError` where something failed.
    """
    name, lacks = row.method.name, f"its folder lacks files; {FETCH}" if row.lacks - {TABLE} else ""
    if row.drawn or not row.can_be_drawn or name in REFERENCES:
        return
    try:
        method = row.trusted_method(config.trusted, DRAWN)
    except RunFolderError as error:
        lacks = str(error)
    if lacks:
        print(f"row {name}: its levels are not drawn: {lacks}", flush=True)
        return
    commitment = commitment_of_row(row)
    print(f"row {name}: its commitment is {commitment}; from it, levels are drawn", flush=True)
    place = pieces_folder(config, method) / "drawn"
    tasks = [
        DrawTask(method, one, row.folder / one.file, commitment, place / f"{piece_name(one.suite, one.seed)}.json",
                 config.policy_seconds)
        for one in row.pieces
    ]  # fmt: skip
    waiting = {one.path.stem: (one, DRAW_SECONDS) for one in tasks if one.found() is None}
    if failed := do_all(place / "logs", waiting, config.processes or cores(), draw_piece):
        raise TrainingError(failures(failed, len(waiting)))
    show(write_drawn(row, [found for one in tasks if (found := one.found()) is not None]))


def make_panel(config: BenchmarkConfig) -> None:
    """Plays the panel on each suite, prints it, and makes the page beside it; raises :class:`TrainingError` where it is red."""
    rows = [read_row(path.parent) for place in config.places for path in sorted(place.glob(f"*/{ROW}"))]
    place = runs_root(config.run) / f"{ROWS}_panel"
    chosen = config.chosen_suites()
    tasks = [PanelTask(one, network_for(one, rows, config.trusted), place / f"{one}.json") for one in chosen]
    if config.dry_run:
        print(f"about {in_minutes(PANEL_SECONDS * len(tasks) / (config.processes or cores()))}")
        return
    waiting = {one.suite: (one, PANEL_SECONDS) for one in tasks}
    if failed := do_all(place / "logs", waiting, config.processes or cores(), play_panel):
        raise TrainingError(failures(failed, len(waiting), "The page of the panel stays as it was"))
    lines = [line for one in tasks for line in read_panel(one.path)]
    write_json(config.folder / PANEL, lines)
    red = [f"{one['player']} on {one['suite']}" for one in lines if not one["right"]]
    shown = [
        [one["suite"], one["player"], f"{one['drawn']:.3f}", one["must"], "" if one["right"] else RED] for one in lines
    ]
    print(table(["suite", "player", "success above chance", "must", ""], shown), flush=True)
    if config.report:
        report(config)
    if red:
        raise TrainingError(f"the panel is red: {', '.join(red)}. These numbers do not rank methods as they should")


def pieces_folder(config: BenchmarkConfig, method: Method) -> Path:
    """The folder of what is played for a row, piece by piece."""
    return runs_root(config.run) / f"{ROWS}_pieces" / method.name


def seconds_per_piece(config: BenchmarkConfig) -> float:
    """How long a piece without training takes, as far as that is known before."""
    return PLANNER_SECONDS if config.player == "planner" else PLAYER_SECONDS


def add(config: BenchmarkConfig, method: Method, found: Sequence[NewPiece]) -> Row:
    """The row with these pieces, each file of which is named by suite and seed."""
    named = []
    for one in found:
        file = f"{piece_name(one.piece.suite, one.piece.seed)}{one.path.suffix}" if one.path else ""
        named.append(NewPiece(dataclasses.replace(one.piece, file=file), one.episodes, one.path))
    return add_pieces(config.folder / method.name, method, named)


def show(row: Row) -> None:
    """Prints where a row is, and how large."""
    pieces = counted(len(row.pieces), "piece")
    size = sum(path.stat().st_size for path in row.folder.iterdir()) / 1e6
    print(f"row {row.method.name}: {pieces}, {size:.1f} MB, hash {row.hash}; {row.folder}", flush=True)


def verify_rows(config: BenchmarkConfig) -> None:
    """Plays rows again; raises :class:`RunFolderError`, when all were played, that names those that are not what they say."""
    suites = asked_suites(config)
    rows = [row for row in named_rows(config.verify, config.places) if not suites or {*suites} & {*row.suites()}]
    require(bool(rows), "suite", list(suites), f"one that {', '.join(config.verify)} was played on")
    refused = []
    for row in rows:
        began = time.monotonic()
        try:
            count = verify(row, suites, say=partial(print, flush=True), trusted=config.trusted, salt=config.salt)
        except SegarError as error:
            refused.append(f"row {row.method.name}: {error}")
            continue
        took = in_minutes(time.monotonic() - began)
        print(f"row {row.method.name}, hash {row.hash}: {count:,} episodes are equal to the bit ({took})", flush=True)
    if refused:
        raise RunFolderError("\n".join(refused))


def named_rows(names: Sequence[str], places: Sequence[Path]) -> list[Row]:
    """The rows of these names in some folders, or all; raises :class:`SegarError` where there is none, or a damaged one."""
    if tuple(names) == (ALL,):
        names = sorted(str(path.parent) for place in places for path in place.glob(f"*/{ROW}"))
        require(bool(names), "rows", str(places[0]), "a folder with rows")
    return [read_row(row_folder(name, places)) for name in names]


def asked_suites(config: BenchmarkConfig) -> tuple[str, ...]:
    """The suites that a command about rows narrows them to; none: it does not."""
    return () if config.suites == DEFAULT_SUITES else suites_named(config.suites)


DEFAULT_SUITES = BenchmarkConfig().suites
SETTINGS = {name: value for name, value in as_data(BenchmarkConfig()).items() if name not in ("run", "training_levels")}
LISTS = ("suites", "verify", "again")


def build(config: DictConfig) -> BenchmarkConfig:
    """Hydra's result as settings."""
    data = to_plain(config)
    own = {key: data.pop(key) for key in SETTINGS}
    own |= {key: [own[key]] for key in LISTS if isinstance(own[key], str)}
    count = data["levels"].pop("count")
    for name in ("train", "design", "variation"):
        usual, given = (one["levels"][name] for one in (as_data(RunConfig()), data))
        require(given == usual, f"levels.{name}", given, "left out: suites say the levels")
    return construct(BenchmarkConfig, {**own, "training_levels": count}, "", run=run_config(data))


def with_names(arguments: Sequence[str]) -> list[str]:
    """A command line in which ``suite`` is no group of choices, and a player no algorithm."""
    found = []
    given = [name for name, equals, _ in (text.partition("=") for text in arguments) if equals]
    if seeds := [name for name in ("seed", "seeds") if name in given and not {"verify", "again"}.isdisjoint(given)]:
        raise ConfigError(f"{seeds[0]}: verify and again take a row with all of its seeds; leave {seeds[0]} out")
    elsewhere = next((name for name in ("policy", "actions") if name in given), None)
    if elsewhere and "algorithm" in given:
        raise ConfigError(f"algorithm: {elsewhere} is of a method that was trained elsewhere; leave algorithm out")
    for text in arguments:
        name, equals, value = text.partition("=")
        if equals and name == "suite":
            name = "suites"
        if equals and name == "algorithm" and {*value.split(",")} <= {*PLAYERS}:
            name = "player"
        if name == "salt" and value[:1] not in "'\"":  # words are text, also where Hydra would read a number or a list
            value = "'" + value.replace("'", "\\'") + "'"
        found.append(f"{name}{equals}{value}")
    return found


def main() -> None:
    """The command."""
    with errors_as_messages():
        sys.argv[1:] = with_names(sys.argv[1:])
    run_command(benchmark, "benchmark", build, SETTINGS, lambda: (__doc__ or "").strip())


if __name__ == "__main__":
    from segar.experiments import benchmark as module  # jobs of launchers find functions by their module

    module.main()
