"""The runs that claims are about, by the names that ``statements.yaml`` gives them, with the columns that their tests name."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
import pandas as pd
from scipy import stats

from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.statements import METRICS
from segar.analysis.report.results import ETA, LESS_REGRET, MEMORY, SUCCESS, Results, less_partner
from segar.analysis.report.rules import WHOLE
from segar.analysis.studies.w2 import TEST_LEVELS
from segar.analysis.tables import column, count_of, keep, mean_by, pick, select
from segar.experiments.settings import MATCHED_DESIGNS
from segar.levels import REST, SEPARATOR

CONTROL = "nuisance_only"  # a design that is one level many times
PAPER_AGENT = "paper_agent"
# The accuracy of the critic as in 2022, and with its marginal, its alignment and its held-out pairs put right.
PROBES, GAPS = ({settings: of[name] for settings, of in METRICS.items()} for name in ("probe", "gap"))
LEVELS = ("train", "test")
COORDINATES = r"(golfball|goal)\.Position\."  # of factors that were probed
ACCURACIES = ("accuracy_train", "accuracy_test")
PPO, AS_MANY_STEPS, SAC = "PPO", "as many steps", "SAC"
CURED_SHARE = 30  # [%] of training levels, at which the rules ask what they cure
OF_SET = ("family", "difficulty", "n", "seed", "design")
SUCCESS_IN_TRIAL = "success_trial_{}_test_deterministic"


def several_seeds(evidence: Evidence) -> pd.DataFrame:
    """The main grid if it has two seeds or more, else no rows."""
    return evidence.results.main if count_of(evidence.results.main, "seed") > 1 else evidence.results.main.head(0)


def one_number_of_levels(evidence: Evidence) -> pd.DataFrame:
    """The runs of one number of training levels, if they have several designs; ``clustered`` ones were picked near together.
    One level many times is a control, which is left out."""
    table = evidence.results.of("fixed_n")
    table = keep(table, table["design"] != CONTROL)
    table = table.assign(clustered=table["design"] == "clustered")
    return table if count_of(table, "design") > 1 else table.head(0)


def papers_agent(evidence: Evidence) -> pd.DataFrame:
    """The runs of the paper's own agent, if all that were planned are there."""
    runs = evidence.results.of(PAPER_AGENT)
    return runs if len(evidence.all_results.of(PAPER_AGENT)) >= WHOLE[PAPER_AGENT] else runs.head(0)


def harder_levels(evidence: Evidence) -> pd.DataFrame:
    """The agents of the main grid on harder levels: ``gap_less_own`` and ``gap_2022_less_own`` beside the gap on their own
    test levels, ``return_less_trained_there`` beside the return of agents trained on the harder levels with this n and seed."""
    harder, main = evidence.results.harder, evidence.results.main
    own = {f"{gap}_less_own": less_partner(harder, main, gap, ["run"]) for gap in GAPS.values()}
    at, there = ["test_family", "test_difficulty", "n", "seed"], ["family", "difficulty", "n", "seed"]
    return harder.assign(**own, return_less_trained_there=less_partner(harder, main, ETA, at, there))


def probes(evidence: Evidence) -> pd.DataFrame:
    """The accuracies of the main grid."""
    return accuracies(evidence.results, evidence.results.main)


def self_supervised(evidence: Evidence) -> pd.DataFrame:
    """The agents with self-supervised losses and those beside them: ``auxiliary`` is the algorithm that has such a loss, and
    ``compared`` also names PPO alone, and PPO with as many gradient steps."""
    runs = evidence.results.of("figure_5a")
    names = list(map(str, runs["algorithm"]))
    kinds = [PPO if is_plain_ppo(one) else AS_MANY_STEPS if one.endswith("_epochs") else one for one in names]
    return runs.assign(auxiliary=[name if name in auxiliary(runs) else "" for name in names], compared=kinds)


def masses_without_a_memory(evidence: Evidence) -> pd.DataFrame:
    """The runs of the appendix's mass and frame stack whose agents have no memory."""
    masses = evidence.results.masses
    return keep(masses, masses["past"] != MEMORY)


def single_factors(evidence: Evidence) -> pd.DataFrame:
    """The main grid with ``coordinates``, the mean share of the variance of the ball's and the goal's coordinates that ridge
    regression explains from the representation on test levels; a share is 0 where it is negative."""
    probes = evidence.results.probes
    if probes.empty:
        return probes
    asked = select(probes, representation="trained", probe="ridge", quantity="r2", levels="test")
    asked = keep(asked, asked["factor"].str.match(COORDINATES))
    known = mean_by(asked.assign(coordinates=column(asked, "estimate").clip(0)), ["run"], ["coordinates"])
    return evidence.results.main.merge(known, on="run")


def replicated_probes(evidence: Evidence) -> pd.DataFrame:
    """The accuracies of the main grid with ``replicate_part``: the variance of one estimate between the critics of an agent, in
    parts of the variance of one estimate among agents of one cell, which is averaged over a family."""
    found, table = probes(evidence), evidence.results.probes
    if found.empty:
        return found
    asked = select(table, representation="trained", quantity="accuracy", factor="all", levels="test")
    number = column(asked, "units")
    of_mean = ((column(asked, "high") - column(asked, "low")) / 2 / stats.t.ppf(0.975, number - 1)) ** 2
    asked = pick(asked, ["run", "probe"]).assign(within=number * of_mean, of_mean=of_mean)
    found = found.merge(asked, on=["run", "probe"])
    of_means = found.groupby(["probe", "cell"], dropna=False)["accuracy_test"].transform("var")
    found = found.assign(of_one=of_means - found["of_mean"] + found["within"])
    of_family = found.groupby(["probe", "family"], dropna=False)["of_one"].transform("mean")
    return found.assign(replicate_part=found["within"] / of_family)


def matched_states(evidence: Evidence, experiment: str = "matched_sets_states") -> pd.DataFrame:
    """The matched sets of agents that see states, with ``relative_regret``: the regret on test levels in parts of its mean
    after sets like independent ones of the same family and number of levels; none where the planner was not measured."""
    runs = evidence.results.with_less_regret(evidence.results.of(experiment))
    if runs.empty or LESS_REGRET not in runs:
        return runs.head(0)
    like, cell = select(runs, design="matched"), ["family", "n"]
    runs = runs.merge(mean_by(like.assign(usual=like[LESS_REGRET]), cell, ["usual"]), on=cell)
    return runs.assign(relative_regret=runs[LESS_REGRET] / runs["usual"])


def measured_sets(evidence: Evidence) -> pd.DataFrame:
    """The runs of :func:`matched_states` with the measures of their training sets; none where the planner's were not taken."""
    runs = evidence.results.with_training_sets(matched_states(evidence))
    return keep(runs, runs["w1_policy"].notna()) if "w1_policy" in runs else runs.head(0)


def doses(evidence: Evidence) -> pd.DataFrame:
    """Matched sets as in :func:`matched_states`, with their doses, in standard deviations of independent ones."""
    runs = matched_states(evidence, "dose_response")
    runs = keep(runs, runs["design"].isin(list(MATCHED_DESIGNS)))
    wanted = [MATCHED_DESIGNS[name] for name in runs["design"]]
    return runs.assign(**{f"{name}_dose": [one[name] for one in wanted] for name in ("w2", "radius")})


def cures(evidence: Evidence) -> pd.DataFrame:
    """The runs of worlds that differ in three groups of factors between training and test (``suite``), with the ``group``
    that ``share`` [%] of their training levels have as the test has it; none where no level has.

    ``gain`` is their success on test levels less that of the agent of their seed without, a mean over seeds, and ``cure`` the
    same at 30 % alone; ``foretold`` is what agents without gain on test levels in which this group is that of training
    levels; and ``w2_share`` is the part of squared W2 between training and test that goes with it.
    """
    results, suite = evidence.results, ["family", "levels.test_variation"]
    without, cured, between = results.of("twins"), results.of("twins_cure"), results.between
    if without.empty or cured.empty or between.empty:
        return without.head(0)
    asked = pick(between, ["test_groups", "test_changed"]).astype(str)
    left = [{*groups.split(SEPARATOR), REST} - {*changed.split(SEPARATOR)} for groups, changed in asked.to_numpy()]
    twins = between.assign(group=[SEPARATOR.join(sorted(one)) for one in left], groups=list(map(len, left)))
    own = pick(without, ["run", suite[1], "w2_exact"])
    twins = select(twins, groups=1).merge(own, on="run", suffixes=("", "_own"))
    w2_share = 1 - (twins["w2_exact"] / twins["w2_exact_own"]) ** 2
    twins = twins.assign(foretold=less_partner(twins, without, SUCCESS, ["run"]), w2_share=w2_share)
    known = mean_by(twins, [*suite, "group"], ["foretold", "w2_share"])
    parts = cured["design"].astype(str).str.extract(r"^(?P<group>\w+)_of_test_(?P<share>\d+)$")
    cured = cured.assign(group=parts["group"], share=parts["share"].astype(float))
    cured = cured.assign(gain=less_partner(cured, without, SUCCESS, [*suite, "seed"]))
    gain = cured.groupby([*suite, "group", "share"], dropna=False)["gain"].transform("mean")
    cured = cured.assign(gain=gain, cure=gain.where(cured["share"] == CURED_SHARE))
    found = pd.concat([without, cured.merge(known, on=[*suite, "group"], how="left")], ignore_index=True)
    return found.assign(suite=found["family"] + " " + found[suite[1]].astype(str))


def soft_actor_critic(evidence: Evidence) -> pd.DataFrame:
    """The runs of the appendix on SAC: ``agent`` tells SAC, which DrQ is from pixels, from PPO; ``return_less_ppo`` and
    ``success_less_ppo`` are beside PPO after as many frames."""
    runs = evidence.results.of("appendix_sac")
    runs = runs.assign(agent=[SAC if name.startswith(("sac", "drq")) else PPO for name in map(str, runs["algorithm"])])
    ppo, at = select(runs, agent=PPO), ["family", "difficulty", "n", "seed", "frames"]
    names = {"return_less_ppo": ETA, "success_less_ppo": SUCCESS}
    return runs.assign(**{name: less_partner(runs, ppo, value, at) for name, value in names.items()})


def distances_of_empty(evidence: Evidence) -> pd.DataFrame:
    """The KS statistics in distribution of the family Empty, from the study of distances: ``log_ks``, and ``log_effective_n``
    of two samples, n training levels and the study's test levels.

    Joint distribution functions of more entities differ by 1 for most n, where no rate can be seen.
    """
    table = evidence.results.study("w2_study", "distances")
    if table.empty:
        return table
    inside = (table["train"] == table["test"]) & (table["ks"] > 0) & table["train"].str.startswith("empty-")
    table = keep(table, inside)
    n = column(table, "n")
    return table.assign(log_ks=np.log(column(table, "ks")), log_effective_n=np.log(n * TEST_LEVELS / (n + TEST_LEVELS)))


def dealt_factors(evidence: Evidence) -> pd.DataFrame:
    """The distances of the study of distances with ``of_marginals``, the part by which exact W2 is larger after all factors
    were dealt anew. Seed 0 had been looked at before there was a rule."""
    table = evidence.results.study("w2_study", "distances")
    if "w2_marginals" not in table:
        return table.head(0)
    table = keep(table, table["seed"] != 0)
    panels = table["train"].str.split("-", expand=True)
    larger = column(table, "w2_marginals") / column(table, "w2_exact") - 1
    return table.assign(of_marginals=larger, family=panels[0], difficulty=panels[1])


def platforms(evidence: Evidence) -> pd.DataFrame:
    """The turns of random play on other platforms, which are blocks; ``faster`` is log10 of SEGAR's speed over theirs."""
    table = evidence.results.study("platforms", "platforms")
    if table.empty:
        return table
    faster = np.log10(column(table, "segar") / column(table, "speed"))
    return table.assign(faster=faster, family=table["platform"], difficulty="", seed=0)


def conditional_rewards(evidence: Evidence) -> pd.DataFrame:
    """The runs with ``conditions``, the number of conditions on the reward."""
    runs = evidence.results.of("hardness")
    number = runs["task"].astype(str).str.extract(r"conditions=(\d+)")[0].astype(float)
    return keep(runs.assign(conditions=number), number.notna())


def other_tasks(evidence: Evidence) -> pd.DataFrame:
    """The runs in other tasks with ``above_play``, the return on training levels less that of the better of idle and random
    play, level by level; NaN where these were not measured."""
    runs = evidence.results.of("other_tasks")
    floor = runs["panel"].map(evidence.results.player("floor", "return").get).astype(float)
    return runs.assign(above_play=runs["eta_train_deterministic"] - floor)


def all_rule_set_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs on a chosen number of rule sets: that number ``rule_sets``, its logarithm ``log_rule_sets``, ``chosen`` (near,
    far, or empty), and ``dynamics_w2``, their distance to those of the test, which is none where it was not measured."""
    runs = evidence.results.of("rule_sets")
    parts = runs["design"].astype(str).str.extract(r"^rule_sets_(?P<number>\d+)(?:_(?P<chosen>near|far))?$")
    runs, parts = (keep(one, parts["number"].notna()) for one in (runs, parts))
    number = parts["number"].astype(float)
    found = runs.assign(rule_sets=number, log_rule_sets=np.log(number), chosen=parts["chosen"].fillna(""))
    study = evidence.results.study("rule_set_distances", "rule_sets")
    if study.empty:
        return found.assign(dynamics_w2=np.nan)
    return found.merge(study[[*OF_SET, "dynamics_w2"]], on=list(OF_SET), how="left", validate="m:1")


def rule_set_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs whose rule sets are the first of a sample, see :func:`all_rule_set_runs`."""
    return select(all_rule_set_runs(evidence), chosen="")


def runs_on_ten(evidence: Evidence) -> pd.DataFrame:
    """The runs on ten rule sets, whether the first, near or far ones, whose distance to the test was measured."""
    runs = all_rule_set_runs(evidence)
    return keep(runs, (runs["rule_sets"] == 10) & runs["dynamics_w2"].notna())


def trial_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs over trials, with ``memory`` and ``last_trial``, their success in the last trial on unseen rule sets."""
    runs = evidence.results.of("trials")
    names = trial_columns(runs)
    recurrent = runs["algorithm"].astype(str).str.startswith("ppo_recurrent")
    return runs.assign(memory=recurrent, last_trial=runs[names[-1]]) if names else runs.iloc[:0]


def trial_columns(runs: pd.DataFrame) -> list[str]:
    """The columns of success in each trial on the test levels, in order."""
    return [name for n in range(len(runs.columns)) if (name := SUCCESS_IN_TRIAL.format(n)) in runs]


def accuracies(results: Results, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that were probed: their columns, ``probe`` ("paper" or "jsd"), its accuracy on ``train`` and ``test``, and
    ``accuracy_train_less_test``."""
    if results.probes.empty or runs.empty:
        return pd.DataFrame()
    table = results.probes
    rows = (table["representation"] == "trained") & (table["quantity"] == "accuracy") & (table["factor"] == "all")
    rows &= table["probe"].isin(list(PROBES.values()))
    wide = pd.pivot_table(keep(table, rows), "estimate", ["run", "probe"], "levels").reset_index()
    if not {*LEVELS} <= set(wide.columns):
        return pd.DataFrame()
    named = pick(wide, ["run", "probe", *LEVELS]).set_axis(["run", "probe", *ACCURACIES], axis=1)
    found = runs.merge(named, on="run").dropna(subset=list(ACCURACIES))
    return found.assign(accuracy_train_less_test=found["accuracy_train"] - found["accuracy_test"])


def auxiliary(table: pd.DataFrame) -> list[str]:
    """The algorithms of a table that have a self-supervised loss."""
    return sorted({str(name) for name in table["algorithm"] if str(name).startswith(("curl", "spr"))})


def is_plain_ppo(algorithm: str) -> bool:
    """Whether it is PPO without a self-supervised loss and without more gradient steps."""
    return algorithm.startswith("ppo") and not algorithm.endswith("_epochs")


# The rows that each evidence of statements.yaml stands for.
ROWS: Mapping[str, Callable[[Evidence], pd.DataFrame]] = {
    "main grid": lambda evidence: evidence.results.main,
    "several seeds": several_seeds,
    "one number of levels": one_number_of_levels,
    "matched sets": lambda evidence: evidence.results.of("matched_sets"),
    "matched sets from states": matched_states,
    "measured sets": measured_sets,
    "doses": doses,
    "cures": cures,
    "the paper's agent": papers_agent,
    "harder levels": harder_levels,
    "probes": probes,
    "self-supervised agents": self_supervised,
    "probes of self-supervised agents": lambda evidence: accuracies(evidence.results, self_supervised(evidence)),
    "probes of single factors": single_factors,
    "replicated probes": replicated_probes,
    "main grid from states": lambda evidence: evidence.results.of("upper_bound"),
    "other looks": lambda evidence: evidence.results.other_looks,
    "conditions on the reward": conditional_rewards,
    "masses": lambda evidence: evidence.results.masses,
    "masses without a memory": masses_without_a_memory,
    "probes with masses": lambda evidence: accuracies(evidence.results, masses_without_a_memory(evidence)),
    "SAC": soft_actor_critic,
    "other tasks": other_tasks,
    "distances without training": distances_of_empty,
    "other platforms": platforms,
    "dealt factors": dealt_factors,
    "numbers of rule sets": rule_set_runs,
    "ten rule sets": runs_on_ten,
    "trials": trial_runs,
}


@lru_cache(maxsize=2 * len(ROWS))
def rows_of(name: str, evidence: Evidence) -> pd.DataFrame:
    """The runs of a name in :data:`ROWS`, for which a report asks several times."""
    return ROWS[name](evidence)
