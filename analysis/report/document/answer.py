"""The answer, which opens the report."""

from collections.abc import Mapping, Sequence

import numpy as np

from segar.analysis.report.captions import TEXTS
from segar.analysis.report.claims import verdicts
from segar.analysis.report.claims.claim import LEARNED, METRIC_OURS, Claim, Finding
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.document.blocks import SHORT
from segar.analysis.report.number_format import estimate_text
from segar.analysis.tables import select

OF_W2 = ("matched-w2", "states-w2")  # the studies that take W2 and the number of levels apart


def in_a_word(claims: Mapping[str, Claim]) -> str:
    """The answer to the title's question, by the rule in ``rules.yaml``: yes, partly, no, or not known yet."""
    headline, itself = (
        claims["3a"].verdict(METRIC_OURS),
        of_itself([claims[name].verdict(METRIC_OURS) for name in OF_W2]),
    )
    both = [headline, itself].count(verdicts.SUPPORTED)
    if both:
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
    main = evidence.main
    counts = sorted({*main["n"]})
    if len(counts) < 2:
        return ""
    few, many = (evidence.mean(select(main, n=n), "gap_success") for n in (counts[0], counts[-1]))
    levels = "one training level" if counts[0] == 1 else f"{counts[0]} training levels"
    shown = {"few": estimate_text(few, ""), "many": estimate_text(many, "")}
    return TEXTS["levels_close"].format(fewest=levels, most=counts[-1], **shown)


def leading(claim: Claim, settings: str) -> Finding | None:
    """The first test of a claim that has a number, with the runs that learned; None where there is none."""
    return next((one for one in claim.tests(settings, LEARNED) if np.isfinite(one.found.estimate)), None)


def number(one: Finding) -> str:
    """An estimate with its interval and what it rests on."""
    return estimate_text(one.found, SHORT.get(one.measure, one.measure))
