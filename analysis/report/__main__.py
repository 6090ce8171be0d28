"""``python -m analysis.report results=FOLDER``: claims, statistics, figures, a page and a PDF from the tables
of a folder.

``FOLDER`` is one that experiments.reproduce made, or one of docs/results; only its tables are read. Written there:
``report.html``, ``report.pdf``, ``claims.csv``, ``figures/<name>.{svg,png,csv}`` and ``statistics/<name>.csv``.
``only=[figure_3a]`` draws figures and makes nothing else.
"""

from __future__ import annotations

from collections import Counter

from analysis.report.claims import CORRECTED, PAPER
from analysis.report.make import PAGE, ReportConfig, make_report
from analysis.report.words import said
from experiments.commands.hydra_app import run_simple_command


def main(config: ReportConfig) -> None:
    """Makes the report and says where it is."""
    report = make_report(config)
    results = report.evidence.results
    print(
        f"{len(results.runs)} runs are in the report, {len(results.lacking())} runs or tests of the plan are missing."
    )
    if config.only:
        for path in report.files:
            print(path)
        return
    for settings in (PAPER, CORRECTED):
        counted = Counter(claim.verdict(settings) for claim in report.claims)
        print(f"{settings}: " + ", ".join(f"{count} {name}" for name, count in sorted(counted.items()) if name))
    if len(results.main):
        print(f"gap against W2 of 2022, pooled: {said(report.evidence.association('reference', 'gap_2022', 'pooled'))}")
    print(f"report: {report.folder / PAGE}")


if __name__ == "__main__":
    run_simple_command(main, ReportConfig, __doc__)
