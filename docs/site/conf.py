"""Sphinx's settings for the site; ``make site`` writes the sources of its pages first (``pages.py``)."""

from __future__ import annotations

import importlib
import inspect
import pydoc
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.nodes import make_refnode

import segar
from segar.language import Relation, Rule

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

from api import docstring_in_rst, facts_of, public_names  # noqa: E402

for room in public_names():  # once, before Sphinx starts its workers, and for find_name
    importlib.import_module(room)

project = "SEGAR"
author = "SEGAR developers"
copyright = "SEGAR developers"
release = version = segar.__version__
html_title = f"SEGAR {release}"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
autosummary_generate = False  # ``api.py`` writes the pages
nitpicky = True
# Links of the scheme `here` are relative links to files that are no pages; ``pages.py`` writes them.
myst_url_schemes = {"http": None, "https": None, "mailto": None, "here": "{{path}}"}
myst_heading_anchors = 4

html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_extra_path = [str(ROOT / "build" / folder) for folder in ("site-files", "site-playgrounds")]
html_copy_source = False
html_show_sphinx = False
html_last_updated_fmt = None
pygments_style, pygments_dark_style = "friendly", "github-dark"

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
toc_object_entries = False


def setup(app: Sphinx) -> dict[str, bool]:
    """Documents rules and relations as the functions that they are, and links names in text."""
    app.connect("autodoc-process-docstring", use_docstring)
    app.connect("autodoc-process-signature", use_plain_signature)
    app.connect("missing-reference", find_name)
    app.add_post_transform(LinkNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def use_docstring(app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    documentation = value.function.__doc__ if isinstance(value, Rule | Relation) else "\n".join(lines)
    lines[:] = [*docstring_in_rst(documentation or ""), "", facts_of(value) if what == "class" else ""]


def use_plain_signature(
    app: Sphinx, what: str, name: str, value: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """The signature of the function of a rule; and no types where these are checks of settings, which print addresses."""
    if what == "function" and isinstance(value, Rule | Relation):
        return f"({', '.join(inspect.signature(value.function).parameters)})", None
    if signature and (" at 0x" in signature or "Annotated[" in signature):
        parameters = inspect.signature(value).parameters.values()
        return f"({', '.join(str(p.replace(annotation=p.empty)) for p in parameters)})", None
    return re.sub(r"<[^<>]*>", "...", signature) if signature else None, returned


def find_name(app: Sphinx, env: BuildEnvironment, node: pending_xref, text: nodes.Element) -> nodes.Element | None:
    """A link to the one entry whose name ends so; plain text for what exists and has no entry, such as a class of numpy."""
    if node.get("refdomain") != "py":
        return None
    target = str(node["reftarget"])
    is_ours = "." not in target or target.startswith(("segar.", "experiments."))
    for name in (target, target.rpartition(".")[2]) if is_ours else ():
        if link := link_to(app, env, name, text, node.get("refdoc", "")):
            return link
    scopes = ("", *scopes_of(node.get("py:module"), node.get("py:class")))
    return text if any(exists(scope + target) for scope in scopes) else None


def exists(name: str) -> bool:
    """Whether this is the full name of a thing in Python, or of a field of a dataclass."""
    owner, _, attribute = name.rpartition(".")
    in_module = hasattr(
        sys.modules.get(owner), attribute
    )  # of a module that its package hides, as torch.optim.optimizer
    return (
        in_module or pydoc.locate(name) is not None or attribute in getattr(pydoc.locate(owner), "__annotations__", ())
    )


def scopes_of(room: str | None, owner: str | None) -> Iterator[str]:
    """Where the docstrings of a room, and of a class in it, may look up names: rooms and modules, with a final dot."""
    if owner:
        yield f"{room}.{owner}."
    if room:
        yield from (f"{name}." for name in [*sys.modules] if name == room or name.startswith(f"{room}."))


class LinkNames(SphinxPostTransform):
    """Links code in text that is a public name, such as ``segar.metrics.w2`` or ``TextureSet``, to its entry in the API."""

    default_priority = 20
    formats = ("html",)

    def run(self, **kwargs: Any) -> None:
        if self.env.docname.startswith(("api/", "source/")):
            return
        for code in list(self.document.findall(nodes.literal)):
            name = named_by(code.astext())
            if name is None or isinstance(code.parent, nodes.reference | nodes.title):
                continue
            link = link_to(self.app, self.env, name, code.deepcopy(), self.env.docname)
            if link is not None:
                code.replace_self(link)


def named_by(code: str) -> str | None:
    """The name that code in text stands for: a full name, a class, a function of several words, or one that is called."""
    found = re.fullmatch(r"([\w.]+)(\(.*\))?", code)
    if not found:
        return None
    name, call = found.groups()
    is_word = name.islower() and "_" not in name and not call
    is_public = any(name in names for names in public_names().values())
    return name if "." in name or (is_public and not is_word) else None


def link_to(app: Sphinx, env: BuildEnvironment, name: str, text: nodes.Element, page: str) -> nodes.Element | None:
    """A link to the one entry of the API whose full name is, or ends in, this name; None if there is none, or several."""
    domain = env.domains["py"]
    assert isinstance(domain, PythonDomain)
    name = name.removeprefix("segar.") if name.count(".") == 1 and name.startswith("segar.") else name
    full = [known for known in domain.objects if known == name or known.endswith(f".{name}")]
    full = [known for known in full if known.rpartition(".")[0] in public_names()] or full  # rather than methods
    entries = {(domain.objects[known].docname, domain.objects[known].node_id) for known in full}
    if len(entries) != 1:
        return None
    ((docname, anchor),) = entries
    return make_refnode(app.builder, page, docname, anchor, [text])
