"""What counts of Python source: its syntax tree without docstrings, layout, the order of imports and the texts of errors."""

import ast
import sys
from pathlib import Path

from segar.experiments.settings import imported_from

SHOWN_ALIKE = {"show_empty": True} if sys.version_info >= (3, 13) else {}  # Python 3.13 leaves empty lists out


def executed(path: Path) -> bytes:
    """The source that this process executes: what was in the file when it was imported, and what is in it where it was not.

    Raises:
        OSError: it cannot be read.
    """
    found = imported_from(path.resolve())
    return path.read_bytes() if found is None else found[1]


def normalised(content: bytes) -> bytes:
    """The syntax tree of a source without docstrings and without the texts of what it raises, its imports in order of name.

    It is the same on all versions of Python, of which 3.12 added type parameters. Of what is no Python, such as a
    template, the content as it is.
    """
    tree = _syntax_tree(content)
    if tree is None:
        return content
    if not _order_counts(tree.body):
        tree.body.sort(key=_import_order)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [one for one in body if not (isinstance(one, ast.Expr) and _is_text(one.value))]
            node.body = kept  # type: ignore[attr-defined]
        if getattr(node, "type_params", None) == []:
            del node.type_params  # type: ignore[attr-defined]
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args = [argument for argument in node.exc.args if not _is_text(argument)]
    return ast.dump(tree, **SHOWN_ALIKE).encode()


def nodes_of(path: Path) -> list[ast.AST]:
    """All nodes of the syntax tree of a source, as it is executed; none of one that is no Python."""
    tree = _syntax_tree(executed(path))
    return [] if tree is None else list(ast.walk(tree))


def _syntax_tree(content: bytes) -> ast.Module | None:
    try:
        return ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):  # ValueError: zero bytes
        return None


def _order_counts(body: list[ast.stmt]) -> bool:
    """Whether an import gives a name that another import, or an assignment, gives too, so that the later one holds."""
    aliases = [(one, alias) for one in body if isinstance(one, ast.Import | ast.ImportFrom) for alias in one.names]
    # Of 'import a.b' the name is a, which is the same in all of them.
    named = [alias.asname or alias.name for one, alias in aliases if alias.asname or isinstance(one, ast.ImportFrom)]
    beside = (node for one in body if not isinstance(one, ast.FunctionDef | ast.ClassDef) for node in ast.walk(one))
    stored = {node.id for node in beside if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return len({*named}) < len(named) or not stored.isdisjoint(named)


def _import_order(statement: ast.stmt) -> str:
    """Puts imports first, sorted, and leaves all other statements in the order in which they stand."""
    if not isinstance(statement, ast.Import | ast.ImportFrom):
        return "~"
    statement.names.sort(key=lambda alias: (alias.name, alias.asname or ""))
    return ast.dump(statement, **SHOWN_ALIKE)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))
