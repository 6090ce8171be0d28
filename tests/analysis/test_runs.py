"""Any runs as a table, their means over level sets, and the plot of the gap: laws, and what is said of what is missing."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import segar
from segar import Levels, SegarError
from segar.analysis.distances import count_pairs, in_one_unit, own_levels
from segar.analysis.gap_plot import correlation, draw, gap_plot
from segar.analysis.runs import (
    about_level_sets,
    column_name,
    read_runs,
    shared_levels,
    summarise,
    summary_text,
    training_sets,
)
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.tables import read_frame
from segar.experiments.runs.run_folder import LEVELS_TEST, LEVELS_TRAIN, VERSIONS, read_versions, write_json
from segar.experiments.runs.run_rows import as_columns, code_warning, run_rows
from segar.experiments.settings import LevelsConfig, RunFolderError
from segar.experiments.settings.own_code import file_fingerprint
from segar.metrics import spread, w2
from tests.synthetic_runs import settings, write_run


def table(level_seeds=(1, 2, 3), seeds=(1, 2), noise=0.0):
    """Invented runs of two families, three numbers of levels, and all pairs of these seeds."""
    rng = np.random.default_rng(0)
    rows = []
    for train in ("calm", "gale"):
        for count in (1, 10, 100):
            for level_seed in level_seeds:
                w2 = 3 / count**0.3 + 0.2 * level_seed
                for seed in seeds:
                    gap = -2 * w2 + noise * rng.normal() + 0.1 * seed
                    settings = {"levels.train": train, "levels.count": count, "levels.seed": level_seed, "seed": seed}
                    figures = {"w2_exact": w2, "gap_deterministic": gap, "success_test_deterministic": 0.5}
                    rows.append({"run": f"r{len(rows)}", **settings, "state": "finished", **figures})
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sweep of two numbers of levels and two level sets, one agent each, and a run that is not finished."""
    root = tmp_path_factory.mktemp("runs")
    for count, seed in ((1, 1), (1, 2), (2, 1), (2, 2), (4, 1)):
        levels = LevelsConfig("empty-easy", count=count, seed=seed, test_count=3)
        write_run(settings(root, levels=levels), finished=count < 4)
    return root


def title_of(runs, **options):
    """The words of a plot's title."""
    return " ".join(gap_plot(runs, **options).axes[0].get_title(loc="left").split())


def crossed(level_seeds=(1, 2, 3), tests=("calm", "gale")):
    """The runs of one family, each once for every test distribution: the same agents on the same training levels."""
    runs = table(level_seeds, noise=1.0)
    runs = runs[runs["levels.train"] == "calm"]
    parts = []
    for test in tests:
        parts.append(runs.assign(gap_deterministic=runs["gap_deterministic"] - (test == "gale")))
        parts[-1].insert(2, "levels.test", test)
    return pd.concat(parts, ignore_index=True)


@pytest.mark.parametrize("level_seeds", [(1, 2), (1, 2, 3, 4)])
def test_more_test_distributions_are_no_more_level_sets(level_seeds):
    one, two = (correlation(crossed(level_seeds, tests), "w2_exact", "gap") for tests in (("calm",), ("calm", "calm")))
    assert one.n == two.n == len(level_seeds)
    assert (one.low, one.high) == pytest.approx((two.low, two.high), nan_ok=True)
    assert np.isnan(two.low) == (len(level_seeds) < 3)
    assert f"{12 * len(level_seeds)} runs on {len(level_seeds)} level sets" in title_of(crossed(level_seeds))


def test_level_sets_whose_seed_is_that_of_the_run_are_told_apart_without_a_column_of_their_own():
    """As in the tables of a study, where levels.seed is empty if it is the seed of the run."""
    runs = pd.DataFrame({"family": "calm", "seed": [1, 1, 2, 2], "levels.seed": [np.nan, 2, 1, np.nan]})
    sets = training_sets(runs)
    assert sets[0] == sets[2] != sets[1] == sets[3]
    with pytest.raises(SegarError, match="no column says on which level set"):
        training_sets(pd.DataFrame({"gap": [1.0]}))


def test_fewer_than_three_level_sets_have_no_interval_and_the_text_says_so():
    runs = table(level_seeds=(1, 2))
    found = summarise(runs)
    assert np.isnan(found["low"]).all() and set(found["note"]) == {"2 level sets: no interval"}
    assert np.isfinite(found["estimate"]).all()
    text = summary_text(runs.to_dict("records"))
    assert "2 level sets: no interval. It takes 3; sweep levels.seed." in text and "[" not in text
    equal = summary_text(table().to_dict("records"))  # success is 0.5 everywhere
    assert "Units with equal results have no interval" in equal


def test_means_of_all_figures_are_written_to_a_file(tmp_path):
    runs = table(noise=1.0).assign(odd=np.arange(36.0))
    for read, path in ((pd.read_csv, tmp_path / "means.csv"), (pd.read_parquet, tmp_path / "means.parquet")):
        summary_text(runs.to_dict("records"), path)
        found = read(path)
        assert set(found["figure"]) == {"w2_exact", "gap_deterministic", "success_test_deterministic", "odd"}
        expected = summarise(runs, ["odd"])
        np.testing.assert_allclose(found[found["figure"] == "odd"]["low"], expected["low"])


@pytest.mark.parametrize("seeds", [(1, 2), (1, 2) * 5])
def test_the_interval_is_that_of_the_means_of_level_sets_however_many_agents_were_trained_on_each(seeds):
    runs = table(seeds=seeds, noise=1.0)
    found = summarise(runs, ["gap"], by=["train", "count"])
    assert (found["unit"] == "level sets").all() and (found["n"] == 3).all() and (found["runs"] == 3 * len(seeds)).all()
    mine = runs[(runs["levels.train"] == "gale") & (runs["levels.count"] == 10)]
    expected = mean_of_replicates(mine.groupby("levels.seed")["gap_deterministic"].mean().to_numpy())
    (row,) = found[(found["levels.train"] == "gale") & (found["levels.count"] == 10)].to_dict("records")
    assert (row["estimate"], row["low"], row["high"]) == pytest.approx((expected.estimate, expected.low, expected.high))


def test_the_interval_of_a_share_stays_between_0_and_1_and_that_of_a_gap_does_not():
    success, gap = [1.0, 1.0, 0.7], [0.1, 0.1, -0.2]
    runs = pd.DataFrame({"levels.seed": [0, 1, 2], "success_test_deterministic": success, "gap_deterministic": gap})
    share, other = summarise(runs, ("success_test", "gap"), by=()).to_dict("records")
    assert share["high"] == 1.0 and other["high"] > 0.1
    assert share["low"] == pytest.approx(share["estimate"] - (other["high"] - other["estimate"]))


def test_agents_on_one_level_set_are_told_from_level_sets_with_the_way_out():
    runs = table(level_seeds=(0,), seeds=(1, 2, 3))
    assert set(summarise(runs)["unit"]) == {"agents"}
    text = summary_text(runs.to_dict("records"))
    assert "say nothing about other levels. Cross the seeds: --multirun seed=1,2,3 levels.seed=1,2,3" in text
    crossed = summary_text(table().to_dict("records"))
    assert "Cross the seeds" not in crossed and "over level sets" in crossed


def test_runs_are_read_with_their_settings_figures_and_errors(folder):
    runs = read_runs(folder)
    done = runs[runs["state"] == "finished"]
    assert len(done) == 4 and (done["gap_se_deterministic"] >= 0).all()
    (lost,) = runs[runs["state"] != "finished"].to_dict("records")
    assert lost["levels.count"] == 4 and np.isnan(lost["gap_deterministic"])
    names = {"w2": "w2_exact", "gap": "gap_deterministic", "count": "levels.count"}
    assert {name: column_name(runs, name) for name in names} == names
    text = summary_text(as_columns(run_rows([folder])))
    assert "not counted: 1 of 5 runs;" in text
    with pytest.raises(RunFolderError, match="there is no run of the sweep mine in"):
        read_runs(folder, sweep="mine")
    with pytest.raises(SegarError, match=r"the runs have no column 'gab'\."):
        column_name(runs, "gab")


def test_the_interval_of_a_correlation_is_over_level_sets_and_not_over_runs():
    few, many = (correlation(table(seeds=seeds, noise=0.0), "w2", "gap") for seeds in ((1, 2), (1, 2) * 5))
    assert few.n == many.n == 6  # two families, three seeds of levels each
    assert (few.low, few.high) == pytest.approx((many.low, many.high))
    one = correlation(table(level_seeds=(0,))[lambda runs: runs["levels.train"] == "calm"], "w2", "gap")
    assert one.n == 1 and np.isnan(one.low) and one.note == "one level set has no interval"


def test_the_plot_has_the_correlation_given_colours_and_given_all_settings():
    runs = table(noise=0.5)
    title = gap_plot(runs, group="train").axes[0].get_title(loc="left").splitlines()
    cell = runs.assign(cell=runs["levels.train"] + runs["levels.count"].astype(str))
    given = correlation(cell, "w2", "gap", "cell")
    kinds = ["r", "r given the groups", "r given all settings but seeds"]
    assert [line.partition(" =")[0] for line in title[1:4]] == kinds
    assert f"r given all settings but seeds = {given.estimate:+.2f}, 95 % [{given.low:+.2f}" in title[3]


@pytest.fixture(scope="module")
def near_and_far(tmp_path_factory):
    """Level files of runs on easy levels, of which some are tested on hard ones and some in another family."""
    root = tmp_path_factory.mktemp("pairs")
    for seed in (1, 2, 3):
        for test in (None, "empty-hard", "objectsx3-hard"):
            levels = LevelsConfig("empty-easy", count=2, seed=seed, test=test, test_count=5)
            write_run(settings(root, levels=levels), level_files=True)
    return root


def test_w2_of_several_pairs_is_in_one_unit_which_is_the_spread_over_all_their_distributions(near_and_far):
    runs = read_runs(near_and_far)
    measured = [own_levels(Path(folder)) for folder in runs["folder"]]
    assert count_pairs(measured) == 3
    unit = spread(*(segar.family(name) for name in ("empty-easy", "empty-hard", "objectsx3-hard")))
    expected = [w2(Levels.load(one.train), Levels.load(one.test), scale=unit) for one in measured]
    np.testing.assert_allclose(in_one_unit(measured), expected)
    np.testing.assert_allclose(in_one_unit(measured[::-1]), expected[::-1])
    assert "w2_exact has a unit for each of the 3 pairs" in summary_text(as_columns(run_rows([near_and_far])))


def test_the_plot_draws_several_pairs_in_one_unit_and_says_where_it_cannot(near_and_far, tmp_path):
    runs = read_runs(near_and_far).assign(gap_deterministic=-1.0 - np.arange(9) % 4)
    assert gap_plot(runs).axes[0].get_xlabel().endswith("in one unit for all")
    own = gap_plot(runs, x="w2_exact").axes[0]
    assert own.get_xlabel() == "W2 between training and test levels"
    assert "compare it within a pair; --x w2 has one unit for all" in " ".join(own.get_title(loc="left").split())
    assert "pair" not in title_of(runs[runs["levels.test"].isna()])
    lost = tmp_path / "lost"
    shutil.copytree(runs["folder"].iloc[4], lost)
    (lost / LEVELS_TEST).unlink()
    axes = gap_plot(runs.assign(folder=[*runs["folder"][:-1], str(lost)])).axes[0]
    assert axes.get_xlabel() == "W2 between training and test levels"
    assert "there is none for all, because there is no" in " ".join(axes.get_title(loc="left").split())


@pytest.mark.parametrize("cells", [False, True])
def test_the_plot_says_what_its_points_are_and_of_how_many_runs(cells, tmp_path):
    figure = gap_plot(table(noise=0.5), path=tmp_path / "gap.png", cells=cells)
    (axes,) = figure.axes
    bars = "; bars: 95 % intervals over level sets"  # the invented runs have no episodes
    kind = f"6 means of 36 runs on 6 level sets{bars}" if cells else "36 runs on 6 level sets\n"
    assert axes.get_title(loc="left").startswith(kind)
    lines = axes.get_title(loc="left").splitlines()
    if cells:
        means = table(noise=0.5).groupby(["levels.train", "levels.count"])[["w2_exact", "gap_deterministic"]].mean()
        assert lines[1] == f"r of the 6 means = {means.corr().iloc[0, 1]:+.2f}"
    of = "r of the runs" if cells else "r"
    assert [line for line in lines if line.startswith(f"{of} = -0.")]
    assert axes.get_xlabel() == "W2 between training and test levels"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["calm", "gale"]
    points = sum(len(np.asarray(part.get_offsets())) for part in axes.collections if len(part.get_offsets()) > 1)
    assert points >= (6 if cells else 36)
    with Image.open(tmp_path / "gap.png") as picture:
        assert picture.size[0] > 500


def test_the_command_writes_the_figure_and_says_what_is_left_out(folder, tmp_path, capsys):
    draw(str(folder), output=str(tmp_path / "gap.svg"), x="ks", y="success_test", group="count")
    said = capsys.readouterr().out
    assert said.startswith("4 runs on 2 level sets") and "1 without these figures left out" in said
    assert (tmp_path / "gap.svg").read_text().startswith("<?xml")


def test_what_cannot_be_plotted_is_an_error_that_names_it(folder, tmp_path):
    with pytest.raises(SegarError, match=r"'.*gap.gif' ends in none of .png, .pdf, .svg"):
        draw(str(folder), output=str(tmp_path / "gap.gif"))
    with pytest.raises(SegarError, match="there is no folder"):
        draw(str(tmp_path / "nowhere"))
    for options, why in (
        ({"group": "run"}, "run has 36 values, and 7 colours can be told apart"),
        ({"group": "famly"}, "the runs have no column 'famly'"),
        ({"x": "levels.train"}, "the column levels.train holds text, such as '.*', and numbers are needed"),
    ):
        with pytest.raises(SegarError, match=why):
            gap_plot(table(), **options)
    assert list(tmp_path.iterdir()) == []


def from_a_file(root, seeds, count, held=6):
    """Runs on levels of one file that holds so many, one for each seed of the levels, with gaps of their own."""
    root.mkdir(exist_ok=True)
    path = root / "few.npz"
    if not path.exists():
        segar.family("empty-easy").sample(held, seed=held).save(path)
    held_levels = f"{path}#{file_fingerprint(path, '')}"
    for seed in seeds:
        levels = LevelsConfig(held_levels, count=count, seed=seed, test="empty-easy", test_count=3)
        write_run(settings(root / "runs", levels=levels), level_files=True)
    return read_runs(root / "runs").assign(gap_deterministic=-1.0 - 0.1 * np.arange(len(seeds)))


def test_seeds_that_give_the_same_levels_of_a_file_are_one_level_set(tmp_path):
    runs = from_a_file(tmp_path, (1, 2, 3), count=6)
    assert len(set(training_sets(runs))) == 1
    found = summarise(runs, ["gap"], by=())
    assert list(found["level_sets"]) == [1] and list(found["unit"]) == ["agents"]
    text = summary_text(runs.to_dict("records"))
    assert "Several levels.seed gave the same levels" in text and "Cross the seeds" not in text
    assert "level sets share levels" not in text
    title = title_of(runs, x="ks")
    assert title.startswith("3 runs on 1 level set; bars: 95 % intervals over the episodes of a run ")
    assert "gave the same levels" in title
    own = runs.assign(folder="nowhere")
    assert len(set(training_sets(own))) == 3  # without the levels, the seeds are all that is known


def test_level_sets_that_share_a_part_of_their_levels_are_told(tmp_path):
    runs = from_a_file(tmp_path, (0, 1, 2), count=4)
    levels = [Levels.load(Path(folder) / LEVELS_TRAIN) for folder in runs["folder"]]
    rows = [{one.values[k].tobytes() for k in range(4)} for one in levels]
    share = max(len(a & b) / 4 for a in rows for b in rows if a != b)
    assert 0 < share < 1 and shared_levels(runs) == share
    assert f"the level sets share levels: up to {share:.0%} of one" in summary_text(runs.to_dict("records"))
    assert "level sets share levels" in title_of(runs, x="ks")


def test_level_sets_without_common_levels_are_told_nothing(tmp_path):
    runs = from_a_file(tmp_path, (0,), count=2)
    both = pd.concat([runs, from_a_file(tmp_path / "other", (1,), count=2, held=2)], ignore_index=True)
    assert len(set(training_sets(both))) == 2
    assert list(about_level_sets(both, by=())) == []
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / LEVELS_TRAIN).write_bytes(b"nothing")
    with pytest.raises(RunFolderError, match="is not a level file, or only part of one"):
        training_sets(runs.assign(folder=str(tmp_path / "broken")))


def test_the_plot_of_runs_of_different_code_has_the_warning_of_the_table(tmp_path):
    runs = from_a_file(tmp_path, (0, 1, 2), count=1)
    assert "different code" not in title_of(runs, x="ks")
    edited = Path(runs["folder"].iloc[1])
    write_json(edited / VERSIONS, {**read_versions(edited), "code": {"kernel": "f" * 16}})
    warning = code_warning(run_rows([tmp_path / "runs"]))
    assert warning.startswith("warning: these runs were made by different code")
    assert warning in title_of(runs, x="ks")


def test_names_are_drawn_as_they_are_and_not_as_markup():
    names = ["_a", "$a_$", "cost $5 vs $6"]
    runs = pd.concat([table(noise=1.0).assign(kind=name) for name in names], ignore_index=True)
    figure = gap_plot(runs, group="kind")
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert [text.get_text().strip() for text in legend.get_texts()] == sorted(names)
    assert not any(text.get_parse_math() for text in legend.get_texts())


def test_a_text_of_very_many_columns_is_refused(tmp_path):
    (tmp_path / "wide.csv").write_text("a," * 10_000 + "b\n")
    with pytest.raises(RunFolderError, match=r"wide.csv is not a table.*more than 10,000 columns"):
        read_frame(tmp_path / "wide.csv")
