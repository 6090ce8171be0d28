"""Plain twin of :mod:`segar.engine.compiler.sparse_pairs`: every target meets all of its partners, without a list.

Sums are taken in the same order, first over the partners that are not quiet and then over those that are.
"""

from collections.abc import Callable

from segar.engine.compiler.emit import Writer
from segar.engine.compiler.loops import both, condition, match_test, over_group, share
from segar.engine.compiler.sparse_pairs import SparsePairs
from segar.engine.compiler.spec import Group
from segar.language import Tree


class PlainPairs(SparsePairs):
    """A pair rule with a quiet path, written as two loops over all partners."""

    def write_list(self, w: Writer) -> None:
        """Write nothing: there is no list."""

    def write(
        self,
        w: Writer,
        target: Group,
        apply: Callable[[Tree], None],
        sums: Callable[[], list[tuple[str, str]]],
        quiet_matters: bool,
    ) -> None:
        """Write the effects of all partners on the target ``i``; see :meth:`SparsePairs.write`."""
        test = both("i != j" if share(self.partners, target) else "", match_test("j", self.mask))
        for tree in (self.rest, self.quiet_tree):
            with over_group(w, self.partners, "j"), condition(w, test):
                w.groups = {"i": target, "j": self.partners}
                apply(tree)
