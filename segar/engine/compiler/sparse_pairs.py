"""Pair rules that have nothing to say of most partners: list the others once, instead of asking every pair.

A rule such as the Lorentz law decides by the partner alone (no charge, no magnetism) that its effect does not depend on
the partner. Such *quiet* partners are counted; the loop of a target runs over the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

from segar.engine.compiler.applications import Application, bind_tree
from segar.engine.compiler.emit import Writer
from segar.engine.compiler.loops import both, condition, match_test, over_group
from segar.engine.compiler.spec import Group
from segar.language import Branch, Leaf, Symbol, Tree, walk

MANY_PARTNERS = 5  # in smaller groups it does not pay to list them


@dataclass(frozen=True)
class Gate:
    """A pair rule, its quiet path, and where the list of partners that are not quiet lies.

    Attributes:
        quiet: conditions on the partner ``j`` and whether they hold, all on the way to ``leaf``.
        leaf: outcomes with quiet partners; they depend on the target alone.
        rest: the rule's tree without that leaf.
        list_at: source of the list's begin in ``L``.
        name: suffix of the local names that hold how many partners are listed, and how many are quiet.
    """

    application: Application
    partners: Group
    mask: int
    quiet: tuple[tuple[Symbol, bool], ...]
    leaf: Leaf
    rest: Tree
    list_at: str
    name: str

    def write_list(self, w: Writer) -> None:
        """List the partners, before any target changes."""
        w.line(f"listed_{self.name} = quiet_{self.name} = 0")
        w.groups = {"j": self.partners}
        with over_group(w, self.partners, "j"), condition(w, match_test("j", self.mask)):
            with w.block(f"if {self._is_quiet(w)}:"):
                w.line(f"quiet_{self.name} += 1")
            with w.block("else:"):
                w.line(f"L[{self.list_at} + listed_{self.name}] = j")
                w.line(f"listed_{self.name} += 1")

    def write_count(self, w: Writer, target: Group) -> None:
        """Put the number of quiet partners of ``i`` in ``quiet``."""
        w.line(f"quiet = quiet_{self.name}")
        if set(self.partners.slots) & set(target.slots):
            # The target is no partner of itself, and may be in the other group or not.
            inside = "" if set(target.slots) <= set(self.partners.slots) else f"i in {self.partners.slots}"
            with condition(w, both(inside, match_test("i", self.mask))):
                w.line("j = i")
                w.groups = {"i": target, "j": self.partners}
                with w.block(f"if {self._is_quiet(w)}:"):
                    w.line("quiet -= 1")

    def write_repeats(self, w: Writer, sums: list[tuple[str, str]]) -> None:
        """What one quiet partner added, all others add as well; zeros need no adding."""
        with (
            w.block(f"if {' or '.join(f'{value} != 0.0' for _, value in sums)}:"),
            w.block("for _ in range(1, quiet):"),
        ):
            for name, value in sums:
                w.line(f"{name} += {value}")

    def _is_quiet(self, w: Writer) -> str:
        tests = [w.value(c) if holds else f"not {w.value(c)}" for c, holds in self.quiet]
        return " and ".join(tests)


def find_gate(application: Application, partners: Group, mask: int, list_at: int, number: int) -> Gate | None:
    """The gate of a pair rule, or None where no path is quiet or there are few partners.

    Args:
        mask: what the bits of a partner must hold.
        list_at: how many entries of ``L`` behind ``NEAR_AT`` earlier lists of the stage take.
        number: tells the gates of a stage apart.
    """
    if len(application.needs) != 2 or application.rule.relation is not None or len(partners.slots) < MANY_PARTNERS:
        return None
    tree = bind_tree(application.rule.tree, application)
    path = _quiet_path(tree)
    if path is None or not path[0]:
        return None
    quiet, leaf = path
    name = f"{number}_{partners.slots[0]}"
    return Gate(application, partners, mask, quiet, leaf, _without(tree, leaf), f"NEAR_AT + {list_at}", name)


def _quiet_path(tree: Tree) -> tuple[tuple[tuple[Symbol, bool], ...], Leaf] | None:
    """The last path of conditions on ``j`` alone to a leaf that speaks of ``i`` alone."""
    if isinstance(tree, Leaf):
        speaks_of_target = all(_variables(c) <= {"i"} for o in tree.outcomes for c in o.components)
        return ((), tree) if speaks_of_target else None
    if not _variables(tree.condition) <= {"j"}:
        return None
    for branch, holds in ((tree.no, False), (tree.yes, True)):
        path = _quiet_path(branch)
        if path is not None:
            return ((tree.condition, holds), *path[0]), path[1]
    return None


def _without(tree: Tree, leaf: Leaf) -> Tree:
    if isinstance(tree, Leaf):
        return Leaf() if tree is leaf else tree
    return Branch(tree.condition, _without(tree.yes, leaf), _without(tree.no, leaf))


def _variables(symbol: Symbol) -> set[str]:
    """The loop variables that a bound expression depends on."""
    found: set[str] = set()
    for s in walk(symbol):
        if s.op == "load":
            found.add(s.args[0])
        elif s.op in ("relation", "draw"):
            found |= {"i", "j"}
    return found
