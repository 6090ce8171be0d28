"""What counts of Python source: its syntax tree without docstrings, layout, the order of imports and the texts of errors."""

import ast
from pathlib import Path


def normalised(path: Path) -> bytes:
    """The syntax tree of a file without docstrings and without the texts of what it raises, its imports in order of name.

    Of a file that is no Python, such as a template, the content as it is. Raises :class:`OSError` if it cannot be read.
    """
    content = path.read_bytes()
    tree = _syntax_tree(content)
    if tree is None:
        return content
    tree.body.sort(key=_import_order)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [one for one in body if not (isinstance(one, ast.Expr) and _is_text(one.value))]
            node.body = kept  # type: ignore[attr-defined]
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args = [argument for argument in node.exc.args if not _is_text(argument)]
    return ast.dump(tree).encode()


def nodes_of(path: Path) -> list[ast.AST]:
    """All nodes of the syntax tree of a file; none of one that is no Python."""
    tree = _syntax_tree(path.read_bytes())
    return [] if tree is None else list(ast.walk(tree))


def _syntax_tree(content: bytes) -> ast.Module | None:
    try:
        return ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):  # ValueError: zero bytes
        return None


def _import_order(statement: ast.stmt) -> str:
    """Puts imports first, sorted, and leaves all other statements in the order in which they stand."""
    if not isinstance(statement, ast.Import | ast.ImportFrom):
        return "~"
    statement.names.sort(key=lambda alias: (alias.name, alias.asname or ""))
    return ast.dump(statement)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))
