"""The report's text: which claims, tables and figures stand where, and the sentences between them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from analysis.report import beyond, claims_gap, claims_information, claims_learning, tabulated, verdicts
from analysis.report.claims import CORRECTED, PAPER, Claim
from analysis.report.document import Block, Bullets, Document, Heading, Paragraph, Picture, Table, Verdict
from analysis.report.evidence import PAPER_R, Evidence
from analysis.report.words import listed, plain, said
from analysis.stats.power import critical_r
from analysis.tables import column, count_of, mean_by, select

PAPER_FRAMES, PAPER_TEST_LEVELS = 1_000_000, 500
IN_SHORT = ("3a", "3a-n", "3a-cell", "fixed-n", "3b-trend", "4a-larger", "4b-none", "5a-gap", "A-mass")
LEARNED = 0.5  # success on training levels below which an agent did not learn its task
CLAIMS = (*claims_gap.CLAIMS, *claims_information.CLAIMS, *claims_learning.CLAIMS,
          *claims_information.CLAIMS_OF_APPENDIX, *claims_learning.CLAIMS_OF_APPENDIX)  # fmt: skip


@dataclass(frozen=True)
class Drawings:
    """The figures by name: a picture, or why there is none."""

    found: Mapping[str, Picture | str]

    def blocks(self, name: str) -> list[Block]:
        """The figure, or a sentence."""
        one = self.found[name]
        return [Paragraph(f"No figure: {one}.")] if isinstance(one, str) else [one]


def document(evidence: Evidence, claims: Sequence[Claim], drawings: Drawings) -> Document:
    """The whole report."""
    by_name = {claim.name: claim for claim in claims}

    def boxes(*names: str) -> list[Block]:
        return [Verdict(by_name[name]) for name in names]

    blocks: list[Block] = [
        *opening(evidence),
        *summary(claims),
        *what_was_run(evidence),
        *limits(evidence),
        *main_grid(evidence, drawings, boxes),
        Heading("Out of distribution"),
        *drawings.blocks("figure_4a"),
        *boxes("4a-larger", "4a-shift", "4a-trend", "4a-all"),
        Heading("What representations know"),
        *drawings.blocks("figure_4b"),
        *boxes("4b-train", "4b-none"),
        Heading("Self-supervised losses", 3),
        *drawings.blocks("figure_5a"),
        *boxes("5a-gap", "5a-similar", "5a-trends"),
        Heading("Mass and frame stack", 3),
        *drawings.blocks("appendix_mass"),
        *masses(evidence),
        *boxes("A-mass", "A-flip"),
        Heading("Learning"),
        *drawings.blocks("figure_5b"),
        *boxes("5b-diversity", "5b-easy"),
        Heading("SAC", 3),
        *drawings.blocks("appendix_sac"),
        *boxes("A-sac-easy", "A-sac-hard"),
        Heading("KS and W2", 3),
        *drawings.blocks("appendix_measures"),
        *boxes("A-ks"),
        *beyond.blocks(evidence, drawings.blocks),
        *how_verdicts_are_decided(),
    ]
    scale = evidence.results.scale
    subtitle = f"The Sandbox Environment for Generalizable Agent Research (SEGAR): its experiments at scale `{scale}`"
    return Document("What holds of the paper's claims", subtitle, blocks)


def opening(evidence: Evidence) -> list[Block]:
    """What this is about, and what is missing."""
    results = evidence.results
    main, runs = results.main, results.runs
    blocks: list[Block] = []
    if len(main):
        text = (
            f"{len(main)} runs of the main grid ({listed(main['algorithm'])} on {listed(main['observation'])}, "
            f"{frames_of(main)} frames, seed{'s' if count_of(main, 'seed') > 1 else ''} {listed(main['seed'])})"
        )
        others = len(runs) - len(main)
        more = f", {others} more runs" if others else ""
        tests = f", and {len(results.transfers)} tests of their agents elsewhere" if len(results.transfers) else ""
        text += f"{more}{tests}. "
    else:
        text = f"{len(runs)} runs, none of them of the main grid. "
    text += (
        "The gap is the mean return on test levels less that on training levels; negative means worse on test levels. "
        "Every claim is read twice: with the settings of the paper and its code of 2022, and with what is wrong in "
        "them corrected."
    )
    blocks.append(Paragraph(text, "lead"))
    missing = results.lacking()
    if missing:
        shown = ", ".join(map(str, missing[:8])) + (" and others" if len(missing) > 8 else "")
        text = f"**Of what was planned, {len(missing)} runs or tests are missing**, and the report does without them: {shown}."
        blocks.append(Paragraph(text, "warning"))
    return blocks


def frames_of(table: pd.DataFrame) -> str:
    """Numbers of frames, with commas."""
    return ", ".join(f"{n:,}" for n in sorted(set(table["frames"])))


def summary(claims: Sequence[Claim]) -> list[Block]:
    """What follows in short, and all claims with their verdicts in one table."""
    tested = [claim for claim in claims if claim.findings]
    counted = {s: Counter(claim.verdict(s) for claim in tested if claim.verdict(s)) for s in (PAPER, CORRECTED)}
    sentences = [f"{len(tested)} of {len(claims)} claims can be tested with these runs."]
    for settings, found in counted.items():
        parts = ", ".join(f"{found[name]} {name}" for name in verdicts.VERDICTS if found[name])
        sentences.append(f"{settings.capitalize()}: {parts or 'none'}.")
    short = [f"**{c.name}** {c.statement} {reading(c)} {c.follows}" for c in tested if c.name in IN_SHORT]
    rows = []
    for claim in claims:
        first = {s: next((one for one in claim.findings if one.settings == s), None) for s in (PAPER, CORRECTED)}
        several = sum(one.settings == CORRECTED for one in claim.findings) > 1
        number = first[CORRECTED] or first[PAPER]
        shown = "" if number is None or several else said(number.found, symbol(number.measure))
        corrected = claim.verdict(CORRECTED) if claim.findings else ""
        rows.append([claim.name, claim.verdict(PAPER), corrected, claim.statement, shown])
    head = ("claim", PAPER, CORRECTED, "the paper says, in our words", "corrected, in numbers")
    caption = (
        "Where a claim is about several panels or algorithms, its numbers are in its box below. Data: `claims.csv`."
    )
    return [Heading("Verdicts"), Paragraph(" ".join(sentences)), Bullets(short), Table(head, rows, 5, caption)]


def reading(claim: Claim) -> str:
    """The verdicts on a claim in a sentence."""
    parts = [f"{claim.verdict(s)} {'as in the paper' if s == PAPER else 'when corrected'}" for s in (PAPER, CORRECTED)
             if claim.verdict(s)]  # fmt: skip
    text = ", ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def symbol(measure: str) -> str:
    """What a measure is called before its value."""
    return "r" if measure.endswith("Pearson r") else "difference"


def masses(evidence: Evidence) -> list[Block]:
    """What agents reach with the mass shown and hidden."""
    table = evidence.results.masses
    if table.empty:
        return []
    named = table.assign(levels=table["n"])
    found = tabulated.means(evidence, named, ["past", "mass", "levels"], "success_test_deterministic", "masses")
    head = {"past": "the agent has", "mass": "mass", "levels": "training levels"}
    caption = "Mean success on test levels, with the 95 % interval of (panel, seed) blocks where there are several."
    return [tabulated.means_table(found, head, "success", caption, plain)]


def what_was_run(evidence: Evidence) -> list[Block]:
    """Runs per experiment, with frames, seeds and hours; versions."""
    runs = evidence.results.runs
    named = runs.assign(experiment=runs["experiments"].str.split()).explode("experiment")
    rows = []
    for name, part in named.groupby("experiment", sort=True):
        hours = plain(float(column(part, "hours").sum()), 1) if "hours" in part else ""
        rows.append([
            f"`{name}`", listed(part["algorithm"]), listed(part["observation"]), str(len(part)),
            frames_of(part), listed(part["n"]), listed(part["seed"]), hours,
        ])  # fmt: skip
    head = ("experiment", "algorithm", "observation", "runs", "frames", "training levels", "seeds", "hours")
    blocks: list[Block] = [
        Heading("What was run"),
        Table(head, rows, 3, "Experiments share runs, so their hours overlap."),
    ]
    sentences = []
    if "hours" in runs:
        sentences.append(
            f"All runs together took {plain(float(column(runs, 'hours').sum()), 1)} hours of training and evaluation."
        )
    if "test_levels" in runs:
        sentences.append(
            f"Agents were tested on {listed(runs['test_levels'])} test levels each, which all seeds of a panel share."
        )
    blocks.append(Paragraph(" ".join(sentences)))
    return [*blocks, *versions(named)]


def versions(named: pd.DataFrame) -> list[Block]:
    """Libraries, commits and fingerprints of the code, of runs with a row for each ``experiment`` that they belong to."""
    if "code" not in named:
        return []
    unknown = {"libraries": "", "commit": ""}  # of runs that older tables tell of
    named = named.assign(**{name: "" for name in unknown if name not in named}).fillna(unknown)
    made = ". Others: ".join(sorted(set(named["libraries"]) - {""}))
    rows = []
    for code, part in named.groupby("code", sort=True):
        commits = ", ".join(f"`{commit[:9]}`" for commit in sorted(set(part["commit"])) if commit)
        rows.append([f"`{code}`", commits, listed(part["experiment"]), str(count_of(part, "run"))])
    many = "several versions" if len(rows) > 1 else "one version"
    caption = (
        f"The runs were made by {many} of the code. A fingerprint is that of the simulator and of the modules of the "
        "algorithm, so each algorithm has its own; commits are those of the checkout."
    )
    libraries = [Paragraph(f"Libraries: {made}.")] if made else []
    return [*libraries, Table(("fingerprint", "commits", "experiments", "runs"), rows, 3, caption)]


def limits(evidence: Evidence) -> list[Block]:
    """What this scale cannot say."""
    main = evidence.main
    if main.empty:
        return []
    items = []
    frames = int(column(main, "frames").max())
    if frames < PAPER_FRAMES:
        items.append(f"Agents saw {frames:,} frames; the paper's saw {PAPER_FRAMES:,}.")
    algorithms, observations = set(main["algorithm"]), set(main["observation"])
    if algorithms != {"ppo"} or observations != {"textures"}:
        items.append(
            f"The agents are {listed(algorithms)} on {listed(observations)}, chosen to learn within this budget; the "
            "paper's are `ppo` on `textures`, which learn little in so few frames."
        )
    if "test_levels" in main and int(column(main, "test_levels").max()) < PAPER_TEST_LEVELS:
        items.append(
            f"{int(column(main, 'test_levels').max())} test levels per panel; the code of 2022 has {PAPER_TEST_LEVELS}."
        )
    seeds, points = count_of(main, "seed"), max(Counter(main["panel"]).values())
    items.append(
        f"{seeds} seed{'s' if seeds > 1 else ''}: a panel has at most {points} points, which reach p < 0.05 only where |r| "
        f"is above {critical_r(points):.3f}." if points > 2 else f"A panel has {points} points, too few for a correlation."
    )  # fmt: skip
    success = "success_train_deterministic"
    learned = mean_by(main, ["panel"], [success]).set_index("panel")[success].to_dict()
    low = [f"{panel} ({plain(learned[panel])})" for panel in evidence.results.panels if learned[panel] < LEARNED]
    if low:
        items.append(
            f"Agents did not learn to solve their own training levels in {', '.join(low)}: gaps there are about how "
            "agents fail."
        )
    power = dict(zip(evidence.power["test"], column(evidence.power, "estimate"), strict=True))
    tests = {"pooled": "pooled", "given panel and log n": "given panel and log n", "within": "in a single panel"}
    found = [f"{words} in {per_cent(power[test])}" for test, words in tests.items() if test in power]
    if found:
        items.append(
            f"If the paper's effect is as large as its p-value implies (r = {plain(PAPER_R)}), this design finds it in "
            f"so many cases: {', '.join(found)}."
        )
    items.append(
        "Runs share test levels, and training sets of a seed are nested in n: p-values that take runs for independent "
        "are too small."
    )
    return [Heading("Limits of this scale"), Bullets(items)]


def main_grid(evidence: Evidence, drawings: Drawings, boxes: Callable[..., list[Block]]) -> list[Block]:
    """Figures 3a and 3b."""
    blocks: list[Block] = [Heading("The main grid: gap against W2"), *drawings.blocks("figure_3a")]
    blocks += boxes("3a", "3a-panel", "3a-n", "3a-cell", "fixed-n")
    if len(evidence.main):
        blocks += [
            Heading("Pooled, partial, and one number of levels", 3),
            *drawings.blocks("estimates"),
            tabulated.main_table(evidence),
            tabulated.explained_table(evidence),
            Paragraph(confound(evidence)),
            tabulated.mixed_table(evidence),
            tabulated.predictor_table(evidence),
            tabulated.sensitivity_table(evidence),
            tabulated.power_table(evidence),
        ]
    blocks += [Heading("Each panel by itself", 3), *drawings.blocks("figure_3b")]
    blocks += boxes("3b-trend", "3b-easy", "3b-empty", "3b-weak")
    if len(evidence.main):
        blocks += [tabulated.panel_table(evidence)]
        blocks += [Heading("How many levels close the gap", 3), *drawings.blocks("train_and_test")]
        blocks += [Heading("All cells", 3), tabulated.cell_table(evidence.main)]
    return blocks


def confound(evidence: Evidence) -> str:
    """What the table of R² means."""
    part = select(evidence.explained, of="both")
    both = dict(zip(part["w2"], column(part, "r2"), strict=True))
    mode = "exact" if "exact" in both else evidence.modes[0]
    return (
        f"Panel and log n explain {per_cent(both[mode])} of the variance of the logarithm of the "
        f"{tabulated.DISTANCES[mode]}: a correlation over the main grid cannot tell W2 from how many levels were "
        "sampled, and where. The partial correlation given both rests on the few per cent that are left."
    )


def per_cent(share: float) -> str:
    """``93 %``."""
    return f"{100 * share:.0f} %"


def how_verdicts_are_decided() -> list[Block]:
    """The rules, as their module states them."""
    blocks: list[Block] = [Heading("How verdicts are decided")]
    text = (verdicts.__doc__ or "").replace("*An", "An").strip()
    for part in re.split(r"\n\s*\n", text):
        lines = re.sub(r"\n\s+", " ", part.strip())
        if lines.startswith("- "):
            blocks.append(Bullets([one.removeprefix("- ").replace("\n", " ") for one in re.split(r"\n(?=- )", lines)]))
        else:
            blocks.append(Paragraph(re.sub(r"(?<!\*)\*(?!\*)", "", lines.replace("\n", " "))))
    return blocks
