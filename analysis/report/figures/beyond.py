"""The figures beyond the paper, and of the studies that train nothing."""

from itertools import product

import numpy as np
import pandas as pd

from segar.analysis.plotting import style
from segar.analysis.plotting.figures import (
    DOT,
    PAGE_WIDTH,
    draw_points,
    error_bars,
    legend_below,
    legend_of,
    new_figure,
    zero_line,
)
from segar.analysis.plotting.names import word_for
from segar.analysis.report.claims.evidence import DISTANCES, Evidence
from segar.analysis.report.claims.rows import CURED_SHARE, all_rule_set_runs, rows_of, trial_columns
from segar.analysis.report.figures.drawing import (
    CELL,
    Drawn,
    NoFigure,
    dots,
    draw_means,
    drawable,
    log_axis,
    success_by_number,
    unit_means,
)
from segar.analysis.report.figures.main_grid import METRICS
from segar.analysis.report.number_format import estimate_text
from segar.analysis.report.results import PANEL, shifts_in_words
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.studies.w2 import TEST_LEVELS
from segar.analysis.tables import column, keep, pick, select

SUCCESS = "success_test_deterministic"
COST = "return there − on own test levels"
DOSES = (("w2_dose", "radius_dose", "W2, coverage equal"), ("radius_dose", "w2_dose", "covering radius, W2 equal"))
CURES = (("foretold", "success gained on causal twins"), ("w2_share", "share of squared W2"))
DESIGN_ORDER = ("matched", "matched_far", "matched_sparse", "matched_far_sparse")


def fixed_n(evidence: Evidence) -> Drawn:
    """Gap against both distances at one number of levels, by design."""
    runs = drawable(evidence.results.of("fixed_n"), "fixed_n", "design")
    judged = rows_of("one number of levels", evidence)
    table = pick(runs, [*CELL, "design", "w2_reference", "w2_exact", "gap", "gap_2022"])
    figure = new_figure(PAGE_WIDTH, 4.2)
    colours, markers = (look(sorted(set(table["design"]))) for look in (style.colours, style.markers))
    for axes, (x, y, x_label, _, y_label) in zip(figure.subplots(1, 2), METRICS, strict=True):
        zero_line(axes)
        for design in sorted(set(table["design"])):
            part = select(table, design=design)
            look = {"color": colours[design], "marker": markers[design], "label": word_for(design), **DOT}
            axes.scatter(column(part, x), column(part, y), s=34, **look)
        found = evidence.correlation(judged, x, y, ("panel", "levels"))
        axes.set_title(f"given panel: {estimate_text(found)}", loc="left", fontsize=9.5)
        axes.set(xlabel=x_label, ylabel=y_label)
    legend_below(figure, figure.axes[0], 5)
    return Drawn(figure, table)


def diversity(evidence: Evidence) -> Drawn:
    """Success on test levels against three measures of the training set."""
    runs = evidence.results.of("diversity")
    names = {"effective_number": "effective number", "entropy": "entropy [nats]", "radius": "covering radius [SD]"}
    names = {k: v for k, v in names.items() if k in runs and np.isfinite(column(runs, k)).all()}
    drawable(runs if names else runs.head(0), "diversity")
    table = pick(runs, [*CELL, "design", *names, SUCCESS])
    figure = new_figure(3.1 * len(names), 4.4)
    for axes, (x, label) in zip(figure.subplots(1, len(names), squeeze=False)[0], names.items(), strict=True):
        draw_points(axes, table, x, SUCCESS)
        found = evidence.correlation(runs, x, SUCCESS, ("panel", "levels"))
        apart = keep(runs, runs["design"] != "clustered")
        rest = evidence.correlation(apart, x, SUCCESS, ("panel", "levels"))
        said = ("given panel and n:", estimate_text(found), "without near ones:", estimate_text(rest))
        axes.set_title("\n".join(said).replace(", p", ",\np"), loc="left", fontsize=8.5)
        axes.set_xlabel(label)
    figure.axes[0].set_ylabel("success on test levels")
    figure.legend(handles=legend_of(table), loc="outside lower center", ncols=6)
    return Drawn(figure, table)


def attribution(evidence: Evidence) -> Drawn:
    """The part of the gap that each group of factors adds."""
    table = drawable(evidence.attribution, "attribution")
    named = table.assign(group=[word_for(name) for name in table["group"]])
    return Drawn(dots(named, "group", "part", "part of the gap"), pick(table, [*CELL, "group", "part", "gap"]))


def rules(evidence: Evidence) -> Drawn:
    """The loss in return in other physics than in training."""
    part = drawable(evidence.results.other_physics, "rules")
    table = pick(part, [*CELL, "trained", "test_variation", "difference", "gap", "gap_se", SUCCESS])
    return Drawn(dots(shifts_in_words(table, "test_variation"), "test_variation", "difference", COST, "trained"), table)


def rule_sets(evidence: Evidence) -> Drawn:
    """Success on training levels and on unseen rule sets against the number of rule sets in training, and the gap against that
    number and against the distance between the dynamics of both."""
    runs = drawable(all_rule_set_runs(evidence), "rule_sets")
    measures = ["dynamics_w2", "success_train_deterministic", SUCCESS, "gap_success", "gap"]
    table = pick(runs, [*CELL, "rule_sets", "chosen", *measures])
    figure = new_figure(9.4, 3.6)
    left, middle, right = figure.subplots(1, 3)
    players = (
        (left, "success_train_deterministic", "training levels", 0.0),
        (left, SUCCESS, "unseen rule sets", 0.0),
        (middle, "gap_success", "", -1.0),
    )
    numbered = select(table, chosen="").astype({"rule_sets": int})
    for k, (axes, value, label, least) in enumerate(players):
        means = unit_means(numbered, "rule_sets", value, least)
        draw_means(axes, k, column(means, "rule_sets"), means, label, "-" if len(means) > 3 else "none")
        axes.scatter(column(numbered, "rule_sets"), column(numbered, value), s=12, color=style.PALETTE[k], alpha=0.5)
        log_axis(axes, sorted(set(means["rule_sets"])))
        axes.set_xlabel("rule sets in training")
    left.set_ylabel("success")
    left.legend(loc="best")
    middle.set_ylabel("gap in success (unseen − training)")
    for k, (number, chosen) in enumerate(sorted(set(zip(table["rule_sets"], table["chosen"], strict=True)))):
        part, label = select(table, rule_sets=number, chosen=chosen), f"{number:,.0f} {chosen}".strip()
        look = {"color": style.PALETTE[k % len(style.PALETTE)], "marker": style.MARKERS[k % len(style.MARKERS)], **DOT}
        right.scatter(column(part, "dynamics_w2"), column(part, "gap_success"), s=26, label=label, **look)
    for axes in (middle, right):
        zero_line(axes)
    right.set(xlabel="W2 between dynamics, training to test", ylabel="gap in success")
    right.legend(title="rule sets", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Drawn(figure, table)


def trials(evidence: Evidence) -> Drawn:
    """Success on unseen rule sets trial by trial, with a memory and without."""
    runs = drawable(rows_of("trials", evidence), "trials")
    names = trial_columns(runs)
    table = pick(runs, [*CELL, "algorithm", "memory", *names])
    figure = new_figure(5.4, 3.8)
    axes = figure.subplots()
    for k, (memory, label) in enumerate(((True, "with a memory"), (False, "without a memory"))):
        part = keep(table, table["memory"] == memory)
        if len(part):
            played = part.melt(value_vars=names, var_name="trial", value_name="success")
            means = unit_means(played.assign(trial=played["trial"].map(names.index) + 1), "trial", "success")
            draw_means(axes, k, column(means, "trial"), means, label)
    axes.set(xticks=range(1, len(names) + 1), xlabel="trial on the level", ylabel="success on unseen rule sets")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Drawn(figure, table)


def visual(evidence: Evidence) -> Drawn:
    """The loss in return with other textures, beside that on harder levels."""
    part = drawable(evidence.results.other_looks, "visual")
    table = pick(part, [*CELL, "trained", "shift", "difference", "gap", SUCCESS])
    return Drawn(dots(shifts_in_words(table, "shift"), "shift", "difference", COST, "trained"), table)


def hardness(evidence: Evidence) -> Drawn:
    """Success against the number of conditions on the reward: agents with intervals over runs, chance, script and planner."""
    study = evidence.results.study("hardness_of_levels", "hardness")
    runs = evidence.all_results.of("hardness")
    if study.empty and runs.empty:
        raise NoFigure("it was not run (`experiments=[hardness, hardness_of_levels]`)")
    parts = []
    for player in ("random", "scripted", "oracle") if len(study) else ():
        names = {"conditions": "conditions", **{f"{player}_{name}": name for name in ("success", "low", "high")}}
        parts.append(pick(study, names).set_axis(list(names.values()), axis=1).assign(player=player))
    if len(runs):
        number = runs["task"].str.extract(r"(?:conditions=|conditions_)(\d+)")[0]
        agents = runs.assign(conditions=number.fillna("0").astype(float), success=runs[SUCCESS])
        means = unit_means(agents, "conditions", "success")
        parts.append(means.rename(columns={"estimate": "success"}).assign(player="agents"))
    table = pd.concat(parts, ignore_index=True)
    figure = new_figure(5.6, 3.8)
    axes = figure.subplots()
    for k, player in enumerate(dict.fromkeys(table["player"])):
        part = select(table, player=player)
        means = part.rename(columns={"success": "estimate"})
        draw_means(axes, k, column(part, "conditions") + 0.05 * (k - 1), means, word_for(player))
    axes.set_xticks(sorted(set(table["conditions"])))
    axes.set(ylim=(-0.05, 1.08), xlabel="conditions on the goal", ylabel="success on test levels")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Drawn(figure, table)


def upper_bound(evidence: Evidence) -> Drawn:
    """Agents that see the true factors beside those that see pixels."""
    seen = drawable(evidence.all_results.of("upper_bound"), "upper_bound")
    main = drawable(evidence.all_results.main, "upper_bound")
    both = pd.concat([main.assign(sees="pixels"), seen.assign(sees="factors")], ignore_index=True)
    table = pick(both, [*CELL, "sees", SUCCESS, "gap"])
    table = keep(table, table.groupby(CELL, dropna=False)["sees"].transform("nunique") == 2)
    drawable(table, "no agents that see pixels have the levels and seeds of those that see factors")
    named, lines = table.assign(success=table[SUCCESS]), {"factors": "-", "pixels": ":"}
    return Drawn(success_by_number(named, "sees", lines, "success on test levels"), table)


def w2_study(evidence: Evidence) -> Drawn:
    """W2 against the number of levels, without training, with the means of 2022."""
    table = evidence.results.study("w2_study", "means")
    if table.empty:
        raise NoFigure("the study of distances was not run (`experiments=[w2_study]`)")
    inside = keep(table, table["train"] == table["test"])
    modes = [m for m in ("reference", "exact") if m in set(inside["mode"])]
    figure = new_figure(4.6 * len(modes), 4.3)
    axes = figure.subplots(1, len(modes), squeeze=False)[0]
    for one, mode in zip(axes, modes, strict=True):
        part = select(inside, mode=mode)
        for panel in sorted(set(part["train"])):
            family, _, difficulty = panel.partition("-")
            mine = select(part, train=panel).sort_values("n")
            look = {"color": style.colours([family])[family], "marker": style.markers([difficulty])[difficulty]}
            look |= {"markersize": 4.5, "linewidth": 1.1, "elinewidth": 0.8}
            one.errorbar(column(mine, "n"), column(mine, "mean"), yerr=column(mine, "sd"), **look)
            if mode == "reference":
                one.plot(column(mine, "n"), column(mine, "mean_2022"), "x", color="#000000", markersize=4, zorder=5)
        log_axis(one, sorted(set(part["n"])))
        one.set(title=DISTANCES[mode], xlabel="training levels", ylabel=f"W2 to {TEST_LEVELS} test levels")
    places = pd.DataFrame([panel.split("-") for panel in dict.fromkeys(inside["train"])], columns=list(PANEL))
    figure.legend(handles=legend_of(places), loc="outside lower center", ncols=6, handletextpad=0.2)
    return Drawn(figure, table)


def matched_sets(evidence: Evidence) -> Drawn:
    """The designed study: gap in success of the four kinds of training sets."""
    runs = drawable(evidence.results.of("matched_sets"), "matched_sets", "design")
    table = pick(runs, [*CELL, "design", "w2_exact", "radius", "effective_number", "gap_success", "gap"])
    order = [name for name in DESIGN_ORDER if name in set(table["design"])]
    families, counts = style.ordered(table["family"]), sorted(set(table["n"]))
    figure = new_figure(3.0 * len(families) + 0.4, 2.0 * len(counts) + 0.6)
    grid = figure.subplots(len(counts), len(families), sharex=True, sharey=True, squeeze=False)
    for axes, (n, family) in zip(grid.ravel(), product(counts, families), strict=True):
        zero_line(axes)
        for at, design in enumerate(order):
            part = select(table, family=family, n=n, design=design)
            y = column(part, "gap_success")
            axes.scatter(at + np.linspace(-0.18, 0.18, len(y)), y, s=18, color=style.PALETTE[at], alpha=0.6, **DOT)
            found = pd.DataFrame([mean_of_replicates(y, sides=2).row()])
            bars = error_bars(found, "estimate")
            axes.errorbar(at, column(found, "estimate"), yerr=bars, fmt="_", color="#000000", capsize=4, markersize=18)
        axes.set_xticks(range(len(order)), [word_for(name) for name in order], rotation=35, ha="right", fontsize=9)
        axes.set_title(f"{word_for(family)}, n = {n}")
    figure.supylabel("gap in success (test − training)", fontsize=10.5)
    return Drawn(figure, table)


def twins(evidence: Evidence) -> Drawn:
    """What training levels with one group of factors of the test cure, against what causal twins foretell and W2 says."""
    runs = drawable(rows_of("cures", evidence), "it was not run (`experiments=[twins, twins_cure]`)", "suite")
    names = ["suite", "group", "share", "gain", "foretold", "w2_share"]
    table = pick(runs, names).dropna().drop_duplicates(ignore_index=True)
    figure = new_figure(8.4, 3.6)
    grid = figure.subplots(1, 2, sharey=True)
    for axes, (x, words) in zip(grid, CURES, strict=True):
        for k, group in enumerate(sorted(set(table["group"]))):
            for share, face in ((100, "none"), (CURED_SHARE, style.PALETTE[k])):
                mine = select(table, group=group, share=share)
                look = {"facecolor": face, "edgecolor": style.PALETTE[k], "marker": style.MARKERS[k]}
                axes.scatter(column(mine, x), column(mine, "gain"), s=34, label=f"{word_for(group)}, {share} %", **look)
        axes.set_xlabel(words)
        zero_line(axes)
    grid[0].set_ylabel("success gained on test levels")
    grid[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Drawn(figure, table)


def dose_response(evidence: Evidence) -> Drawn:
    """The regret of agents that see states against the doses of W2 and of the covering radius of their training sets."""
    why = "it was not run, or the planner was not measured (`experiments=[dose_response, anchors]`)"
    runs = drawable(rows_of("doses", evidence), why, "design")
    table = pick(runs, [*CELL, "design", "w2_dose", "radius_dose", "w2_exact", "radius", "relative_regret"])
    figure = new_figure(8.4, 3.6)
    grid = figure.subplots(1, 2, sharey=True)
    for axes, (dose, other, words) in zip(grid, DOSES, strict=True):
        part = keep(table, table[other] == 0)
        for k, family in enumerate(style.ordered(part["family"])):
            mine = select(part, family=family)
            means = unit_means(mine, dose, "relative_regret", -np.inf, np.inf)
            draw_means(axes, k, column(means, dose) + 0.06 * (k - 1), means, f"{word_for(family)}, {len(mine)} runs")
        axes.set(xticks=sorted(set(part[dose])), xlabel=f"{words}\n[standard deviations of independent sets]")
        axes.legend(loc="lower left")
    grid[0].set_yscale("symlog", linthresh=2)
    grid[0].set(yticks=(0, 1, 2, 4, 8), yticklabels="01248", ylabel="regret on test levels\n(1: independent sets)")
    return Drawn(figure, table)
