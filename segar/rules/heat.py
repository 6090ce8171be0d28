"""Heat: objects lose mass on hot ground."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import Heat, Mass, Mobile, SetFactor, is_on, rule

BURN_RATE = 0.1  # share of the mass lost per sub-step at heat 1; the 2022 rule uses the same


@rule(relation=is_on)
def apply_burn(body: Tuple[Mass, Mobile], ground: Tuple[Heat]) -> SetFactor[Mass]:
    """A mobile body on hot ground loses mass in every sub-step."""
    m, mobile = body
    (heat,) = ground
    if not mobile or heat == 0:  # cold ground sets no mass, so that another rule may set it
        return None
    return SetFactor[Mass](m, m * (1 - BURN_RATE * heat))
