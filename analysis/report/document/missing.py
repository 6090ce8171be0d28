"""What was planned and is not in the tables, in a sentence."""

from analysis.report.claims.evidence import Evidence
from analysis.report.document.blocks import Block, Paragraph
from segar.support import counted

MOST_NAMED = 8  # more is summed up by experiments


def what_is_missing(evidence: Evidence) -> list[Block]:
    """A warning about what was planned and is not in the tables; nothing where all is."""
    missing = evidence.all_results.missing_runs()
    if not missing:
        return []
    by_experiment = evidence.all_results.missing_by_experiment()
    if len(missing) <= MOST_NAMED or not by_experiment:
        shown = ", ".join(missing[:MOST_NAMED]) + (" and others" if len(missing) > MOST_NAMED else "")
        count = f"{len(missing)} runs or tests" if len(missing) > 1 else "a run or test"
    else:
        runs, tests = (sum(one[i] for one in by_experiment.values()) for i in range(2))
        words = [f"{title} ({_missing_in_words(*numbers)})" for title, numbers in by_experiment.items()]
        shown = "; ".join(words) + ". Each is named in `missing.csv`"
        count = _missing_in_words(runs, tests)
    return [
        Paragraph(
            f"**Of what was planned, {count} are missing**, and the report does without them: {shown}.", "warning"
        )
    ]


def _missing_in_words(runs: int, tests: int) -> str:
    """How much is missing: runs, and runs of which only tests or probes are."""
    parts = [counted(runs, "run")] * (runs > 0) + [f"tests or probes of {counted(tests, 'run')}"] * (tests > 0)
    return " and ".join(parts)
