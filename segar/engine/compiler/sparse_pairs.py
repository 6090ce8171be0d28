"""Sparse pairs: a pair rule to which most partners are alike runs over a list of the others only.

A rule such as the Lorentz law decides by the partner alone (no charge, no magnetism) that its effect does not depend on
the partner. Such *quiet* partners are counted; the loop of a target runs over the rest.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from segar.engine.compiler.emit import Writer, active_test, both, condition, match_test, over_group, share
from segar.engine.compiler.source import Application, bind_tree
from segar.engine.compiler.spec import Group
from segar.language import Branch, Leaf, Symbol, Tree, walk

MANY_PARTNERS = 5  # in smaller groups it does not pay to list them


@dataclass(frozen=True)
class SparsePairs:
    """A pair rule, its quiet path, and where the list of partners that are not quiet lies.

    Attributes:
        mask: bits that a partner must have.
        quiet: conditions on the partner ``j`` and whether they hold, all on the way to ``leaf``.
        leaf: effects with quiet partners; they depend on the target alone.
        tree: the rule's tree.
        list_at: source of the list's begin in ``L``.
        name: suffix of the local names that hold how many partners are listed, and how many are quiet.
    """

    application: Application
    partners: Group
    mask: int
    quiet: tuple[tuple[Symbol, bool], ...]
    leaf: Leaf
    tree: Tree
    list_at: str
    name: str

    def write_list(self, w: Writer) -> None:
        """List the partners, before any target changes."""
        w.line(f"listed_{self.name} = quiet_{self.name} = 0")
        w.groups = {"j": self.partners}
        with (
            condition(w, active_test(w, self.application.rule)),
            over_group(w, self.partners, "j"),
            condition(w, match_test("j", self.mask)),
        ):
            with w.block(f"if {self._is_quiet(w)}:"):
                w.line(f"quiet_{self.name} += 1")
            with w.block("else:"):
                w.line(f"L[{self.list_at} + listed_{self.name}] = j")
                w.line(f"listed_{self.name} += 1")

    @contextmanager
    def listed(self, w: Writer, target: Group) -> Iterator[None]:
        """A loop over the partners ``j`` of the target ``i`` that are listed."""
        with w.block(f"for n in range(listed_{self.name}):"):
            w.line(f"j = L[{self.list_at} + n]")
            with condition(w, "i != j" if share(self.partners, target) else ""):
                w.groups = {"i": target, "j": self.partners}
                yield

    def write_count(self, w: Writer, target: Group) -> None:
        """Put the number of quiet partners of ``i`` in ``quiet``."""
        w.line(f"quiet = quiet_{self.name}")
        if share(self.partners, target):
            # The target is no partner of itself, and may be in the other group or not.
            inside = "" if set(target.slots) <= set(self.partners.slots) else f"i in {self.partners.slots}"
            with condition(w, both(inside, match_test("i", self.mask))):
                w.line("j = i")
                w.groups = {"i": target, "j": self.partners}
                with w.block(f"if {self._is_quiet(w)}:"):
                    w.line("quiet -= 1")

    def _is_quiet(self, w: Writer) -> str:
        tests = [w.value(c) if holds else f"not {w.value(c)}" for c, holds in self.quiet]
        return " and ".join(tests)


def write_repeats(w: Writer, sums: list[tuple[str, str]]) -> None:
    """Add for all other quiet partners what one of them added: local names of sums, and values. Zeros need no adding."""
    if not sums:
        return
    with w.block(f"if {' or '.join(f'{value} != 0.0' for _, value in sums)}:"), w.block("for _ in range(1, quiet):"):
        for name, value in sums:
            w.line(f"{name} += {value}")


def find_sparse_pairs(
    application: Application, partners: Group, mask: int, list_at: int, number: int
) -> SparsePairs | None:
    """The sparse pairs of a pair rule, or None where no path is quiet or there are few partners.

    Args:
        mask: bits that a partner must have.
        list_at: how many entries of ``L`` behind ``NEAR_AT`` earlier lists of the stage take.
        number: of the pair rule in the stage, for the names of its variables.
    """
    if len(application.rule.needs) != 2 or application.rule.relation is not None or len(partners.slots) < MANY_PARTNERS:
        return None
    tree = bind_tree(application.rule.tree, application)
    path = _quiet_path(tree)
    if path is None or not path[0]:
        return None
    quiet, leaf = path
    places = f"NEAR_AT + {list_at}", f"{number}_{partners.slots[0]}"
    return SparsePairs(application, partners, mask, quiet, leaf, tree, *places)


def _quiet_path(tree: Tree) -> tuple[tuple[tuple[Symbol, bool], ...], Leaf] | None:
    """The last path of conditions on ``j`` alone to a leaf whose effects depend on ``i`` alone."""
    if isinstance(tree, Leaf):
        depends_on_target = all(_variables(c) <= {"i"} for e in tree.effects for c in e.components)
        return ((), tree) if depends_on_target else None
    if not _variables(tree.condition) <= {"j"}:
        return None
    for branch, holds in ((tree.no, False), (tree.yes, True)):
        path = _quiet_path(branch)
        if path is not None:
            return ((tree.condition, holds), *path[0]), path[1]
    return None


def without(tree: Tree, leaf: Leaf) -> Tree:
    """The tree with nothing in the place of one of its leaves."""
    if isinstance(tree, Leaf):
        return Leaf() if tree is leaf else tree
    return Branch(tree.condition, without(tree.yes, leaf), without(tree.no, leaf))


def _variables(symbol: Symbol) -> set[str]:
    """The loop variables that a bound expression depends on."""
    found: set[str] = set()
    for s in walk(symbol):
        if s.op == "load":
            found.add(s.args[0])
        elif s.op in ("relation", "draw"):
            found |= {"i", "j"}
    return found
