"""The report's text: which claims, tables and figures stand where, and the sentences between them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from segar.analysis.plotting.names import WORDS
from segar.analysis.report.captions import GLOSSARY, SETTINGS, TABLES, TEXTS
from segar.analysis.report.claims import verdicts
from segar.analysis.report.claims.claim import METRIC_2022, METRIC_OURS, OF_PAPER, Claim, Finding
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.document import tables
from segar.analysis.report.document.blocks import (
    SHORT,
    Block,
    Bullets,
    Document,
    Heading,
    Paragraph,
    Picture,
    Table,
    Tiles,
)
from segar.analysis.report.document.files import as_block
from segar.analysis.report.document.missing import preliminary, what_is_missing
from segar.analysis.report.number_format import estimate_text, listed, p_value, plain
from segar.analysis.report.results import optional
from segar.analysis.report.rules import MARGINS, RULES, SHA256, WRITTEN
from segar.analysis.tables import column, count_of, select

OF_W2 = ("matched-w2", "states-w2")  # the studies that take W2 and the number of levels apart


def document(evidence: Evidence, claims: Sequence[Claim], figures: Mapping[str, Picture | str]) -> Document:
    """The whole report; ``figures`` has by name each figure, or why there is none."""
    by_name = {claim.name: claim for claim in claims}

    def drawn(name: str) -> list[Block]:
        return [as_block(figures[name])]

    def boxes(*names: str) -> list[Block]:
        return [by_name[name] for name in names]

    def section(title: str, level: int, figure: str, *names: str) -> list[Block]:
        return [Heading(title, level), *drawn(figure), *boxes(*names)]

    there = len(evidence.all_results.main) > 0
    blocks: list[Block] = [
        *preliminary(evidence.all_results),
        Paragraph(why(evidence, by_name), "lead"),
        *drawn("figure_3a"),
        Tiles(claims),
        Heading("What the paper says"),
        claims_table([claim for claim in claims if claim.of == OF_PAPER]),
        Heading("Questions that we add"),
        claims_table([claim for claim in claims if claim.of != OF_PAPER], folded=True),
        *what_is_missing(evidence),
        *section("W2, coverage or diversity?", 2, "matched_sets"),
        *boxes("matched-w2", "matched-coverage", "states-w2", "states-coverage"),
        *section("What causal twins foretell", 2, "twins", "twins"),
        *section("Doses of distance and of coverage", 2, "dose_response", "dose-w2", "dose-coverage"),
        *section("Out of distribution", 2, "figure_4a", "4a-larger", "4a-shift", "4a-trend", "4a-all"),
        *([Heading("How many levels close the gap"), *drawn("train_and_test")] if there else []),
    ]
    appendix: list[Block] = [
        Heading("Words"),
        Bullets(GLOSSARY),
        *(who_counts(evidence) if there else ()),
        Heading("The main grid: gap against W2"),
        *boxes("3a", "3a-panel", "3a-n", "3a-cell", "3a-agent"),
        *section("What survives other choices", 3, "specification_curves"),
        *tables.matched(evidence),
        *section("Ten levels, picked in several ways", 3, "fixed_n", "fixed-n"),
        *section("Each panel by itself", 2, "figure_3b", "3b-trend", "3b-easy", "3b-empty", "3b-weak"),
        *section("What representations know", 2, "figure_4b", "4b-train", "4b-none"),
        *section("Self-supervised losses", 3, "figure_5a", "5a-gap", "5a-similar", "5a-trends"),
        *section("Mass and frame stack", 3, "appendix_mass"),
        *boxes("A-mass", "A-flip"),
        *section("Learning", 2, "figure_5b", "5b-diversity", "5b-easy"),
        *section("SAC", 3, "appendix_sac", "A-sac-easy", "A-sac-hard"),
        *section("Scores of algorithms", 3, "performance_profiles"),
        *tables.compared(evidence),
        Heading("KS and W2", 3),
        *boxes("A-ks"),
        Heading("Beyond the paper"),
        *section("Diversity of the training set", 3, "diversity"),
        *section("Other physics", 3, "rules"),
        *tables.shifts(evidence, evidence.results.other_physics, "test_variation"),
        *section("Unseen rule sets", 3, "rule_sets", "rule-sets", "rule-sets-unseen", "rule-set-distance"),
        *section("A memory over trials", 3, "trials", "memory"),
        *section("Other textures", 3, "visual"),
        *tables.shifts(evidence, evidence.results.other_looks, "shift"),
        *section("Hardness by reward", 3, "hardness"),
        *section("Agents that see the factors", 3, "upper_bound"),
        *tables.true_factors(evidence),
        *section("W2 without training", 3, "w2_study"),
        *section("Which factors make the gap", 3, "attribution"),
        *tables.attributed(evidence),
        Heading("Claims without a test"),
        *boxes(*(claim.name for claim in claims if claim.untested)),
        *([*estimates(evidence), *whose_settings(evidence)] if there else ()),
        *how_verdicts_are_decided(evidence),
        *written_before(),
        *how_often_rules_err(evidence.all_results.folder),
        *what_was_run(evidence),
    ]
    title = "Does the distance between training and test levels predict the generalization gap?"
    scale = evidence.all_results.scale
    subtitle = f"The Sandbox Environment for Generalizable Agent Research (SEGAR): its experiments at scale `{scale}`"
    return Document(title, subtitle, blocks, answer=in_a_word(by_name).capitalize() + ".", appendix=appendix)


def in_a_word(claims: Mapping[str, Claim]) -> str:
    """The answer to the title's question, by the rule in ``rules.yaml``: yes, partly, no, or not known yet."""
    headline = claims["3a"].verdict(METRIC_OURS)
    itself = of_itself([claims[name].verdict(METRIC_OURS) for name in OF_W2])
    if both := [headline, itself].count(verdicts.SUPPORTED):
        return "yes" if both == 2 else "partly"
    return "no" if {headline, itself} == {verdicts.NOT_SUPPORTED} else "not known yet"


def of_itself(read: Sequence[str]) -> str:
    """What the matched sets say of W2 itself: supported where one study supports it and none says the opposite."""
    if verdicts.NOT_SUPPORTED in read:
        return verdicts.NOT_SUPPORTED
    return verdicts.SUPPORTED if verdicts.SUPPORTED in read else verdicts.UNDECIDED


def why(evidence: Evidence, claims: Mapping[str, Claim]) -> str:
    """The answer in some sentences: the headline, W2 at equal numbers of levels, and how many levels close the gap."""
    said = {}
    for name in ("3a", *OF_W2):
        claim, found = claims[name], leading(claims[name], METRIC_OURS)
        runs = f"; {claim.planned}" if claim.planned.is_short else ""
        beside = f"; in its place {found.beside}" if found and found.beside else ""
        said[name] = claim.verdict(METRIC_OURS) + (f" ({number(found)}{beside}{runs})" if found else "")
    headline, pixels, states = said.values()
    text = TEXTS["why"].format(headline=headline, pixels=pixels, states=states, levels=levels_close(evidence))
    return text.strip()


def levels_close(evidence: Evidence) -> str:
    """The gap in success with the fewest training levels and with the most."""
    main = evidence.results.main
    counts = sorted({*main["n"]})
    if len(counts) < 2:
        return ""
    few, many = (evidence.mean(select(main, n=n), "gap_success") for n in (counts[0], counts[-1]))
    levels = "one training level" if counts[0] == 1 else f"{counts[0]} training levels"
    shown = {"few": estimate_text(few, ""), "many": estimate_text(many, "")}
    return TEXTS["levels_close"].format(fewest=levels, most=counts[-1], **shown)


def leading(claim: Claim, settings: str) -> Finding | None:
    """The first test of a claim that has a number, with the runs that its verdict is about; None where there is none."""
    return next((one for one in claim.tests(settings) if np.isfinite(one.found.estimate)), None)


def number(one: Finding) -> str:
    """An estimate with its interval and what it rests on."""
    return estimate_text(one.found, SHORT.get(one.measure, one.measure))


def claims_table(claims: Sequence[Claim], folded: bool = False) -> Table:
    """One row per claim, in the order of the paper: the verdict, its numbers, its runs, and what is missing."""
    rows = []
    for claim in claims:
        settings = METRIC_OURS if claim.has(METRIC_OURS) else METRIC_2022
        some = claim.tests(settings)
        known = [one for one in some if np.isfinite(one.found.low)]
        numbers = number(known[0]) if len(some) == len(known) == 1 else verdicts.counted(one.verdict for one in some)
        if p := claim.taken_by(settings):
            numbers += f"; over its family, p = {p_value(p)}"
        planned = claim.planned
        runs = f"{planned.present} of {planned.planned}" if planned.planned else ""
        rows.append([claim.name, claim.verdict(settings), claim.statement, numbers, runs, claim.needs])
    tested = "in numbers, or tests by themselves"
    head = ("", "verdict", "statement, in our words", tested, "planned runs", "it would take")
    return Table(head, rows, 6, TABLES["verdicts"], folded)


def who_counts(evidence: Evidence) -> list[Block]:
    """The gate, and how many runs of each panel are above it."""
    text = [Heading("Which runs count"), Paragraph(sentence(RULES["gate"]["leading"]))]
    if evidence.all_results.players.empty:
        text.append(Paragraph(TEXTS["not_measured"], "warning"))
    return [*text, tables.gate_table(evidence)]


def estimates(evidence: Evidence) -> list[Block]:
    """All correlations of the main grid, and what they rest on."""
    return [
        Heading("All correlations of the main grid"),
        tables.main_table(evidence),
        Paragraph(confound(evidence)),
        tables.mixed_table(evidence),
    ]


def confound(evidence: Evidence) -> str:
    """A sentence on what the table of R² means."""
    part = select(evidence.explained, of="both")
    if part.empty:
        return "No run learned its training levels."
    both = dict(zip(part["w2"], column(part, "r2"), strict=True))
    mode = "exact" if "exact" in both else evidence.modes[0]
    return TEXTS["confound"].format(share=f"{100 * both[mode]:.0f} %", distance=tables.DISTANCES[mode])


def whose_settings(evidence: Evidence) -> list[Block]:
    """The paper's setting beside ours."""
    main = evidence.all_results.main
    rows = [[one["setting"], one["paper"], stated(main, one["column"], one.get("words", WORDS))] for one in SETTINGS]
    head = ("setting", "paper and code of 2022", "this main grid")
    return [Heading("What is whose"), Table(head, rows, 3, TABLES["settings"]), Paragraph(TEXTS["settings"])]


def stated(main: pd.DataFrame, setting: str, words: Mapping[str, str]) -> str:
    """The values of a setting in a table, some of them in words; tables that do not have the setting say nothing of it."""
    if setting not in main or np.any(main[setting].isna()):
        return f"unknown: these tables do not state {setting}"
    return ", ".join(words.get(str(value), str(value)) for value in sorted(set(main[setting])))


def what_was_run(evidence: Evidence) -> list[Block]:
    """Runs per experiment, with frames, seeds and hours; versions."""
    runs = evidence.all_results.runs
    named = runs.assign(experiment=runs["experiments"].str.split()).explode("experiment")
    rows = []
    for name, part in named.groupby("experiment", sort=True, dropna=False):
        rows.append([
            f"`{name}`", listed(part["algorithm"]), listed(part["observation"]).replace("(", " ("), str(len(part)),
            tables.frames_of(part), listed(part["n"]), listed(part["seed"]), hours_of(part),
        ])  # fmt: skip
    head = ("experiment", "algorithm", "observation", "runs", "frames", "training levels", "seeds", "hours")
    shown = Table(head, rows, 3, "Experiments share runs, so their hours overlap.")
    text = f"All {len(runs)} runs together took {hours_of(runs)} hours of training and evaluation. "
    text += TEXTS["test_levels"].format(levels=listed(runs["test_levels"]))
    return [Heading("What was run"), shown, Paragraph(text), *versions(named)]


def hours_of(runs: pd.DataFrame) -> str:
    """How many hours runs took together."""
    return plain(float(column(runs, "hours").sum()), 1)


def versions(named: pd.DataFrame) -> list[Block]:
    """Libraries, commits and fingerprints of the code, of runs with a row for each ``experiment`` that they belong to."""
    unknown = {"libraries": "", "commit": "", "computed_with": "", "code": "unknown"}  # of imported runs
    named = named.assign(**{name: "" for name in unknown if name not in named}).fillna(unknown)
    rows = []
    for code, part in named.groupby("code", sort=True, dropna=False):
        shortened = {commit[:9] + "+" * commit.endswith("+") for commit in part["commit"] if commit}
        commits = ", ".join(f"`{commit}`" for commit in sorted(shortened))
        rows.append([f"`{code}`", commits, listed(part["experiment"]), str(count_of(part, "run"))])
    many = "several versions" if len(rows) > 1 else "one version"
    head = ("fingerprint", "commits", "experiments", "runs")
    blocks: list[Block] = []
    for words, name in {"Libraries": "libraries", "Computed with": "computed_with"}.items():
        if known := sorted(set(named[name]) - {""}):
            blocks.append(Paragraph(f"{words}: {'. Others: '.join(known)}."))
    return [*blocks, Table(head, rows, 3, TEXTS["versions"].format(many=many))]


def how_verdicts_are_decided(
    evidence: Evidence, kinds: Iterable[str] = RULES["verdicts"], margins: Iterable[str] = MARGINS
) -> tuple[Heading, Bullets]:
    """The rules, as their file states them: of these kinds of verdicts, with these margins."""
    judged, known = RULES["verdicts"], RULES["evidence"]
    items = [f"**{name.capitalize()}**: {sentence(judged[name])}" for name in kinds]
    items += [f"**{name.capitalize()}**: {sentence(known[name])}" for name in ("block", "interval", "power")]
    blocks = " or ".join(dict.fromkeys(evidence.blocks.values()))
    items.append(f"**Least**: {evidence.least_blocks} {blocks}. With fewer, a claim cannot be tested.")
    items.append("**Margins**: " + ", ".join(f"{name} {MARGINS[name]:g}" for name in margins) + ".")
    if "deviations" in margins:
        items.append(TEXTS["deviations"])
    return Heading("How verdicts are decided"), Bullets(items)


def written_before() -> list[Block]:
    """When the rules were written, the hash of their file, and the one test of each claim that they name."""
    text = TEXTS["written"].format(day=WRITTEN, digest=SHA256[:16], seen=sentence(RULES["seen"]))
    rules = {
        "When runs end": [f"**{name}**: {sentence(words)}" for name, words in RULES["stopping"].items()],
        "The primary tests": [f"**{name}**: {sentence(words)}" for name, words in RULES["primary"].items()],
        "The choices of specifications": [
            f"**{name.capitalize()}**: {'; '.join(names)}." for name, names in RULES["specifications"].items()
        ],
        "The designed study": [
            f"**{name.capitalize()}**: {sentence(words)}" for name, words in RULES["matched"].items()
        ],
    }
    return [Paragraph(text), *(block for title, some in rules.items() for block in (Heading(title, 3), Bullets(some)))]


def how_often_rules_err(folder: Path) -> list[Block]:
    """How often the rules say "supported" where it is known what is true; nothing where that was not simulated."""
    table = optional(folder / "error_rates.csv")
    if table.empty:
        return []
    rows = [
        [f"{claim}", f"{claimed}", f"{runs}", *(f"{share:.3f}" for share in column(part, verdicts.SUPPORTED))]
        for (claim, claimed, runs), part in table.groupby(["claim", "claimed", "runs"], sort=False, dropna=False)  # type: ignore[misc]
    ]
    kinds = [f"{planted}, {noise} noise" for planted, noise in table[["planted", "noise"]].drop_duplicates().to_numpy()]
    return [Heading("How often the rules err"), Table(("", "claims", "rows", *kinds), rows, 2, TABLES["error_rates"])]


def sentence(text: object) -> str:
    """A text of the rules in one line."""
    return " ".join(str(text).split())
