"""The command: a method becomes a row, which plays again to the bit; what differs is found and named."""

import dataclasses
import json
import os
import select
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from segar.analysis.benchmark.causes import causes_of_rows
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.experiments.benchmark import (
    BenchmarkConfig,
    again,
    benchmark,
    make_row,
    method_of,
    missing,
    references_of,
    with_names,
)
from segar.experiments.benchmarking import protocol
from segar.experiments.benchmarking.drawn import draw, play_drawn
from segar.experiments.benchmarking.panel import PanelTask, network_for, play_panel, read_panel
from segar.experiments.benchmarking.players import PlayerTask, make_piece
from segar.experiments.benchmarking.playing import read_actions, write_actions
from segar.experiments.benchmarking.protocol import PLAYERS, SHIPPED, suites_named
from segar.experiments.benchmarking.row import (
    EPISODES,
    KEYS,
    NAME,
    ROW,
    TABLE,
    add_pieces,
    commitment_of_row,
    file_hash,
    hash_of,
    read_piece,
    read_row,
    write_drawn,
)
from segar.experiments.benchmarking.verification import is_verified, verify
from segar.experiments.commands.overrides import with_own_names
from segar.experiments.reproduction.process_pool import Job, JobResult
from segar.experiments.settings import (
    ConfigError,
    ObservationConfig,
    PPOConfig,
    RunConfig,
    RunFolderError,
    ScaleConfig,
    TrackingConfig,
    TrainingError,
)
from segar.levels import hash_of_levels
from segar.policies import Network, NetworkPolicy
from segar.suites import AXES, CORE, evaluate_on_suite, find_causes, outline, side_options, suite, twins
from segar.support import EVERYTHING
from tests.experiments.benchmarking import lab_method
from tests.experiments.short_runs import run_module
from tests.onnx_models import linear

SUITE = "place-few-v1"
WITH_TWINS = "sight-mass-v1"
LAB = "tests.experiments.benchmarking.lab_method"


def config_of(root, **changes):
    run = RunConfig(root=str(root), seed=1, tracking=TrackingConfig(name="none"), progress=False)
    return BenchmarkConfig(**{"run": run, "suites": (SUITE,), "seeds": 1, "processes": 1, "report": False, **changes})


def row_made_here(config, of=SUITE):
    """The row of a method without training, made in this process."""
    method = method_of(config)
    folder = config.folder.parent / "piece"
    make_piece(PlayerTask(method, of, 1, folder, config.policy, config.actions, config.policy_seconds))
    new = read_piece(folder)
    assert new is not None
    file = f"{of}-s1{new.path.suffix}" if new.path else ""
    return add_pieces(
        config.folder / method.name, method, [dataclasses.replace(new, piece=dataclasses.replace(new.piece, file=file))]
    )


@pytest.fixture(autouse=True)
def own_record(tmp_path, monkeypatch):
    """What is verified is noted for this test alone, and not for the user, whose next tests would find it."""
    monkeypatch.setattr("segar.experiments.benchmarking.verification.private_cache_folder", lambda: tmp_path)


@pytest.fixture
def idle(tmp_path):
    """The row of a player that does nothing, and its folder, which is a test's own."""
    return row_made_here(config_of(tmp_path, player="idle"))


def edited(row, **changes):
    """The row with another description whose hash is right."""
    data = json.loads((row.folder / ROW).read_text())
    data |= changes
    del data["hash"]
    (row.folder / ROW).write_text(json.dumps({**data, "hash": hash_of(data)}))
    return read_row(row.folder)


def test_the_core_has_twelve_suites_and_all_axes():
    assert len(set(CORE)) == 12 and {outline(name)["axis"] for name in CORE} == {*AXES}
    assert suites_named(["core", SUITE]) == CORE and SUITE in suites_named(["all"])
    with pytest.raises(ConfigError, match=r"'place-fow-v1'.*Did you mean 'place-few-v1'"):
        suites_named(["place-fow-v1"])


@pytest.mark.compiled  # hundreds of levels are played, and later tests find the kernel
@pytest.mark.parametrize("player", ["idle", "script"])
def test_a_player_becomes_a_row_that_plays_again_to_the_bit(tmp_path, player):
    row = row_made_here(config_of(tmp_path, player=player))
    of = suite(SUITE)
    assert verify(row, [SUITE]) and not is_verified(row), "a part of it is not all of it"
    assert verify(row) == len(of.test_levels) + of.training_levels == len(row.episodes())
    assert is_verified(row) and not is_verified(dataclasses.replace(row, means="0"))


def forged(row, number, change, precision=None):
    """The row whose episode of this number has another return, and whose hashes fit."""
    episodes = row.episodes()
    returns = episodes["return"].to_pylist()
    returns[number] = change(returns[number])
    place = episodes.schema.get_field_index("return")
    column = pa.array(returns, precision or EPISODES.field("return").type)
    pq.write_table(episodes.set_column(place, "return", column), row.folder / TABLE)
    return edited(row, files={TABLE: file_hash(row.folder / TABLE)})


@pytest.mark.parametrize("value", [np.nan, np.inf, None])
def test_returns_that_are_no_numbers_are_refused_by_file_and_column(idle, value):
    row = forged(idle, 0, lambda _: value)
    said = (
        "in its column 'return' something is absent" if value is None else "some values in the column 'return' are not"
    )
    for read in (row.results, lambda: verify(row)):
        with pytest.raises(RunFolderError, match=f"episodes.parquet: {said}"):
            read()


def test_a_row_has_pieces_each_of_them_once_and_texts_that_can_be_written(idle):
    (piece,) = json.loads((idle.folder / ROW).read_text())["pieces"]
    for pieces in ([], [piece, piece]):
        with pytest.raises(RunFolderError, match="pieces: there must be some, and each suite with each seed once"):
            edited(idle, pieces=pieces)
    with pytest.raises(RunFolderError, match=rf"{ROW}: 'made_with\[0\]\.code' must be a mapping"):
        edited(idle, made_with=[{"code": "./lab.py"}])
    for changes in ({"says": "\ud800"}, {"pieces": [{**piece, "suite_hash": "\udfff"}]}):
        with pytest.raises(RunFolderError, match=rf"{ROW}: a text in it has half of a character"):
            edited(idle, **changes)


def test_texts_that_no_page_should_show_are_refused_by_their_names(idle):
    for name in ("../x", "..", "<b>", "a|b", ""):
        with pytest.raises(RunFolderError, match=r"row\.json: name: "):
            edited(idle, name=name)


@pytest.mark.parametrize("changes", [{"name": "mine"}, {"kind": "onnx"}, {"name": "oracle", "kind": "player"}])
def test_only_players_make_the_rows_that_others_are_measured_by(idle, changes):
    with pytest.raises(RunFolderError, match=r"row\.json: rows of players alone are called idle, random,"):
        edited(idle, **changes)


def test_a_row_states_the_levels_of_all_of_its_episodes_and_has_a_test(idle):
    piece = json.loads((idle.folder / ROW).read_text())["pieces"][0]
    for side in ("train", "test"):
        levels = {name: one for name, one in piece["levels"].items() if name != side}
        with pytest.raises(
            RunFolderError, match=f"episodes, which row.json does not state, of {SUITE}, seed 1, .*{side}"
        ):
            edited(idle, pieces=[{**piece, "levels": levels}]).results()
    table = pq.read_table(idle.folder / TABLE)
    pq.write_table(table.slice(0, 0), idle.folder / TABLE)
    with pytest.raises(RunFolderError, match=f"no episodes of {SUITE}, seed 1, on its levels 'test'"):
        verify(edited(idle, pieces=[{**piece, "levels": {}}], files={TABLE: file_hash(idle.folder / TABLE)}))


def test_a_changed_episode_is_found_and_named_though_all_hashes_were_made_to_fit(idle):
    with pytest.raises(RunFolderError, match=r"place-few-v1-s1: the return of the episode on test level 5 is .* 1"):
        verify(forged(idle, 30, lambda value: np.nextafter(np.float32(value), np.float32(9))))


@pytest.mark.parametrize("column", [name for name in EPISODES.names if name not in KEYS])
def test_an_episode_that_is_another_in_any_column_is_named_by_it(idle, column):
    first, *others = idle.episodes()[column].to_pylist()
    other = next((one for one in others if one != first), not first)
    place = EPISODES.get_field_index(column)
    table = idle.episodes().set_column(place, column, pa.array([other, *others], EPISODES.field(column).type))
    pq.write_table(table, idle.folder / TABLE)
    with pytest.raises(
        RunFolderError, match=rf"the {column} of the episode on .* is {other!r} in the row and {first!r}"
    ):
        verify(edited(idle, files={TABLE: file_hash(idle.folder / TABLE)}))


def test_a_table_in_double_precision_as_rows_had_it_before_is_verified(idle):
    assert verify(forged(idle, 30, lambda value: np.nextafter(value, 9), pa.float64())) == len(idle.episodes())


def test_another_version_of_a_suite_or_other_training_levels_are_refused(idle):
    row = idle
    piece = json.loads((row.folder / ROW).read_text())["pieces"][0]
    with pytest.raises(RunFolderError, match="played on place-few-v1 with the hash 0000, and the suite of this name"):
        verify(edited(row, pieces=[{**piece, "suite_hash": "0000"}]))
    with pytest.raises(RunFolderError, match="the train levels of place-few-v1 with seed 1 are not those"):
        verify(edited(row, pieces=[{**piece, "levels": {**piece["levels"], "train": "0000"}}]))
    with pytest.raises(RunFolderError, match="does not state, of place-few-v1, seed 1, on its"):
        verify(edited(row, pieces=[{**piece, "suite": "place-few-v7"}]))


def test_the_code_that_a_row_of_somebody_else_names_is_imported_with_trust_alone(tmp_path, idle):
    seen = {"observation": {"name": f"{LAB}:policy"}}
    row, config = edited(idle, name="mine", kind="networks", settings=seen), config_of(tmp_path)
    for read in (lambda: verify(row), lambda: again(config, row)):
        with pytest.raises(RunFolderError, match=r"row.json was not written by you .* \(settings\.observation\.name\)"):
            read()
    (found,) = again(dataclasses.replace(config, trust=True), row)
    assert found.run.observation.name == f"{LAB}:policy"


def test_a_row_says_nothing_of_where_runs_lie(tmp_path, idle):
    row = edited(idle, settings={"folder": "/elsewhere", "restart": True})
    (found,) = again(config_of(tmp_path), row)
    assert (found.run.folder, found.run.restart) == (None, False)


def test_a_policy_in_onnx_is_carried_and_plays_to_the_bit_without_trust(tmp_path, few_drawn):
    env = VectorEnv(num_envs=1, **side_options(suite(SUITE), "test"))
    linear(tmp_path / "mine.onnx", env.single_observation_space.shape)
    config = config_of(tmp_path, policy=str(tmp_path / "mine.onnx"), row="mine")
    row = row_made_here(config)
    assert not missing(config, method_of(config))
    (tmp_path / "mine.onnx").write_bytes(b"another model")
    with pytest.raises(RunFolderError, match=r"was made by other files than today's; changed since: .*mine\.onnx"):
        missing(config, method_of(config))
    (tmp_path / "mine.onnx").unlink()
    row = drawn_here(row)
    assert verify(row) == len(row.episodes()) + few_drawn and verify(row, salt="words")
    with pytest.raises(
        RunFolderError, match=rf"row\.json: {SUITE}-s1: observation: \[\] is not allowed; it must be a group of"
    ):
        verify(edited(row, settings={"observation": []}))
    (row.folder / f"{SUITE}-s1.onnx").write_bytes(b"other weights")
    with pytest.raises(RunFolderError, match=rf"{SUITE}-s1\.onnx is not what the row was made of"):
        read_row(row.folder)


def test_a_file_of_actions_becomes_a_row_with_or_without_training_levels(tmp_path):
    actions = {"test": np.full((200, 3, 2), 0.25, np.float32)}
    write_actions(tmp_path / "given" / f"{SUITE}-s1.npz", actions)
    config = config_of(tmp_path, actions=str(tmp_path / "given"), row="mine")
    row = row_made_here(config)
    assert verify(row) == 200 and {*row.episodes()["levels"].to_pylist()} == {"test"}
    assert not missing(config, method_of(config))
    write_actions(tmp_path / "given" / f"{SUITE}-s1.npz", {"test": 2 * actions["test"]})
    with pytest.raises(RunFolderError, match="was made by other files than today's"):
        missing(config, method_of(config))


@pytest.mark.parametrize(
    ("actions", "said"),
    [
        ({"train": np.zeros((25, 3, 2))}, "has no array 'test'"),
        ({"test": np.zeros((199, 3, 2))}, r"must be \[200 levels, steps, 2\], not \[199, 3, 2\]"),
        ({"test": np.full((200, 3, 2), np.nan)}, "some actions of 'test' are not finite"),
    ],
)
def test_wrong_actions_are_refused(tmp_path, actions, said):
    write_actions(tmp_path / "given" / f"{SUITE}-s1.npz", actions)
    with pytest.raises(RunFolderError, match=said):
        row_made_here(config_of(tmp_path, actions=str(tmp_path / "given"), row="mine"))


@pytest.mark.parametrize(
    ("name", "error", "said"),
    [
        ("no_function", ConfigError, "it must be a function of a suite's training side and a seed .* it is int"),
        (
            "no_policy",
            ConfigError,
            "it must be a function of a suite's training side and a seed .* it returns NoneType",
        ),
        ("of_another_shape", ConfigError, r"actions must have shape \(25, 2\), not \(25, 3\)"),
        ("dies", TrainingError, "ended by itself, with exit code 7"),
        ("stammers", TrainingError, "sent no whole answer"),
        ("boasts", TrainingError, "sent no whole answer"),
        ("forges", ConfigError, r"\[1\]"),
        (
            "hangs",
            TrainingError,
            "gave no answer within 2 s, and its process was ended. policy_seconds=N waits longer",
        ),
        ("looks_for_the_test", ConfigError, "a policy sees the training side of a suite alone"),
    ],
)
def test_what_is_no_policy_is_refused_by_its_name_and_leaves_nothing(tmp_path, name, error, said):
    seconds = 2.0 if name == "hangs" else 600.0
    config = config_of(tmp_path, policy=f"{LAB}:{name}", row="mine", policy_seconds=seconds)
    with pytest.raises(error, match=f"policy: .*{LAB}:{name}.*{said}"):
        row_made_here(config)
    assert not (config.folder / "mine").exists()


def test_processes_that_a_policy_starts_end_with_it(tmp_path, monkeypatch):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    monkeypatch.setenv("LAB_FIFO", str(fifo))
    end = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)
    row_made_here(config_of(tmp_path, policy=f"{LAB}:leaves_a_child", row="mine"))
    assert select.select([end], [], [], 60.0)[0] == [end] and os.read(end, 1) == b"", "it still holds the other end"
    os.close(end)


def drawn_here(row):
    """A row whose drawn levels were played in this process."""
    commitment = commitment_of_row(row)
    return write_drawn(row, [play_drawn(row.method, one, row.folder / one.file, commitment) for one in row.pieces])


def test_levels_that_follow_from_a_row_are_played_again_to_the_bit_and_those_of_a_salt_are_others(tmp_path, few_drawn):
    row, said = drawn_here(row_made_here(config_of(tmp_path, player="script"))), []
    (found,) = row.drawn
    assert (
        found.count == few_drawn and found.solved > 0.5 * few_drawn and found.corrected > found.random / few_drawn / 5
    )
    assert verify(row, say=said.append, salt="words") == 225 + few_drawn
    assert f"{few_drawn} episodes on drawn levels are equal to the bit" in said[1]
    assert "those of the salt 'words'" in said[2] and "(95 %, Welch)" in said[2]
    other, train = commitment_of_row(row), suite(SUITE).sample(1)
    levels = {hash_of_levels(draw(suite(SUITE), *key, train).levels) for key in ((other, 1), (other, 2), ("else", 1))}
    assert len({*levels, found.levels}) == 3 and found.levels in levels
    assert hash_of_levels(draw(suite(SUITE), other, 1, train, "words").levels) not in levels


def test_what_is_said_of_drawn_levels_cannot_be_edited(tmp_path, few_drawn):
    row = drawn_here(row_made_here(config_of(tmp_path, player="script")))
    (one,) = (dataclasses.asdict(one) for one in row.drawn)
    with pytest.raises(RunFolderError, match="levels were drawn by protocol 3, and this version plays protocol 2"):
        edited(row, protocol=3)
    for wrong in ({"solved": few_drawn + 1}, {"by_time": one["solved"] + 0.5}):
        with pytest.raises(RunFolderError, match=f"{SUITE}, seed 1: .* cannot be"):
            edited(row, protocol=2, drawn=[{**one, **wrong}])
    assert verify(edited(row, drawn=[{key: value for key, value in one.items() if key != "by_time"}]))  # as before 0.3
    with pytest.raises(RunFolderError, match="it must have the pieces of the row"):
        edited(row, drawn=[one, one])
    for changes, said in (
        ({"solved": one["solved"] + 1}, "'solved' is"),
        ({"levels": "0000"}, "'levels' is '0000' in the row"),
        ({"by_time": one["by_time"] - 1e-9}, "'by_time' is"),
    ):
        with pytest.raises(RunFolderError, match=f"script: {SUITE}-s1: drawn levels: {said}"):
            verify(edited(row, drawn=[{**one, **changes}]))


def test_a_planner_takes_the_planners_time_and_a_script_at_most_as_much_credit_as_it_solves(tmp_path, few_drawn):
    for player in ("planner", "script"):
        (found,) = drawn_here(row_made_here(config_of(tmp_path, player=player))).drawn
        of_means = (
            found.solved * found.planner_steps / found.steps
        )  # weighted by its steps; a mean of quotients is larger
        assert found.by_time == found.solved if player == "planner" else 0 < found.by_time < found.solved
        assert found.by_time >= 0.9 * of_means


def test_recorded_actions_are_practice_alone_and_a_policy_must_be_the_one_that_was_committed(tmp_path, few_drawn):
    write_actions(tmp_path / "given" / f"{SUITE}-s1.npz", {"test": np.full((200, 3, 2), 0.25, np.float32)})
    recorded = row_made_here(config_of(tmp_path, actions=str(tmp_path / "given"), row="recorded"))
    assert not recorded.can_be_drawn
    with pytest.raises(
        ConfigError, match="salt: the drawn levels of recorded are not played: it was played on practice"
    ):
        verify(recorded, salt="words")
    mine = drawn_here(row_made_here(config_of(tmp_path, policy=f"{LAB}:policy", row="mine")))
    said = []
    assert verify(mine, say=said.append) == 225 and "its policy is code, which trust=true runs" in said[-1]
    assert not is_verified(mine), "its drawn levels were not played"
    assert verify(mine, trusted=(EVERYTHING,)) == 225 + few_drawn and is_verified(mine)
    with pytest.raises(RunFolderError, match=r"row\.json: drawn: recorded actions, without a policy"):
        edited(mine, settings={"observation": mine.method.settings["observation"]})
    fickle = row_made_here(config_of(tmp_path, policy=f"{LAB}:fickle", row="fickle"))
    with pytest.raises(ConfigError, match=f"{LAB}:fickle acts otherwise on the practice levels of {SUITE} with seed 1"):
        drawn_here(fickle)


def test_code_that_changed_after_its_levels_were_drawn_plays_none_of_them(tmp_path, few_drawn):
    path = tmp_path / "lab" / "late_plans.py"
    path.parent.mkdir()
    path.write_text(Path(lab_method.__file__).read_text())
    assert with_own_names([f"policy={path}:policy"]) == ["policy=late_plans:policy"]
    row = drawn_here(row_made_here(config_of(tmp_path, policy="late_plans:policy", row="mine")))
    assert "late_plans.py" in str(row.pieces[0].made_with["code"])
    path.write_text(f"{path.read_text()}\n\nPLANS = 'which the author made once the levels were known'\n")
    with pytest.raises(
        ConfigError, match=r"late_plans\.py changed since the practice levels of place-few-v1 with seed 1"
    ):
        verify(row, trusted=(EVERYTHING,))
    assert not is_verified(row)


def test_the_code_of_an_observation_is_part_of_what_levels_are_drawn_from(tmp_path, few_drawn):
    path = tmp_path / "lab" / "late_views.py"
    path.parent.mkdir()
    path.write_text("from segar.observations import StateVector\n\n\nclass View(StateVector):\n    pass\n")
    assert with_own_names([f"observation={path}:View"]) == ["observation.name=late_views:View"]
    size = VectorEnv(suite(SUITE).test_levels, 1, seed=0).single_observation_space.shape
    linear(tmp_path / "mine.onnx", size)
    run = dataclasses.replace(config_of(tmp_path).run, observation=ObservationConfig("late_views:View"))
    row = row_made_here(config_of(tmp_path, run=run, policy=str(tmp_path / "mine.onnx"), row="mine"))
    assert verify(drawn_here(row), trusted=(EVERYTHING,)) and [*row.pieces[0].made_with["code"]] == ["./late_views.py"]
    other = dataclasses.replace(row.pieces[0], made_with={"code": {"./late_views.py": "0" * 16}})
    assert commitment_of_row(dataclasses.replace(row, pieces=(other,))) != commitment_of_row(row)
    with pytest.raises(ConfigError, match=r"late_views\.py changed since the practice levels"):
        play_drawn(row.method, other, row.folder / other.file, "")


def test_a_panel_of_players_whose_places_are_known_is_green(tmp_path, few_drawn):
    path = tmp_path / "panel.json"
    play_panel(PanelTask(SUITE, network_for(SUITE, [read_row(SHIPPED / "ppo_fast-state-laptop")], ()), path))
    lines = {one["player"]: one for one in read_panel(path)}
    assert len(lines) == 8 and all(one["right"] for one in lines.values()), lines
    assert lines["planner (privileged)"]["drawn"] == 1 > lines["replay of the practice plans"]["drawn"]


def test_the_panel_brings_in_no_code_of_others(tmp_path):
    row = read_row(Path(shutil.copytree(SHIPPED / "ppo_fast-state-laptop", tmp_path / "theirs")))
    observation = {"name": f"{LAB}:policy", "options": {}}
    theirs = edited(row, settings={**row.method.settings, "observation": observation})
    with pytest.raises(RunFolderError, match=f"names code that would be imported: {LAB}:policy"):
        network_for(SUITE, [theirs], ())
    named = BenchmarkConfig(RunConfig(observation=ObservationConfig(observation["name"])))
    assert network_for(SUITE, [theirs], named.trusted), "what the command itself names is trusted"


def in_this_process(logs, waiting, processes, work):
    """Stands for the pool of processes."""
    failed = []
    for name, (task, _) in waiting.items():
        try:
            work(task)
        except SegarError as error:
            failed.append(JobResult(Job(name, task, logs / name), 1.0, str(error)))
    return failed


def test_what_failed_is_part_of_no_row_and_its_cause_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("segar.experiments.benchmark.do_all", in_this_process)
    make_row(config_of(tmp_path, policy=f"{LAB}:policy", row="mine"))
    other = config_of(tmp_path, policy=f"{LAB}:no_function", row="mine", rows=str(tmp_path / "others"))
    with pytest.raises(TrainingError, match="it must be a function of a suite's training side"):
        make_row(other)
    assert not (other.folder / "mine").exists(), "the actions of the first policy lie where the other's would"

    def fail(task):
        raise ConfigError("the planner solves nothing")

    monkeypatch.setattr("segar.experiments.benchmark.play_panel", fail)
    with pytest.raises(TrainingError, match=f"{SUITE}: the planner solves nothing") as told:
        benchmark(config_of(tmp_path, panel=True))
    assert "there are no tables" not in str(told.value)


def test_rows_of_own_observations_have_names_that_can_be_read():
    run = RunConfig(observation=ObservationConfig("my_lab.views:" + "Wide" * 40))
    name = method_of(BenchmarkConfig(run)).name
    assert NAME.fullmatch(name) and name.startswith("ppo-my_lab.views_Wide")


def test_a_suite_that_a_row_lacks_is_not_verified_without_a_word(idle):
    config = config_of(idle.folder.parents[1], verify=("idle",), suites=(WITH_TWINS,))
    with pytest.raises(ConfigError, match=f"suite: .*{WITH_TWINS}.* must be one that idle was played on"):
        benchmark(config)


@pytest.mark.parametrize(
    ("kind", "changes", "said"),
    [
        ("player", {"suite_hash": "0000"}, f"idle.*{SUITE} with the hash 0000"),
        ("onnx", {"file": "broken.onnx"}, rf"row mine: .*row\.json: {SUITE}-s1: .*broken\.onnx is no ONNX model"),
        ("onnx", {"file": "wide.onnx"}, rf"row mine: .*row\.json: {SUITE}-s1: actions must have shape"),
    ],
)
def test_a_row_that_cannot_be_verified_keeps_no_other_from_it(tmp_path, idle, capsys, kind, changes, said):
    row_made_here(config_of(tmp_path, player="random"))
    (piece,) = json.loads((idle.folder / ROW).read_text())["pieces"]
    files = dict(idle.files)
    if "file" in changes:
        path = idle.folder / changes["file"]
        env = VectorEnv(num_envs=1, **side_options(suite(SUITE), "test"))
        linear(path, env.single_observation_space.shape, actions=3)
        path.write_bytes(path.read_bytes()[: None if path.stem == "wide" else 9])
        files[path.name] = file_hash(path)
    name = "idle" if kind == "player" else "mine"
    edited(idle, name=name, kind=kind, pieces=[{**piece, **changes}], files=files)
    with pytest.raises(RunFolderError, match=said):
        benchmark(config_of(tmp_path, verify=("idle", "random")))
    assert "row random, hash" in capsys.readouterr().out


def test_rows_whose_drawn_levels_are_not_played_are_all_named(tmp_path, idle):
    row_made_here(config_of(tmp_path, player="random"))
    with pytest.raises(RunFolderError, match=r"row idle: salt: .*\n.*row random: salt: "):
        benchmark(config_of(tmp_path, verify=("idle", "random"), salt="words"))


def test_another_policy_and_other_code_are_no_part_of_a_row(tmp_path):
    path = tmp_path / "lab" / "own_policies.py"
    path.parent.mkdir()
    path.write_text(Path(lab_method.__file__).read_text())
    assert with_own_names([f"policy={path}:policy"]) == ["policy=own_policies:policy"]
    config = config_of(tmp_path, policy="own_policies:policy", row="mine")
    row_made_here(config)
    with pytest.raises(RunFolderError, match=r"another method: settings\.policy is 'own_policies:policy' there"):
        other = config_of(tmp_path, policy="own_policies:no_policy", row="mine")
        missing(other, method_of(other))
    assert not missing(config, method_of(config))
    path.write_text(path.read_text().replace("0.5, 1.0", "0.4, 1.0"))
    with pytest.raises(RunFolderError, match=rf"{SUITE}, seed 1, was made by other files .*own_policies\.py"):
        missing(config, method_of(config))
    for stale, left in (("keep", []), ("anew", [(SUITE, 1)])):
        other = dataclasses.replace(config, run=dataclasses.replace(config.run, stale=stale))
        assert missing(other, method_of(other)) == left


@pytest.fixture
def few_drawn(monkeypatch):
    """Few levels are drawn, as many as this."""
    for module in ("drawn", "panel"):
        monkeypatch.setattr(f"segar.experiments.benchmarking.{module}.LEVELS", 40)
    return 40


MINE = {"policy": "a:b", "row": "mine"}


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"policy": "a:b"}, "row: name the row"),
        ({**MINE, "player": "idle"}, "one of algorithm, policy, actions"),
        *(({**MINE, "row": name}, r"row: .*without folders") for name in ("mine/first", ".", "..")),
        ({**MINE, "row": "planner"}, "row: 'planner' is not allowed; it must be another name"),
        ({"verify": ("mine",), "again": ("mine",)}, r"again: .* one of verify, again, panel, table"),
        ({**MINE, "policy_seconds": float("inf")}, "policy_seconds: inf is not allowed"),
        ({"privileged": True}, "privileged: True is not allowed"),
        (
            {"run": RunConfig(scale=ScaleConfig(frames=9))},
            "scale.frames: 9 is not allowed; .* 200,000 with budget=laptop",
        ),
        ({"suites": ()}, "suite"),
        ({"suites": ("look-far-v1",)}, r"suite: \['look-far-v1'\] is not allowed; .* such as observation=rgb"),
    ],
)
def test_a_method_from_outside_needs_a_name_and_methods_exclude_each_other(tmp_path, settings, message):
    with pytest.raises(ConfigError, match=message):
        config_of(tmp_path, **settings)


@pytest.mark.parametrize("given", [{"policy": "a:b"}, {"policy": "a.onnx"}, {"actions": "a"}])
def test_a_method_that_knows_more_says_so_and_is_not_held_against_those_that_do(tmp_path, given):
    declared = config_of(tmp_path, row="mine", privileged=True, **given)
    assert method_of(declared).settings["privileged"] is True
    assert not any(one.privileged for one in references_of(declared))


def test_an_agent_that_sees_no_textures_leaves_their_suites_out(tmp_path):
    assert config_of(tmp_path, suites=("look-far-v1", SUITE)).chosen_suites() == (SUITE,)
    for name in ("rgb_stack2", "textures"):
        seen = RunConfig(observation=ObservationConfig(name))
        chosen = config_of(tmp_path, suites=("look-far-v1", SUITE), run=seen).chosen_suites()
        assert chosen == ("look-far-v1", SUITE)
    for of_row in ({"verify": ("seen",)}, {"again": ("seen",)}):
        assert config_of(tmp_path, suites=("look-far-v1",), **of_row).suites == ("look-far-v1",)
        with pytest.raises(ConfigError, match="look-fra-v1"):
            config_of(tmp_path, suites=("look-fra-v1",), **of_row)


def test_scores_need_references_that_no_folder_has(tmp_path, idle, monkeypatch):
    monkeypatch.setattr("segar.experiments.benchmarking.settings.SHIPPED", tmp_path / "none")
    wanted = [one.player for one in references_of(config_of(tmp_path / "other", policy="a:b", row="mine"))]
    assert wanted == ["idle", "random", "planner"]
    assert [one.player for one in references_of(config_of(tmp_path))] == ["random", "planner"]


def test_a_command_line_names_suites_and_players():
    given = ["suite=core", "algorithm=idle", "algorithm=ppo_fast", "seed=1,2", "--multirun"]
    with pytest.raises(ConfigError, match="algorithm: policy is of a method that was trained elsewhere"):
        with_names(["algorithm=sac", "policy=a:b", "row=mine"])
    with pytest.raises(ConfigError, match="seeds: verify and again take a row with all of its seeds; leave seeds out"):
        with_names(["verify=idle", "seeds=2"])
    assert with_names(given) == ["suites=core", "player=idle", "algorithm=ppo_fast", "seed=1,2", "--multirun"]
    words = with_names([f"salt={text}" for text in ("0012", "it's, mine", "'quoted'")])
    assert words == ["salt='0012'", r"salt='it\'s, mine'", "salt='quoted'"]


@pytest.mark.usefixtures("one_process")
def test_a_trained_row_resumes_replays_and_can_be_made_again(tmp_path, capsys):
    ppo = PPOConfig(num_envs=8, num_steps=8, widths=(8,), head_width=0)
    config = config_of(tmp_path, budget="open")
    run = dataclasses.replace(config.run, algorithm=ppo, scale=ScaleConfig(frames=256))
    config = dataclasses.replace(config, run=run)
    make_row(dataclasses.replace(config, dry_run=True))
    assert "1 to do with 256 frames" in capsys.readouterr().out and not config.folder.exists()
    make_row(config)
    row = read_row(config.folder / "ppo-state-open")
    assert verify(row) == 225 and row.method.frames == 256 and row.pieces[0].bits == 32
    make_row(config)
    assert "1 of 1 pieces are there" in capsys.readouterr().out
    for folder in tmp_path.glob("place-few-v1-*"):
        assert (folder / "evaluations" / "benchmark" / "network.npz").exists()
    (same,) = again(config, row)
    elsewhere = dataclasses.replace(same, rows=str(tmp_path / "other"))
    make_row(elsewhere)  # of the finished run
    assert read_row(elsewhere.folder / "ppo-state-open").hash == row.hash
    capsys.readouterr()
    places = {"again": (str(row.folder),), "rows": str(tmp_path / "third")}
    for _ in range(2):  # the second time, there is nothing left to make
        benchmark(dataclasses.replace(config, **places))
    assert "all rows: about 0 s" in capsys.readouterr().out
    assert read_row(tmp_path / "third" / "ppo-state-open").hash == row.hash
    with pytest.raises(ConfigError, match="holds the rows themselves"):
        benchmark(dataclasses.replace(config, again=("ppo-state-open",)))
    with pytest.raises(ConfigError, match=r"suite: .* one that .*ppo-state-open was made on"):
        benchmark(dataclasses.replace(config, suites=("goal-moves-v1",), **places))


@pytest.mark.compiled
def test_a_row_has_the_episodes_on_causal_twins_but_the_references_have_none(tmp_path):
    of, made = suite(WITH_TWINS), twins(suite(WITH_TWINS))
    names = {f"{'twin' if one.differs else 'control'}-{one.group}": int(one.found.sum()) for one in made.groups}
    row = row_made_here(config_of(tmp_path, player="script", suites=(WITH_TWINS,)), WITH_TWINS)
    assert {*row.pieces[0].levels} == {"train", "test", *names}
    assert verify(row) == len(of.test_levels) + of.training_levels + sum(names.values())
    (name,) = (one for one in names if one.startswith("twin"))
    piece = json.loads((row.folder / ROW).read_text())["pieces"][0]
    with pytest.raises(RunFolderError, match=f"the {name} levels of {WITH_TWINS} with seed 1 are not those"):
        verify(edited(row, pieces=[{**piece, "levels": {**piece["levels"], name: "0000"}}]))
    assert {*row_made_here(config_of(tmp_path, player="idle"), WITH_TWINS).pieces[0].levels} == {"train", "test"}


def test_a_method_from_outside_becomes_a_row_of_its_actions_and_is_told_that_episodes_begin(tmp_path):
    row = row_made_here(config_of(tmp_path, policy=f"{LAB}:Remembers", row="mine"), WITH_TWINS)
    actions = read_actions(row.folder / f"{WITH_TWINS}-s1.npz")
    assert row.method.kind == "actions" and actions["test"].shape[::2] == (200, 2)
    assert (np.diff(actions["test"][:, :3, 0]) > 0).mean() > 0.9, "it counts the steps of each episode"
    assert {*actions} == {*row.pieces[0].levels} and any(name.startswith("twin-") for name in actions)
    assert verify(row) == sum(map(len, actions.values()))
    write_actions(tmp_path / "given" / f"{WITH_TWINS}-s1.npz", {**actions, "twin-Hue": actions["test"]})
    with pytest.raises(RunFolderError, match="there are actions of 'twin-Hue', and the level sets are train, test"):
        row_made_here(config_of(tmp_path, actions=str(tmp_path / "given"), row="other"), WITH_TWINS)


@pytest.mark.results
def test_what_makes_a_row_again_are_its_own_suites_and_seeds(tmp_path):
    rows = [read_row(SHIPPED / name) for name in ("idle", "script", "ppo_fast-state-laptop")]
    gaps = dataclasses.replace(rows[-1], pieces=tuple(one for one in rows[-1].pieces if one.seed != 2))
    for row in (*rows, gaps):
        found = [
            (name, seed) for one in again(config_of(tmp_path), row) for name in one.suites for seed in one.all_seeds()
        ]
        assert sorted(found) == sorted((piece.suite, piece.seed) for piece in row.pieces)
    each = [(seed, 1) for seed in (1, 3, 4, 5, *range(11, 16))]
    assert sorted((one.run.seed, one.seeds) for one in again(config_of(tmp_path), gaps)) == each


SHIPPED_ROWS = sorted(path.parent.name for path in SHIPPED.glob(f"*/{ROW}"))


@pytest.mark.results
@pytest.mark.parametrize("name", SHIPPED_ROWS)
def test_shipped_rows_are_what_their_hashes_say_and_a_sample_plays_again_to_the_bit(name):
    row = read_row(SHIPPED / name)
    if name in PLAYERS or row.method.settings["observation"]["name"] == "state":
        here = [piece.suite for piece in row.pieces if piece.seed == 1 and piece.file not in row.lacks]
        assert verify(row, [SUITE if SUITE in here else here[0]], [1]) >= 225
    if row.lacks - {TABLE}:
        with pytest.raises(RunFolderError, match=r"not verified: seed 2 on .*segar results fetch"):
            verify(row, seeds=[2])


@pytest.mark.results
@pytest.mark.slow
@pytest.mark.parametrize("name", SHIPPED_ROWS)
def test_all_of_a_shipped_row_plays_again_to_the_bit(name):
    said = []
    row = read_row(SHIPPED / name)
    assert verify(row, say=said.append) > 0
    if row.lacks - {TABLE}:
        assert "not verified: seed 1 on" in said[0] and "segar results fetch" in said[0]


@pytest.mark.results
@pytest.mark.parametrize("name", ["ppo_fast-state-laptop", "ppo_recurrent-state-laptop", "script"])
def test_the_leaderboard_has_the_causes_that_the_library_finds(name):
    row, of = read_row(SHIPPED / name), suite(WITH_TWINS)
    assert verify(row, [WITH_TWINS], [1]) > len(of.test_levels) + of.training_levels
    stated = causes_of_rows([row]).query("suite == @WITH_TWINS and seed == 1")
    assert len(stated) > 1 and stated["differs"].any()
    if name != "script":
        network = NetworkPolicy(Network.load(row.folder / f"{WITH_TWINS}-s1.npz"), unit_actions=True)
        found = find_causes(network, twins(of), train=of.sample(1), unit_actions=True)
        columns = ["group", "differs", "twins", "success_twin", "effect", "effect_low", "attributed", "attributed_high"]
        pd.testing.assert_frame_equal(
            pd.DataFrame(found.rows())[columns], stated[columns].reset_index(drop=True), rtol=1e-5
        )


@pytest.mark.results
@pytest.mark.parametrize(("name", "seed"), [("number-more-v1", 1)])
def test_the_library_alone_gives_the_scores_of_the_leaderboard(name, seed):
    folder = SHIPPED / "ppo_fast-state-laptop"
    network = NetworkPolicy(Network.load(folder / f"{name}-s{seed}.npz"), unit_actions=True)
    found = evaluate_on_suite(network, suite(name), seed=seed, scores=True, unit_actions=True)
    scores = pd.read_csv(SHIPPED / "scores.csv").set_index(["row", "suite", "seed"]).loc[folder.name, name, seed]
    ours = {"train_score": found.train.score(), "score": found.test.score(), "regret": found.test.regret()}
    ours |= {"gap": found.gap().value, "test_success": found.test.mean("success").value}
    assert ours == pytest.approx({key: scores[key] for key in ours}, rel=1e-5)


@pytest.mark.results
def test_shipped_rows_are_small_and_of_the_suites_that_there_are():
    rows = [read_row(SHIPPED / name) for name in SHIPPED_ROWS]
    sizes = [sum(path.stat().st_size for path in row.folder.iterdir()) for row in rows]
    assert max(sizes) < 2.5e6 and sum(sizes) < 11e6
    assert all(suite(piece.suite).hash == piece.suite_hash for row in rows for piece in row.pieces)
    assert {*protocol.REFERENCES} <= {*SHIPPED_ROWS}


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["cores", "submitit_local"])
def test_jobs_of_a_launcher_add_to_one_row(tmp_path, launcher):
    asked = [f"hydra/launcher={launcher}", f"suite={SUITE}", "seed=1,2", "seeds=1", "budget=open", "scale.frames=2_000"]
    common = ["report=false", "processes=1", "tracking=none", "observation=state", "algorithm=ppo_fast"]
    done = run_module(
        "segar.experiments.benchmark", "--multirun", *asked, *common, f"root={tmp_path / 'runs'}", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    row = read_row(tmp_path / "runs" / "benchmark" / "ppo_fast-state-open")
    assert [piece.seed for piece in row.pieces] == [1, 2]


@pytest.mark.slow
def test_the_command_verifies_and_explains_itself():
    assert "suite=core" in run_module("segar.experiments.benchmark", "--help").stdout
    done = run_module("segar.experiments.benchmark", "verify=idle", f"suite={SUITE}")
    assert done.returncode == 0 and "episodes are equal to the bit" in done.stdout, done.stderr
    wrong = run_module("segar.experiments.benchmark", "verify=idel")
    assert wrong.returncode == 1 and "there is no row 'idel'. Did you mean 'idle'?" in wrong.stderr
