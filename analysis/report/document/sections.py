"""The report's text: which claims, tables and figures stand where, and the sentences between them."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import pandas as pd

from analysis.report.captions import TABLES
from analysis.report.claims import verdicts
from analysis.report.claims.claim import CORRECTED, PAPER, Claim
from analysis.report.claims.evidence import PAPER_R, Evidence
from analysis.report.document import beyond, tables
from analysis.report.document.blocks import Block, Bullets, Document, Heading, Paragraph, Picture, Table, Verdict
from analysis.report.document.files import as_block
from analysis.report.number_format import estimate_text, listed, plain
from analysis.stats.power import critical_r
from analysis.tables import column, count_of, mean_by, select

PAPER_FRAMES, PAPER_TEST_LEVELS = 1_000_000, 500
IN_SHORT = ("3a", "3a-n", "3a-cell", "fixed-n", "3b-trend", "4a-larger", "4b-none", "5a-gap", "A-mass")
LEARNED = 0.5  # success on training levels below which an agent did not learn its task


def document(evidence: Evidence, claims: Sequence[Claim], figures: Mapping[str, Picture | str]) -> Document:
    """The whole report; ``figures`` has by name each figure, or why there is none."""
    by_name = {claim.name: claim for claim in claims}

    def drawn(name: str) -> list[Block]:
        return [as_block(figures[name])]

    def boxes(*names: str) -> list[Block]:
        return [Verdict(by_name[name]) for name in names]

    def section(title: str, level: int, figure: str, *names: str) -> list[Block]:
        return [Heading(title, level), *drawn(figure), *boxes(*names)]

    blocks: list[Block] = [
        *opening(evidence),
        *summary(claims),
        *what_was_run(evidence),
        *limits(evidence),
        *section("The main grid: gap against W2", 2, "figure_3a", "3a", "3a-panel", "3a-n", "3a-cell", "fixed-n"),
        *(estimates(evidence, drawn) if len(evidence.main) else ()),
        *section("Each panel by itself", 3, "figure_3b", "3b-trend", "3b-easy", "3b-empty", "3b-weak"),
        *(panels_and_cells(evidence, drawn) if len(evidence.main) else ()),
        *section("Out of distribution", 2, "figure_4a", "4a-larger", "4a-shift", "4a-trend", "4a-all"),
        *section("What representations know", 2, "figure_4b", "4b-train", "4b-none"),
        *section("Self-supervised losses", 3, "figure_5a", "5a-gap", "5a-similar", "5a-trends"),
        *section("Mass and frame stack", 3, "appendix_mass"),
        *masses(evidence),
        *boxes("A-mass", "A-flip"),
        *section("Learning", 2, "figure_5b", "5b-diversity", "5b-easy"),
        *section("SAC", 3, "appendix_sac", "A-sac-easy", "A-sac-hard"),
        *section("KS and W2", 3, "appendix_measures", "A-ks"),
        *beyond.blocks(evidence, drawn),
        *how_verdicts_are_decided(),
    ]
    scale = evidence.results.scale
    subtitle = f"The Sandbox Environment for Generalizable Agent Research (SEGAR): its experiments at scale `{scale}`"
    return Document("What holds of the paper's claims", subtitle, blocks)


def opening(evidence: Evidence) -> list[Block]:
    """The runs of this report, and a warning about missing ones."""
    results = evidence.results
    main, runs = results.main, results.runs
    text = f"{len(runs)} runs, none of them of the main grid"
    if len(main):
        text = (
            f"{len(main)} runs of the main grid ({listed(main['algorithm'])} on {listed(main['observation'])}, "
            f"{frames_of(main)} frames, seed{'s' if count_of(main, 'seed') > 1 else ''} {listed(main['seed'])})"
        )
        others, tests = len(runs) - len(main), len(results.transfers)
        text += f", {others} more runs" if others else ""
        text += f", and {tests} tests of their agents elsewhere" if tests else ""
    text += (
        ". "
        "The gap is the mean return on test levels less that on training levels; negative means worse on test levels. "
        "Every claim is read twice: with the settings of the paper and its code of 2022, and with what is wrong in "
        "them corrected."
    )
    return [Paragraph(text, "lead"), *what_is_missing(evidence)]


def what_is_missing(evidence: Evidence) -> list[Block]:
    """A warning about what was planned and is not in the tables; nothing where all is."""
    missing = evidence.results.missing_runs()
    if not missing:
        return []
    shown = ", ".join(missing[:8]) + (" and others" if len(missing) > 8 else "")
    text = (
        f"**Of what was planned, {len(missing)} runs or tests are missing**, and the report does without them: {shown}."
    )
    return [Paragraph(text, "warning")]


def frames_of(table: pd.DataFrame) -> str:
    """Numbers of frames, with commas."""
    return ", ".join(f"{n:,}" for n in sorted(set(table["frames"])))


def summary(claims: Sequence[Claim]) -> list[Block]:
    """The main claims in sentences, and all claims with their verdicts in one table."""
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
        name = "r" if number is not None and number.measure.endswith("Pearson r") else "difference"
        shown = "" if number is None or several else estimate_text(number.found, name)
        corrected = claim.verdict(CORRECTED) if claim.findings else ""
        rows.append([claim.name, claim.verdict(PAPER), corrected, claim.statement, shown])
    head = ("claim", PAPER, CORRECTED, "the paper says, in our words", "corrected, in numbers")
    return [
        Heading("Verdicts"),
        Paragraph(" ".join(sentences)),
        Bullets(short),
        Table(head, rows, 5, TABLES["verdicts"]),
    ]


def reading(claim: Claim) -> str:
    """The verdicts on a claim in a sentence."""
    parts = [f"{claim.verdict(s)} {'as in the paper' if s == PAPER else 'when corrected'}" for s in (PAPER, CORRECTED)
             if claim.verdict(s)]  # fmt: skip
    text = ", ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def masses(evidence: Evidence) -> list[Block]:
    """The success of agents with the mass shown and hidden."""
    table = evidence.results.masses
    if table.empty:
        return []
    named = table.assign(levels=table["n"])
    found = tables.means(evidence, named, ["past", "mass", "levels"], "success_test_deterministic", "masses")
    head = {"past": "the agent has", "mass": "mass", "levels": "training levels"}
    return [tables.means_table(found, head, "success", TABLES["masses"], plain)]


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
    shown = Table(head, rows, 3, "Experiments share runs, so their hours overlap.")
    sentences = []
    if "hours" in runs:
        hours = plain(float(column(runs, "hours").sum()), 1)
        sentences.append(f"All runs together took {hours} hours of training and evaluation.")
    if "test_levels" in runs:
        levels = listed(runs["test_levels"])
        sentences.append(f"Agents were tested on {levels} test levels each, which all seeds of a panel share.")
    return [Heading("What was run"), shown, Paragraph(" ".join(sentences)), *versions(named)]


def versions(named: pd.DataFrame) -> list[Block]:
    """Libraries, commits and fingerprints of the code, of runs with a row for each ``experiment`` that they belong to."""
    if "code" not in named:
        return []
    unknown = {"libraries": "", "commit": "", "computed_with": ""}  # of runs that older tables tell of
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
    computed = sorted(set(named["computed_with"]) - {""})
    libraries += [Paragraph(f"Computed with: {'. Others: '.join(computed)}.")] if computed else []
    return [*libraries, Table(("fingerprint", "commits", "experiments", "runs"), rows, 3, caption)]


def limits(evidence: Evidence) -> list[Block]:
    """The limits of a scale: frames, algorithms, test levels, seeds, power."""
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
    tested = int(column(main, "test_levels").max()) if "test_levels" in main else PAPER_TEST_LEVELS
    if tested < PAPER_TEST_LEVELS:
        items.append(f"{tested} test levels per panel; the code of 2022 has {PAPER_TEST_LEVELS}.")
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


def estimates(evidence: Evidence, drawn: Callable[[str], list[Block]]) -> list[Block]:
    """All correlations of the main grid, and what they rest on."""
    return [
        Heading("Pooled, partial, and one number of levels", 3),
        *drawn("estimates"),
        tables.main_table(evidence),
        tables.explained_table(evidence),
        Paragraph(confound(evidence)),
        tables.mixed_table(evidence),
        tables.predictor_table(evidence),
        tables.sensitivity_table(evidence),
        tables.power_table(evidence),
    ]


def panels_and_cells(evidence: Evidence, drawn: Callable[[str], list[Block]]) -> list[Block]:
    """The main grid by panels, by numbers of levels, and by cells."""
    return [
        tables.panel_table(evidence),
        Heading("How many levels close the gap", 3),
        *drawn("train_and_test"),
        Heading("All cells", 3),
        tables.cell_table(evidence.main),
    ]


def confound(evidence: Evidence) -> str:
    """A sentence on what the table of R² means."""
    part = select(evidence.explained, of="both")
    both = dict(zip(part["w2"], column(part, "r2"), strict=True))
    mode = "exact" if "exact" in both else evidence.modes[0]
    return (
        f"Panel and log n explain {per_cent(both[mode])} of the variance of the logarithm of the "
        f"{tables.DISTANCES[mode]}: a correlation over the main grid cannot tell W2 from how many levels were "
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
