"""The leaderboard: what the shipped page and tables say is what the shipped rows say, and scores mean what they should."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from mlflow import MlflowClient

from segar.analysis.benchmark.causes import EFFECT, causes_in, causes_of_rows, effects_on, shift_effects
from segar.analysis.benchmark.leaderboard_page import (
    escaped,
    named,
    number,
    page_text,
    place_text,
    practice_table,
    rows_table,
)
from segar.analysis.benchmark.make import BOARD, CAUSES, PAGE, PROFILE, SCORES, report_rows
from segar.analysis.benchmark.scores import (
    DRAWN,
    FIGURES,
    OVERALL,
    PRACTICE,
    QUANTITIES,
    WEIGHTED,
    beats_chance,
    by_name,
    figures_of,
    leaderboard,
    learners_on,
    places_of,
    rows_in,
    suites_compared,
)
from segar.experiments.benchmarking.protocol import REFERENCES, SHIPPED
from segar.experiments.benchmarking.row import (
    EPISODES,
    ROW,
    TABLE,
    Drawn,
    Method,
    NewPiece,
    Piece,
    Row,
    add_pieces,
    file_hash,
    hash_of,
    write_drawn,
)
from segar.experiments.settings import RunFolderError, TrackingConfig
from segar.experiments.tracking.mlflow_store import store_uri
from segar.suites import CORE, outline, suite, suites
from segar.support import RESULTS, read_manifest

pytestmark = pytest.mark.results

MADE = (SCORES, BOARD)


@pytest.fixture(scope="module")
def rows():
    return rows_in([SHIPPED])


@pytest.fixture(scope="module")
def causes(rows):
    return causes_of_rows(rows)


@pytest.fixture(scope="module")
def table(rows, causes):
    return figures_of(rows, causes)


@pytest.fixture(scope="module")
def compared(table):
    return suites_compared(table, [name for name in CORE if name in set(table["suite"])])


def test_the_shipped_page_and_tables_are_made_of_the_shipped_rows(tmp_path, monkeypatch):
    shipped = tmp_path / "benchmark"
    shutil.copytree(SHIPPED, shipped, ignore=shutil.ignore_patterns(PAGE, "*.csv", "*.png"))
    monkeypatch.setattr("segar.analysis.benchmark.make.SHIPPED", shipped)
    report_rows(shipped)
    assert (shipped / PAGE).read_text() == (SHIPPED / PAGE).read_text(), "make it again: table=true"
    for name in MADE:
        pd.testing.assert_frame_equal(pd.read_csv(shipped / name), pd.read_csv(SHIPPED / name), rtol=1e-4)
    assert (shipped / f"{PROFILE}.png").stat().st_size > 1000
    (causes,) = (one for one in read_manifest(RESULTS) if one.path == f"{SHIPPED.name}/{CAUSES}")
    assert causes.as_in(tmp_path) == causes, "note its hash again: segar results record"


@pytest.mark.slow
def test_a_row_is_a_run_of_mlflow_with_its_scores_however_often_it_is_reported(tmp_path):
    rows, root = tmp_path / "rows", tmp_path / "runs"
    shutil.copytree(SHIPPED / "script", rows / "script")
    for _ in range(2):
        report_rows(rows, "script", {"name": "mlflow"}, str(root))
    client = MlflowClient(store_uri(TrackingConfig(), root))
    experiment = client.get_experiment_by_name(TrackingConfig().experiment)
    (run,) = client.search_runs([experiment.experiment_id], "tags.kind = 'row' and tags.sweep = 'script'")
    board = pd.read_csv(rows / BOARD)
    of_script = board.loc[(board["row"] == "script") & (board["axis"] == OVERALL)]
    (overall,) = of_script.loc[of_script["quantity"] == "score", "estimate"]
    assert run.data.metrics[f"score/{OVERALL}"] == pytest.approx(overall, abs=1e-5)
    scores = pd.read_csv(rows / SCORES)
    success = scores.loc[(scores["row"] == "script") & (scores["suite"] == CORE[0]), "test_success"].mean()
    assert run.data.metrics[f"test_success/{CORE[0]}"] == pytest.approx(success, abs=1e-5)
    assert {one.path for one in client.list_artifacts(run.info.run_id)} >= {PAGE, SCORES}


def test_the_planner_scores_1_and_has_no_regret_and_idle_and_random_score_0_at_most(table):
    planner, others = table.loc[table["row"] == "planner"], table.loc[table["row"].isin(["idle", "random"])]
    assert np.allclose(planner[["score", "train_score"]], 1) and np.allclose(planner["regret"], 0)
    assert (others["score"] < 0.01).all()
    random = table.loc[table["row"] == "random"]
    assert np.allclose(planner[PRACTICE], 1) and np.allclose(random.groupby("suite")[PRACTICE].mean(), 0, atol=1e-3)


def test_the_regret_is_that_of_the_plans_that_come_with_the_suite(table):
    idle = table.loc[(table["row"] == "idle") & (table["suite"] == "place-few-v1")]
    expected = suite("place-few-v1").plans.returns.mean() - idle["test_return"]
    assert np.allclose(idle["regret"], expected)
    assert np.allclose(table["gap"], table["test_return"] - table["train_return"])


# Admitted by players that are in no ranking (docs/how-to/compare-on-a-suite.md).
BY_PANEL = {"place-pockets-v1", "sight-ball-v1", "goal-bank-v1", "goal-errand-v1"}


@pytest.mark.parametrize("name", [name for name in suites() if name not in BY_PANEL])
def test_a_reference_agent_learns_every_suite_and_leaves_room(table, name):
    seen = "rgb_stack2" if outline(name)["axis"] == "look" else "state"
    of = table.loc[(table["suite"] == name) & (table["row"] == f"ppo_fast-{seen}-laptop")]
    assert len(of) and set(of["suite_hash"]) == {suite(name).hash}
    assert of["train_success"].mean() >= 0.8 and of["test_success"].mean() <= 0.95


def test_a_row_that_lacks_a_suite_is_not_compared_on_it(table, compared):
    less = table.loc[(table["row"] != "script") | (table["suite"] != CORE[0])]
    board = leaderboard(less, compared)
    axis = next(axis for axis, names in compared.items() if CORE[0] in names)
    for name in (OVERALL, axis):
        scores = board.loc[(board["axis"] == name) & board["quantity"].isin([PRACTICE, "score"])]
        assert "script" not in set(scores["row"])
    assert "script" in set(board["row"])


def test_a_row_with_too_few_seeds_for_a_place_does_not_undo_a_ranking_of_others():
    seeds = {"better": 5, "worse": 6, "new": 1}
    lines = [(row, name, seed) for row, n in seeds.items() for name in ("a", "b") for seed in range(n)]
    table = pd.DataFrame(lines, columns=["row", "suite", "seed"]).assign(**{DRAWN: 0.5})
    found = learners_on(table, ["a", "b"])
    assert found.groupby("row")["seed"].nunique().to_dict() == {"better": 5, "worse": 5}
    few = learners_on(table.loc[table["seed"] < 3], ["a", "b"])
    assert few.groupby("row")["seed"].nunique().to_dict() == {"better": 1, "worse": 1, "new": 1}


@pytest.mark.parametrize("new", [range(100, 105), range(5, 10)])
def test_a_row_with_other_seeds_does_not_undo_a_ranking_of_others(new):
    seeds = {"better": range(5), "worse": range(10), "new": new}
    lines = [(row, name, seed) for row, own in seeds.items() for name in ("a", "b") for seed in own]
    table = pd.DataFrame(lines, columns=["row", "suite", "seed"]).assign(**{DRAWN: 0.5})
    found = learners_on(table, ["a", "b"])
    assert found.groupby("row")["seed"].unique().map(list).to_dict() == {"better": [*range(5)], "worse": [*range(5)]}


def test_a_row_at_chance_makes_no_ranking_of_others():
    lines = [
        (row, name, seed) for row in ("better", "worse", "idle-like") for name in ("a", "b", "c") for seed in range(5)
    ]
    table = pd.DataFrame(lines, columns=["row", "suite", "seed"])
    success = {"better": 0.6, "worse": 0.5, "idle-like": 0.0}
    noise = np.random.default_rng(0).normal(0, 0.01, len(table))
    found = learners_on(table.assign(**{DRAWN: table["row"].map(success) + noise}), ["a", "b", "c"])
    assert set(found["row"]) == {"better", "worse"}


def test_a_planted_cause_is_found_on_its_twins_and_on_no_control():
    """A player that fails on odd levels, and on the twins of a third of them."""
    lines = [("test", level, level % 2 == 0) for level in range(12)]
    lines += [("twin-Mass", level, level % 2 == 0 or level % 3 == 0) for level in range(12)]
    lines += [("control-place", level, level % 2 == 0) for level in (1, 2, 5, 8)]
    lines += [("control-place", 99, True)]  # of a level that is not in the test
    episodes = pd.DataFrame(lines, columns=["levels", "level", "success"]).assign(suite="a-v1", seed=1)
    found = causes_in(episodes).set_index("group")
    assert list(found["differs"]) == [True, False] and list(found["twins"]) == [12, 4]
    assert found.loc["Mass", "effect"] == pytest.approx(2 / 12) and found.loc["place", "effect"] == 0
    assert found.loc["Mass", "attributed"] == pytest.approx(2 / 6)
    effects = shift_effects(found.reset_index().assign(row="mine"))
    assert effects == {("mine", "a-v1", 1): pytest.approx(2 / 12)}


def test_of_several_groups_that_differ_the_shift_is_all_of_them():
    causes = pd.DataFrame({"group": ["Mass", "Size", "all"], "differs": True, "effect": [0.1, 0.2, 0.4]})
    assert shift_effects(causes.assign(row="mine", suite="a-v1", seed=1)) == {("mine", "a-v1", 1): 0.4}


def test_an_effect_of_one_seed_has_no_interval_over_seeds():
    lines = [("test", seed, level, level < 2) for seed in (1, 2) for level in range(9)]
    lines += [("twin-Mass", seed, level, level < 4 * seed) for seed in (1, 2) for level in range(9)]
    episodes = pd.DataFrame(lines, columns=["levels", "seed", "level", "success"]).assign(suite="a-v1")
    causes = causes_in(episodes)
    found = effects_on("a-v1", pd.concat([causes.assign(row="two"), causes[causes.seed == 1].assign(row="one")]))
    one, two = found.sort_values("row").to_dict("records")
    assert one["estimate"] == pytest.approx(2 / 9) and np.isnan([one["low"], one["high"]]).all()
    assert two["estimate"] == pytest.approx(4 / 9) and (two["low"], two["high"]) == (-1, 1)


def test_every_row_but_the_references_has_the_effect_of_the_shift_where_training_and_test_differ(table, causes):
    assert {*causes["row"]} == {*table["row"]} - {*REFERENCES}
    shifted = {*causes.loc[causes["differs"], "suite"]}
    own = table.loc[~table["row"].isin(REFERENCES)]
    assert (own[EFFECT].notna() == own["suite"].isin(shifted)).all() and "place-few-v1" not in shifted
    controls = causes.loc[~causes["differs"]].groupby(["row", "suite", "group"])["effect"].mean()
    assert controls.abs().median() < 0.05


def planted_piece(of, seed, levels, hashed):
    """Every second one of these test levels is solved."""
    n, every = len(levels), [*levels]
    columns = {"suite": [of.name] * n, "seed": [seed] * n, "levels": ["test"] * n, "level": every}
    played = {"return": [0.5] * n, "length": [3] * n, "success": [k % 2 == 0 for k in every], "death": [False] * n}
    piece = Piece(of.name, hashed, seed, {"test": of.hashes["levels"]})
    return NewPiece(piece, pa.table(columns | played, EPISODES), None)


@pytest.mark.parametrize(
    ("levels", "hashed", "said"),
    [
        (range(1, 200), None, "must have its 200 test levels"),
        (range(0, 200, 2), None, "must have its 200 test levels"),
        (range(201), None, "must have its 200 test levels"),
        ([*range(200), 7], None, "must have its 200 test levels"),
        (range(200), "0" * 16, "played on .* with the hash 0{16}, and the suite of this name has"),
    ],
)
def test_a_row_with_other_test_levels_or_of_another_version_of_a_suite_is_in_no_table(tmp_path, levels, hashed, said):
    of = suite(CORE[0])
    row = add_pieces(
        tmp_path / "mine", Method("mine", "networks", "planted"), [planted_piece(of, 1, levels, hashed or of.hash)]
    )
    with pytest.raises(RunFolderError, match=said):
        figures_of([row], causes_of_rows([row]))


def test_success_weighted_by_time_says_of_rows_what_it_says_on_practice_levels(rows, table):
    """The planner searches less on drawn levels, so that all of them are a little better."""
    names = ["sac_fast-state-laptop", "ppg_fast-state-laptop", "ppo_fast-state-laptop", "imitation", "evolution"]
    known, practice = by_name(rows), pd.DataFrame()
    planner = known["planner"].results().to_pandas().query("levels == 'test'").drop(columns="seed").drop_duplicates()
    for name in names:
        row = known[name].results().to_pandas().query("levels == 'test'")
        both = row.merge(planner, on=["suite", "level"], suffixes=("", "_of_planner"), validate="many_to_one")
        assert len(both) == len(row) and both["success_of_planner"].all()
        part = (both["length_of_planner"] / both["length"]).clip(upper=1).where(both["success"], 0)
        practice[name] = part.groupby(both["suite"]).mean().reindex(CORE).dropna()
    drawn = table.pivot_table(WEIGHTED, "suite", "row").loc[practice.index, names]
    assert len(drawn) == 11 and drawn.notna().all(axis=None)
    for of in (drawn, practice):
        assert list(of.mean().sort_values(ascending=False).index) == names
    assert (drawn - practice).mean().between(-0.01, 0.1).all()


def test_of_many_learners_at_chance_none_beats_it():
    """Twenty of them on a hundred suites, five seeds each; and on one more suite, a learner that learns."""
    rng = np.random.default_rng(0)
    lines = [(f"s{k}", row, rng.normal(0.0, 0.02)) for k in range(100) for row in range(20) for _ in range(5)]
    lines += [("learned", row, rng.normal(0.3 * (row == 3), 0.02)) for row in range(20) for _ in range(5)]
    table = pd.DataFrame(lines, columns=["suite", "row", DRAWN]).assign(**{PRACTICE: np.nan})
    assert np.mean([beats_chance(table, f"s{k}") for k in range(100)]) < 0.08 and beats_chance(table, "learned")
    alike = table.assign(suite="alike", **{DRAWN: 1.0})  # as of learners that solve all levels with all seeds
    assert beats_chance(alike, "alike") and not beats_chance(alike.assign(**{DRAWN: 0.0}), "alike")


def test_rows_are_placed_by_drawn_levels_and_those_without_are_practice_alone(tmp_path):
    """Planted: five seeds of two rows, one of which solves more; and a third one whose levels were not drawn."""
    rows = tmp_path / "rows"
    for k, name in enumerate(("ahead", "behind", "recorded")):
        new, drawn = [], []
        for of, seed in ((suite(name), seed) for name in CORE[:3] for seed in range(1, 6)):
            new.append(planted_piece(of, seed, range(200), of.hash))
            solved = 900 - 100 * k + 7 * (k + 1) * seed  # more than those of shipped rows
            drawn.append(Drawn(of.name, seed, "", "0" * 16, 1000, solved, 500, 1000, 3000, 2000, "0"))
        row = add_pieces(
            rows / name,
            Method(name, "networks", "planted", "laptop", 100, {"observation": {"name": "state", "options": {}}}),
            new,
        )
        if name != "recorded":
            write_drawn(row, sorted(drawn, key=lambda one: (one.suite, one.seed)))
    found = figures_of(rows_in([rows]), pd.DataFrame(columns=["row", "suite", "seed", "group", "differs", "effect"]))
    assert places_of(found, CORE[:3]) == {"ahead": (1, 1), "behind": (2, 2)}
    assert found.loc[found["row"] == "ahead", DRAWN].iloc[0] == pytest.approx((0.907 - 0.1) / 0.9)
    report_rows(rows)
    page = (rows / PAGE).read_text()
    ranked, _, rest = page.partition("## Practice test only")
    among_all = places_of(pd.read_csv(rows / SCORES), CORE[:3])
    assert among_all["ahead (not verified)"][0] == 1
    for name in ("ahead", "behind"):
        assert f"| `{name}` (not verified) | {place_text(among_all[f'{name} (not verified)'])} |" in ranked
    assert "`recorded`" not in ranked.partition("## All suites")[2]
    placed = set(re.findall(r"^\| `([\w-]+)`(?: \(not verified\))? \| \d", ranked, re.M))
    asked = placed - {"evolution"}  # which is at chance; nor are those with few seeds
    assert {"ahead", "behind"} < asked and f"of {len(asked)} learners" in rest
    assert "`recorded` (not verified)" in rest
    row = by_name(rows_in([rows]))["ahead"]
    for seeds, said in (({1, 2, 3, 4, 5}, "1 to 5"), ({1, 2, 4, 5}, "1 to 2, 4 to 5"), ({1, 3, 4}, "1, 3 to 4")):
        part = dataclasses.replace(row, pieces=[piece for piece in row.pieces if piece.seed in seeds])
        assert f"| 3 | {said} | " in rows_table({"ahead": part})
    # As where returns of references are no numbers.
    unscored = found.assign(score=np.nan, **{PRACTICE: found["test_success"]})
    table = practice_table(by_name(rows_in([rows])), leaderboard(unscored, suites_compared(found)))
    assert re.search(r"\| `recorded` \| \d\.\d\d.* \| – \| 5 \|", table)


def test_who_plans_or_was_drawn_without_times_has_no_place_there_and_pushes_nobody_from_theirs():
    """Planted: of two rows that are told apart, one solves more, and the other is faster. A row that plans in the simulator is
    better than both; of one, success weighted by time is unknown."""
    planted = {"planning": (0.9, 0.9), "ahead": (0.6, 0.3), "behind": (0.3, 0.5), "older": (0.1, np.nan)}
    rows, lines = {}, []
    for k, (name, (success, weighted)) in enumerate(planted.items()):
        settings = {"privileged": True} if name == "planning" else {}
        drawn = tuple(
            Drawn(of, seed, "", "", 1000, 900, 500, 1000, 1, 1, "") for of in CORE[:2] for seed in range(1, 6)
        )
        pieces = tuple(Piece(one.suite, "", one.seed, {}) for one in drawn)
        rows[name] = Row(Method(name, "networks", "", settings=settings), pieces, Path(), "", drawn=drawn)
        for one in drawn:
            line = {"row": name, "axis": "place", "suite": one.suite, "suite_hash": "", "seed": one.seed}
            varies = 0.01 * (k + 1) * (one.seed - 3) + 0.001 * k * (one.suite == CORE[0])
            lines.append({**line, DRAWN: success + varies, WEIGHTED: weighted + varies})
    columns = dict.fromkeys(["row", "axis", "suite", "suite_hash", "seed", *QUANTITIES, *FIGURES])
    table, causes = pd.DataFrame(lines).reindex(columns=[*columns]), pd.DataFrame(columns=["suite"])
    compared = suites_compared(table)
    page = page_text(rows, table, leaderboard(table, compared), causes, compared)
    assert "By success weighted by time, these rows rank methods:** the coefficient of 2 learners" in page
    assert "Not compared" not in page, "who has drawn levels of all suites is compared, though no reference played here"
    page = page.partition("## All suites")[2].partition("## Practice")[0].splitlines()
    cells = [[one.strip() for one in line.split("|")] for line in page if line.startswith("| ")]
    at = [cells[0].index(one) for one in ("row", "place", "place by it")]
    assert sorted([line[k] for k in at] for line in cells[2:]) == [
        ["`ahead`", "1", "2"], ["`behind`", "2", "1"], ["`older`", "3", "–"], ["`planning` (privileged)", "–", "–"],
    ]  # fmt: skip


def test_a_row_says_that_code_of_its_own_sees_the_state_and_that_one_policy_stands_for_several_seeds():
    def shown(view, files):
        drawn = tuple(Drawn(CORE[0], seed, file, "", 1, 1, 0, 1, 1, 1, "") for seed, file in enumerate(files))
        method = Method("mine", "onnx", "", settings={"observation": {"name": view, "options": {}}})
        return named(Row(method, (), Path(), "", drawn=drawn))

    assert shown("state", "ab") == "`mine`"
    assert shown("my_lab.views:View", "ab") == "`mine` (own observation)"
    assert shown("state", "aa") == "`mine` (one policy for several seeds)"


def test_rows_that_nobody_has_verified_say_so_in_every_table(tmp_path, monkeypatch):
    """The returns of a shipped row were changed, and its hashes were made to fit."""
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "forged"
    row, table = folder / "script" / ROW, folder / "script" / TABLE
    shutil.copytree(SHIPPED / "script", row.parent)
    pd.read_parquet(table).assign(**{"return": lambda rows: rows["return"] + 5.0}).to_parquet(table, index=False)
    data = {name: value for name, value in json.loads(row.read_text()).items() if name != "hash"}
    data["files"][TABLE] = file_hash(table)
    row.write_text(json.dumps({**data, "hash": hash_of(data)}))
    report_rows(folder)
    page = (folder / PAGE).read_text()
    assert all((folder / path).is_file() for path in re.findall(r"\]\(([^)#]+)[^)]*\)", page))
    assert page.count("`script` (not verified)") == page.count("`script`") > 10 and page.count("(not verified)") > 10
    for name in (SCORES, BOARD):
        assert {one for one in pd.read_csv(folder / name)["row"] if "script" in one} == {"script (not verified)"}


def test_what_a_row_says_is_no_markup_of_the_page():
    text = escaped("<img src=x onerror=alert(1)> | [a](javascript:b)\n`c` *d*")
    assert not set("<>\n") & set(text) and text.count("\\") == 7


def test_a_number_between_two_of_its_digits_has_one_text_whatever_the_order_of_its_sum():
    assert 0.1 + 0.2 - 0.285 != 0.015 and number(0.1 + 0.2 - 0.285) == number(0.015)
