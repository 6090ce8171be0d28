"""A page: one file with worlds, levels and the program that plays them, which a browser opens without a network."""

import base64
import gzip
import html
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from segar.errors import LevelError, SegarError
from segar.language import Task
from segar.levels import Levels
from segar.observations import Observation, trained_on
from segar.playground.modules import Blobs
from segar.playground.objective import described_objective
from segar.playground.policy import Weights, described_policy
from segar.playground.world import described_baselines, described_set, name_of
from segar.policies import Network, NetworkPolicy
from segar.rendering import SIGNS
from segar.support import __version__, replacing
from segar.tasks import task_of

STATIC = Path(__file__).parent / "static"
MOST_LEVELS = 2000  # of a set, in a page
OF_TWO_SETS = ("measures.js", "panel_design.js", "transport.js")  # scripts that a page of one set lacks
OF_THE_STUDIO = ("panel_studio.js",)  # that a page in a file lacks
OF_A_MATCH = ("match.js",)  # that a page without one lacks
DOCUMENTATION = re.compile(r"^[ \t]*/\*\*.*?\*/[ \t]*\n", re.MULTILINE | re.DOTALL)  # of a script, in lines of its own
HEIGHT = 720  # [px] of a page in a notebook


@dataclass(frozen=True)
class Playground:
    """A page that plays levels; a notebook shows it where it is the last value of a cell.

    Attributes:
        html: the whole page. It asks the network for nothing.
        title: of the page.
    """

    html: str
    title: str

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page to ``path``. An existing file is replaced only by a complete one.

        Raises:
            SegarError: the file cannot be written.
        """
        with replacing(Path(path), "the page") as beside:
            beside.write_text(self.html, encoding="utf-8")

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="{html.escape(self.title)}" srcdoc="{html.escape(self.html)}" allow="fullscreen"'
            f' style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<Playground '{self.title}', {len(self.html) / 1000:.0f} kB>"


def make_playground(
    levels: Levels,
    test: Levels | None = None,
    *,
    task: Task | None = None,
    observations: Sequence[str | Observation] | Mapping[str, str | Observation] = ("rgb",),
    policy: Network | NetworkPolicy | None = None,
    weights: Weights = "float32",
    probes: Mapping[str, tuple[float, float, float]] | None = None,
    plans: bool = False,
    title: str | None = None,
    test_observations: Mapping[str, str | Observation] | None = None,
    match: str | None = None,
    studio: Mapping[str, Any] | None = None,
) -> Playground:
    """The page that plays these levels.

    Args:
        levels: at most 2,000. Observations show all levels in the units of these, as a policy trained on them needs it.
        test: levels of another distribution, beside which the first ones are shown as training levels.
        task: what is played; the one that the levels name where it is None.
        observations: what agents see, shown beside the arena, each one array; a policy reads the first one. A mapping says
            what the page calls them.
        policy: plays at a touch of a button, with the actions of :class:`segar.policies.NetworkPolicy`, to the bit; those
            without noise where a network is given.
        weights: of the policy, as "float32"; or as "float16" or "float8", which make the page smaller: it then plays
            ``policy.network.in_float16()`` or ``policy.network.in_float8()``.
        probes: what is known of the factors in what the policy's encoder gives, as :class:`RunPolicy` has it; shown as bars.
        plans: whether the page holds the planner's episodes, and the baselines of scores. They are found now by
            :func:`segar.evaluation.find_baselines`, in about 0.1 s per level.
        title: of the page; the levels' name where it is None.
        test_observations: what agents see of the test levels, where that differs, such as other textures.
        match: what the test changes, in a sentence. The page then opens as a match: a person plays five levels of each set
            beside the agent, and sees both gaps and the planner's. It needs test levels, a policy and plans.
        studio: what the server of ``segar studio`` tells its page. Such a page may ask its server, and no other one.

    Raises:
        LevelError: there are too many levels.
        SegarError: a rule or an observation has no form in WebAssembly, or the policy reads other observations, has other
            actions, or has weights that 16 bits do not hold; or a match lacks a part.
    """
    if match is not None and (test is None or policy is None or not plans):
        raise SegarError("a match needs test levels, a policy and plans; give test=, policy= and plans=True")
    if isinstance(observations, str) or not observations:
        raise SegarError(f"observations must be a sequence of at least one, such as ('rgb',), not {observations!r}")
    for part in (levels, test):
        if part is not None:
            _require_levels(part)
    title = (title or levels.provenance.name or "levels made by hand").encode(errors="replace").decode()
    blobs = Blobs()
    named = observations.items() if isinstance(observations, Mapping) else [(name_of(one), one) for one in observations]
    sets = []
    for part, name, seen in (
        (levels, "train" if test is not None else "levels", named),
        (test, "test", named if test_observations is None else test_observations.items()),
    ):
        if part is not None:
            shown = [(known, trained_on(one, levels)) for known, one in seen]
            sets.append(described_set(part, task, shown, name, blobs))
            if plans:
                sets[-1]["baselines"] = described_baselines(part, task or task_of(part), blobs)
    about: dict[str, Any] = {"title": title, "segar": __version__, "sets": sets, "signs": SIGNS}
    if policy is not None:
        about["policy"] = described_policy(policy, sets, weights, blobs)
        about["policy"]["probes"] = [[name, *numbers] for name, numbers in (probes or {}).items()]
    if test is not None:
        about["objective"] = described_objective(levels, test)
    if match is not None:
        about["match"] = match
    if studio is not None:
        about["studio"] = dict(studio)
    return Playground(_page(title, about, blobs), title)


def as_text(data: bytes) -> str:
    """Bytes as text that may stand in a page: base 85, in which a comma stands for the character that begins tags."""
    return base64.b85encode(data, pad=True).decode().replace("<", ",")


def _require_levels(levels: Levels) -> None:
    """Raise :class:`LevelError` unless these are levels that a page holds."""
    if not isinstance(levels, Levels):
        raise LevelError(f"a page plays segar.Levels, not {type(levels).__name__}; sample a distribution: .sample(100)")
    if len(levels) > MOST_LEVELS:
        raise LevelError(
            f"a page holds at most {MOST_LEVELS:,} levels of a set, and these are {len(levels):,}; take some of them, such as"
            " levels[:100] (segar playground -n 100)"
        )


def _page(title: str, about: dict[str, Any], blobs: Blobs) -> str:
    """The template with its style, its program and its data in it."""
    parts_of = {"objective": OF_TWO_SETS, "studio": OF_THE_STUDIO, "match": OF_A_MATCH}
    left_out = [name for part, names in parts_of.items() if part not in about for name in names]
    scripts = [path for path in sorted(STATIC.glob("*.js")) if path.name not in left_out]
    # Without their documentation, which is a seventh of them.
    programs = {path.name: DOCUMENTATION.sub("", path.read_text(encoding="utf-8")) for path in scripts}
    about["scripts"] = {name: blobs.add(program.encode()) for name, program in programs.items()}
    data, about["blobs"] = blobs.laid_out()
    head = json.dumps(about, separators=(",", ":"), allow_nan=False).encode()
    head += b" " * (-len(head) % 8)
    packed = gzip.compress(len(head).to_bytes(8, "little") + head + data, 9, mtime=0)
    page = (STATIC / "page.html").read_text(encoding="utf-8")
    style = (STATIC / "page.css").read_text(encoding="utf-8")
    parts = {"TITLE": html.escape(title), "STYLE": style, "DATA": as_text(len(packed).to_bytes(4, "big") + packed)}
    parts["CONNECT"] = "; connect-src 'self'" if "studio" in about else ""
    for name, text in parts.items():
        marked = f"<!--{name}-->"
        if page.count(marked) != 1:
            raise SegarError(f"{STATIC / 'page.html'} must hold {marked} once; install SEGAR again")
        page = page.replace(marked, text)
    return page
