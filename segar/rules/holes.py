"""Holes: they swallow the bodies that they contain."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import Consumes, Done, Mobile, SetFactor, Visible, contains, rule


@rule(relation=contains)
def consume(
    body: Tuple[Mobile, Done, Visible], hole: Tuple[Consumes]
) -> Tuple[SetFactor[Done], SetFactor[Visible], SetFactor[Mobile]]:
    """A mobile body inside a hole is done: it vanishes and moves no more."""
    mobile, done, visible = body
    if not mobile:
        return None
    return SetFactor[Done](done, True), SetFactor[Visible](visible, False), SetFactor[Mobile](mobile, False)
