"""Plays a row again by what its folder holds, and compares every episode to the bit."""

import dataclasses
from collections import Counter
from collections.abc import Callable, Collection, Sequence

import numpy as np
import pyarrow as pa
from scipy import stats

from segar.errors import naming
from segar.experiments.benchmarking.drawn import play_drawn
from segar.experiments.benchmarking.playing import replay
from segar.experiments.benchmarking.protocol import SHIPPED, piece_name
from segar.experiments.benchmarking.row import (
    DRAWN,
    FETCH,
    KEYS,
    PLAYED,
    ROW,
    TABLE,
    Drawn,
    Piece,
    Row,
    commitment_of_row,
    means_of,
    read_row,
)
from segar.experiments.runs.executed_code import differing_parts
from segar.experiments.settings import ConfigError, RunFolderError
from segar.suites import Suite, suite
from segar.support import private_cache_folder

VERIFIED = "verified_rows"  # in the folder of compiled kernels, which belongs to the user alone


def verify(
    row: Row,
    suites: Collection[str] = (),
    seeds: Collection[int] = (),
    say: Callable[[str], None] = lambda line: None,
    trusted: Collection[str] = (),
    salt: str = "",
) -> int:
    """Play the pieces of a row again; returns how many episodes are the same to the bit, which are all.

    Pieces whose network or actions the folder lacks are left out, and ``say`` gets a line that names them. Where the folder has
    the means of levels in place of episodes, means are compared. Drawn levels are drawn and played again, too.

    Args:
        suites, seeds: only these; all where they are empty.
        salt: words for other draws, which the author could not know: ``say`` gets the difference.
        trusted: packages whose code the row may bring in.

    Raises:
        RunFolderError: an episode is another one, levels are others, a suite is another version, or the row names code that
            is not trusted; the message names the first. Or the folder lacks the files of all pieces that are asked for.
    """
    method = row.trusted_method(trusted, PLAYED)
    count, has_means, recorded = 0, TABLE in row.lacks, row.results()
    keys = list(zip(*(recorded[key].to_pylist() for key in KEYS), strict=True))
    chosen = [one for one in row.pieces if (not suites or one.suite in suites) and (not seeds or one.seed in seeds)]
    here = [one for one in chosen if one.file not in row.lacks]
    if left_out := _left_out(row, chosen):
        if not here:
            raise RunFolderError(left_out)
        say(left_out)
    for piece in here:
        of, stated = suite_of(row, piece), recorded.filter([key == (piece.suite, piece.seed) for key in keys])
        with naming(f"{row.folder / ROW}: {piece_name(piece.suite, piece.seed)}", RunFolderError):
            played = replay(method, piece, of, row.folder)
        _require_same(row, piece, stated, means_of(played) if has_means else played)
        count += len(played)
        means = ", by their means on each level" if has_means else ""
        say(
            f"{row.method.name}: {piece_name(piece.suite, piece.seed)}: {len(played)} episodes are equal to the bit{means}"
        )
    drawn = _verify_drawn(row, here, say, trusted, salt)
    if not (suites or seeds or left_out) and (drawn or not row.drawn):
        with open(private_cache_folder() / VERIFIED, "a", encoding="ascii") as file:
            file.write(f"{_content(row)}\n")
    return count + drawn


def _verify_drawn(
    row: Row, pieces: Sequence[Piece], say: Callable[[str], None], trusted: Collection[str], salt: str
) -> int:
    """Draws and plays the levels of pieces again; returns how many episodes are equal."""
    if not row.drawn or ("policy" in row.method.settings and not trusted):
        cause = "its policy is code, which trust=true runs" if row.drawn else "it was played on practice levels alone"
        if salt:
            raise ConfigError(f"salt: the drawn levels of {row.method.name} are not played: {cause}")
        if row.drawn:
            say(f"{row.method.name}: drawn levels are not verified: {cause}")
        return 0
    method = row.trusted_method(trusted, DRAWN)
    commitment, stated = commitment_of_row(row), {(one.suite, one.seed): one for one in row.drawn}
    solved: list[tuple[Drawn, Drawn]] = []
    for piece in pieces:
        name = f"{row.method.name}: {piece_name(piece.suite, piece.seed)}"
        there, path = stated[piece.suite, piece.seed], row.folder / piece.file
        here = play_drawn(method, piece, path, commitment)
        for one in (field.name for field in dataclasses.fields(Drawn)):
            if getattr(there, one) not in (None, getattr(here, one)):
                raise RunFolderError(
                    f"{name}: drawn levels: '{one}' is {getattr(there, one)!r} in the row and {getattr(here, one)!r} when they"
                    " are drawn and played again"
                )
        say(f"{name}: {here.count} episodes on drawn levels are equal to the bit, {here.solved} solved")
        if salt:
            solved.append((here, play_drawn(method, piece, path, commitment, salt)))
    if solved:
        say(f"{row.method.name}: {_difference(solved, salt)}")
    return sum(stated[one.suite, one.seed].count for one in pieces)


def _difference(pairs: Sequence[tuple[Drawn, Drawn]], salt: str) -> str:
    """What the success on drawn levels is above that on levels of a salt, in words."""
    samples = [np.concatenate([np.arange(one.count) < one.solved for one in part]) for part in zip(*pairs, strict=True)]
    first, second = (float(one.mean()) for one in samples)
    with np.errstate(invalid="ignore", divide="ignore"):
        low, high = stats.ttest_ind(*samples, equal_var=False).confidence_interval()
    found = f"success {first:.3f} on drawn levels, {second:.3f} on those of the salt '{salt}', {len(samples[0]):,} levels each"
    return f"{found}: the difference is {first - second:+.3f}" + (
        f" [{low:+.3f}, {high:+.3f}] (95 %, Welch)" if np.isfinite(low) else ""
    )


def is_verified(row: Row) -> bool:
    """Whether this user has verified the whole row, or it is one that comes with SEGAR, which tests verify."""
    shipped, record = SHIPPED / row.method.name / ROW, private_cache_folder() / VERIFIED
    known = record.read_text(encoding="ascii").splitlines() if record.exists() else []
    return _content(row) in known or (shipped.exists() and _content(read_row(shipped.parent)) == _content(row))


def _content(row: Row) -> str:
    """A text that is equal for rows whose results are."""
    return f"{row.hash} {row.means}"


def _left_out(row: Row, chosen: Sequence[Piece]) -> str:
    """Of which seeds the folder lacks the files of how many suites, as a sentence; empty where it has all of them."""
    asked, lacking = (
        Counter(one.seed for one in pieces) for pieces in (chosen, [p for p in chosen if p.file in row.lacks])
    )
    seeds = ", ".join(f"seed {seed} on {number} of {asked[seed]} suites" for seed, number in sorted(lacking.items()))
    return f"{row.method.name}: not in {row.folder} and not verified: {seeds}; {FETCH}" if seeds else ""


def suite_of(row: Row, piece: Piece) -> Suite:
    """The suite that a piece was played on; raises :class:`RunFolderError` where there is none, or another version of it."""
    with naming(row.folder / ROW, RunFolderError):
        of = suite(piece.suite)
    if of.hash != piece.suite_hash:
        raise RunFolderError(
            f"{row.folder / ROW}: it was played on {piece.suite} with the hash {piece.suite_hash}, and the suite of this"
            f" name has {of.hash} here"
        )
    return of


def _require_same(row: Row, piece: Piece, stated: pa.Table, played: pa.Table) -> None:
    """Raises :class:`RunFolderError` for the first episode in which two tables differ."""
    name = f"{row.method.name}: {piece_name(piece.suite, piece.seed)}"
    if len(stated) != len(played):
        raise RunFolderError(f"{name}: the row has {len(stated)} episodes, and {len(played)} were played")
    for column in (one for one in stated.column_names if one not in KEYS):
        there, here = (np.asarray(table[column].to_pylist()) for table in (stated, played))
        wrong = np.flatnonzero(there != here)
        if len(wrong):
            i = int(wrong[0])
            changed = differing_parts(piece.made_with.get("code", {}), {})
            cause = f"; changed since it was made: {', '.join(changed)}" if changed else ""
            where = f"{stated['levels'][i]} level {stated['level'][i]}"
            raise RunFolderError(
                f"{name}: the {column} of the episode on {where} is {there[i].item()!r} in the row and {here[i].item()!r} when"
                f" it is played; {len(wrong)} of {len(stated)} episodes differ{cause}"
            )
