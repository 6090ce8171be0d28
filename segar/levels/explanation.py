"""Why a factor starts with the distribution that it has: the priors that were candidates, and how they were ranked."""

from dataclasses import dataclass
from typing import Any

from segar.errors import PriorError, did_you_mean
from segar.language import Entity, Factor, Layout, Parameter, Position, holds
from segar.levels.priors import Prior, factors_read, ranked, specificity
from segar.levels.sampling.plan import SamplingPlan


@dataclass(frozen=True)
class Candidate:
    """A prior on the factor, and whether it wins, loses or does not apply."""

    prior: Prior
    verdict: str


@dataclass(frozen=True)
class Explanation:
    """What a factor of an entity starts with, and why; ``print`` shows all of it.

    Attributes:
        subject: whose factor it is.
        value: the distribution or constant of the winner; None where relations decide per level.
        winner: the prior that wins in every level, None where there is none or relations decide.
        candidates: all priors on the factor, most specific first.
        source: where the value comes from if no prior sets it.
    """

    subject: str
    value: Any
    winner: Prior | None
    candidates: tuple[Candidate, ...]
    source: str = ""

    def __str__(self) -> str:
        shown = "decided level by level" if self.winner is None and not self.source else repr(self.value)
        lines = [f"{self.subject}: {shown}" + (f" ({self.source})" if self.source else "")]
        return "\n".join([*lines, *(f"  {c.prior}: {c.verdict}" for c in self.candidates)])


def explain(plan: SamplingPlan, priors: tuple[Prior, ...], entity: Any, factor: type[Factor]) -> Explanation:
    """The explanation for a factor of an entity type, of the slot of that name, or (entity None) of a world parameter.

    Raises:
        PriorError: there is no such entity, it may be of several types, or it lacks the factor.
    """
    if not (isinstance(factor, type) and issubclass(factor, Factor)):
        raise PriorError(f"explain(entity, factor) takes a factor class such as segar.Mass, not {factor!r}")
    if issubclass(factor, Parameter):
        return _explain_parameter(plan, priors, factor)
    kind, slot = _find(plan.layout, entity)
    held = holds(kind, factor)
    if held is None:
        near = did_you_mean(factor.__name__, [f.__name__ for f in kind.declared])
        raise PriorError(f"{kind.__name__} has no {factor.__name__}.{near}")
    subject = f"{held.__name__} of {kind.__name__}" + (f" '{entity}'" if isinstance(entity, str) else "")
    counting = ranked(priors, kind, held)
    candidates = tuple(_candidates(priors, counting, kind, held))
    if held is Position and slot in plan.fixed_positions:
        fixed = tuple(Candidate(c.prior, "loses: the place is fixed by positions=") for c in candidates)
        return Explanation(subject, plan.fixed_positions[slot], None, fixed, "fixed by positions=")
    if not counting:
        return Explanation(subject, kind.declared[held], None, candidates, f"{kind.__name__}'s own; no prior sets it")
    decided = len(counting) == 1 and not factors_read(counting[0])
    return Explanation(subject, counting[0].value if decided else None, counting[0] if decided else None, candidates)


def _explain_parameter(plan: SamplingPlan, priors: tuple[Prior, ...], factor: type[Parameter]) -> Explanation:
    if factor not in plan.layout.parameters:
        names = [p.__name__ for p in plan.layout.parameters]
        raise PriorError(f"these levels have no {factor.__name__}.{did_you_mean(factor.__name__, names)}")
    column = plan.layout.parameters.index(factor)
    drawn = dict(plan.parameter_priors).get(column)
    stated = drawn or next((p for p in priors if p.factor is factor), None)
    value, subject = float(plan.parameters[column]), f"{factor.__name__} of the world"
    if plan.rule_space is not None and factor in plan.rule_space.parameters:
        return Explanation(subject, plan.rule_space.marginals()[factor], None, (), "drawn by the rule space")
    if stated is not None:
        only = (Candidate(stated, "wins: a parameter takes one value or distribution"),)
        return Explanation(subject, stated.value, stated, only)
    default = value == factor.default
    return Explanation(subject, value, None, (), "the default" if default else "given in parameters=")


def _candidates(
    priors: tuple[Prior, ...], counting: tuple[Prior, ...], entity: type[Entity], factor: type[Factor]
) -> list[Candidate]:
    last = counting[-1] if counting else None
    found = []
    for place, prior in enumerate(counting):
        where = " where its relation holds" if factors_read(prior) else " where no other one holds" if place else ""
        found.append(Candidate(prior, f"wins{where}: {rank(prior)}"))
    rest = [p for p in priors if issubclass(factor, p.factor) and not any(p is c for c in counting)]
    for prior in sorted(rest, key=specificity, reverse=True):
        if prior.entity_type is not None and not issubclass(entity, prior.entity_type):
            verdict = f"does not apply: {entity.__name__} is no {prior.entity_type.__name__}"
        elif last is None or specificity(prior) > specificity(last):
            verdict = f"does not apply: its relation never holds for {entity.__name__}"
        else:
            verdict = f"loses: {rank(prior)}"
        found.append(Candidate(prior, verdict))
    return found


def rank(prior: Prior) -> str:
    """The prior's specificity as a text."""
    points, depth, _, _ = specificity(prior)
    reasons = []
    if prior.entity_type is not None:
        reasons.append(f"entity type {prior.entity_type.__name__}, {depth - 1} classes deep")
    if prior.relation is not None:
        reasons.append(f"relation {prior.relation.name}")
    return f"specificity {points} ({'; '.join(reasons) or 'no condition'})"


def _find(layout: Layout, entity: Any) -> tuple[type[Entity], int]:
    """The entity type, and a slot: the one of that name or the only one of that type, else -1."""
    types = layout.types
    if isinstance(entity, type) and issubclass(entity, Entity):
        if entity not in types:
            near = did_you_mean(entity.__name__, [t.__name__ for t in types])
            raise PriorError(f"no {entity.__name__} is in numbers.{near}")
        slots = [k for k, slot in enumerate(layout.slots) if slot.types == (entity,)]
        return entity, slots[0] if len(slots) == 1 else -1
    if entity not in layout.names:
        raise PriorError(f"there is no entity '{entity}'.{did_you_mean(str(entity), list(layout.names))}")
    slot = layout.names.index(entity)
    if len(layout.slots[slot].types) > 1:
        names = ", ".join(t.__name__ for t in layout.slots[slot].types)
        raise PriorError(f"'{entity}' may be one of {names}; ask for one of these types")
    return layout.slots[slot].types[0], slot
