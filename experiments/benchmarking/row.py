"""A row of the benchmark as data: what a method is, its episodes on each suite with each seed, and what replays them.

A row is a folder. ``row.json`` describes it and holds the hash of every other file; ``episodes.parquet`` has all episodes,
:data:`EPISODES`; ``<suite>-s<seed>.npz`` holds the network that played, or the actions that were taken. Where levels were
played several times, ``levels.parquet`` has the means of each level. A row whose methods can play anything is then played on
levels that follow from all of this, :class:`Drawn`; a row of recorded actions cannot be. A folder may lack files that are
published elsewhere, as those of the repository do: ``segar results fetch`` gets them.
"""

import dataclasses
import hashlib
import json
import re
import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from segar.errors import naming
from segar.experiments.benchmarking.protocol import PLAYERS, PROTOCOL
from segar.experiments.runs.files import make_folder, read_json, read_table, write_bytes, write_parquet, write_text
from segar.experiments.runs.run_folder import differences, write_json
from segar.experiments.runs.trust import settings_of_file
from segar.experiments.settings import RunFolderError
from segar.support import locked, require_form, sha256_of, shown

FORMAT = 1
ROW, TABLE, MEANS, PIECE = "row.json", "episodes.parquet", "levels.parquet", "piece.json"
STAGED = ".new"  # folder of what becomes part of a row, until all of it is written
FETCH = "`segar results fetch` gets what is published"
KINDS = ("player", "networks", "onnx", "actions")
DIGITS = 16  # of hashes
WAIT = 600.0  # [s] for other processes that add pieces, such as the jobs of a cluster
EPISODES = pa.schema(
    [
        ("suite", pa.string()),
        ("seed", pa.int64()),
        ("levels", pa.string()),  # "train", "test", or twins of the test levels: "twin-Mass", "control-place"
        ("level", pa.int64()),  # index in the level set; of a twin, that of its test level
        ("return", pa.float32()),
        ("length", pa.int64()),  # steps
        ("success", pa.bool_()),
        ("death", pa.bool_()),
    ]
)
KEYS = ("suite", "seed")
PLAYED = ("observation", "training_levels")
"""The settings by which episodes are played again."""
DRAWN = (*PLAYED, "policy")
"""The settings by which drawn levels are played."""
TRAINED = (*PLAYED, "algorithm", "curriculum", "determinism", "task", "trials")
"""The settings by which a row is made again; none says where files lie."""
LEVEL = (*KEYS, "levels", "level")
LEVEL_MEANS = pa.schema([*(EPISODES.field(name) for name in (*LEVEL, "return")), ("success", pa.float64())])
LONGEST_NAME = 100
NAME = re.compile(rf"[\w+-][\w .+-]{{0,{LONGEST_NAME - 1}}}")
"""What the names of rows are made of: they name folders, and stand in pages."""
FORM = {
    "format": int,
    "name": str,
    "kind": str,
    "says": str,
    "budget": str,
    "frames": (int, None),
    "settings": dict,
    "pieces": [{"suite": str, "suite_hash": str, "seed": int, "levels": {str: str}, "run": str, "file": str, "bits": int,
                "made_with": int}],
    "made_with": [dict],
    "files": {str: str},
    "drawn?": [{"suite": str, "seed": int, "file": str, "levels": str, "count": int, "solved": int, "random": int,
                "planner": int, "steps": int, "planner_steps": int, "episodes": str, "by_time?": (float, None)}],
    "protocol?": int,
    "means?": str,
    "hash": str,
}  # fmt: skip
RANDOM_PLAYS = 5  # random episodes on each drawn level


@dataclass(frozen=True)
class Piece:
    """One suite with one seed.

    Attributes:
        suite, suite_hash, seed: what was played. levels: the hash of each level set.
        run: the name of the run that was trained; empty where none was.
        file: the network or the actions, in the folder of the row; empty where a player needs none.
        bits: of each weight, where the file is a network, else 0.
        made_with: libraries, commit and arithmetic.
    """

    suite: str
    suite_hash: str
    seed: int
    levels: Mapping[str, str]
    run: str = ""
    file: str = ""
    bits: int = 0
    made_with: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawn:
    """What came of the drawn levels of one suite with one seed.

    Attributes:
        suite, seed: of the piece. file: the whole SHA-256 of its file; empty where there is none.
        levels: the hash of the levels. count: how many there are.
        solved, planner: how many the method solved, and the planner. random: how many of :data:`RANDOM_PLAYS` random episodes
            on each level ended in success.
        steps, planner_steps: in all, on levels that both solved.
        episodes: a hash of the return, length and success of every episode of the method.
        by_time: the sum, over levels that the method solved, of the planner's steps over the method's, at most 1, and 1 where
            the planner failed; None in rows that were drawn without it.
    """

    suite: str
    seed: int
    file: str
    levels: str
    count: int
    solved: int
    random: int
    planner: int
    steps: int
    planner_steps: int
    episodes: str
    by_time: float | None = None

    @property
    def corrected(self) -> float:
        """Success corrected for chance: 0 is that of random play, 1 the planner's."""
        chance = self.random / (self.count * RANDOM_PLAYS)
        return (self.solved / self.count - chance) / (self.planner / self.count - chance)


@dataclass(frozen=True)
class Method:
    """What a row is of.

    Attributes:
        name: of the row. kind: one of :data:`KINDS`. says: what the method is, in a sentence.
        budget: a name in :data:`segar.experiments.benchmarking.protocol.BUDGETS`, or empty. frames: of each training; None
            where nothing is trained here.
        settings: that decide results, as plain data.
    """

    name: str
    kind: str
    says: str
    budget: str = ""
    frames: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """A row, read from its folder, all files of which have their hashes.

    Attributes:
        files: the names of the row's files, and their hashes. lacks: those that the folder has not got.
        means: the hash of the means of levels, which stand in for episodes that the folder lacks; empty where there are none.
        drawn: what came of drawn levels, for each piece; empty where they were not played.
    """

    method: Method
    pieces: tuple[Piece, ...]
    folder: Path
    hash: str
    files: Mapping[str, str] = field(default_factory=dict)
    lacks: frozenset[str] = frozenset()
    means: str = ""
    drawn: tuple[Drawn, ...] = ()

    @property
    def can_be_drawn(self) -> bool:
        """Whether the method plays levels that it has never seen: recorded actions alone cannot."""
        return self.method.kind != "actions" or "policy" in self.method.settings

    def episodes(self) -> pa.Table:
        """All episodes, :data:`EPISODES`, piece after piece; raises :class:`RunFolderError` if the folder lacks them."""
        if TABLE in self.lacks:
            raise RunFolderError(f"{self.folder}: the file {TABLE} is not here; {FETCH}")
        return _checked(self.folder / TABLE, EPISODES, self.pieces)

    def results(self) -> pa.Table:
        """The episodes or, where the folder lacks them, the means of :func:`means_of`."""
        return _checked(self.folder / MEANS, LEVEL_MEANS, self.pieces) if TABLE in self.lacks else self.episodes()

    def trusted_method(self, trusted: Collection[str], names: Collection[str]) -> "Method":
        """The method with the settings of these names alone; raises as :meth:`settings`. What plays is made of no other."""
        return dataclasses.replace(self.method, settings=self.settings(trusted, names))

    def settings(self, trusted: Collection[str], names: Collection[str]) -> Mapping[str, Any]:
        """The settings of the method that have these names, as something may be made of them.

        Raises:
            RunFolderError: they name Python objects of packages that are not ``trusted``; see
                :func:`segar.experiments.runs.trust.settings_of_file`.
        """
        used = {key: value for key, value in self.method.settings.items() if key in names}
        return settings_of_file(self.folder / ROW, {"settings": used}, trusted)["settings"]

    def suites(self) -> tuple[str, ...]:
        """The suites that were played, each once."""
        return tuple(dict.fromkeys(piece.suite for piece in self.pieces))


@dataclass(frozen=True)
class NewPiece:
    """A piece that is to become part of a row, with its episodes and the path of its file, if it has one."""

    piece: Piece
    episodes: pa.Table
    path: Path | None


def read_row(folder: Path) -> Row:
    """The row in a folder.

    Raises:
        RunFolderError: there is none, or a file of it is not what its description says; the message names the file.
    """
    path = folder / ROW
    data = _description(path)
    stated, means = data.pop("hash"), data.pop("means", None)
    if stated != hash_of(data):
        raise RunFolderError(
            f"{path} was edited: its hash is {hash_of(data)}, not {stated}. Make it anew: segar benchmark"
        )
    listed = {**data["files"], **({} if means is None else {MEANS: means})}
    there = {one.name for one in folder.iterdir() if one.is_file() and one.name != ROW}
    for name in sorted(there - {*listed}):
        raise RunFolderError(f"{folder}: the file {name} is not part of the row; move it elsewhere")
    if not there & {TABLE, MEANS}:
        raise RunFolderError(f"{folder}: the file {TABLE} is not here; {FETCH}")
    for name in sorted(there):
        if (found := file_hash(folder / name)) != (known := listed[name]):
            raise RunFolderError(f"{path}: {name} is not what the row was made of: its hash is {found}, not {known}")
    made_with = data["made_with"]
    pieces = tuple(Piece(**{**one, "made_with": made_with[one["made_with"]]}) for one in data["pieces"])
    method = Method(**{one.name: data[one.name] for one in dataclasses.fields(Method)})
    drawn = tuple(Drawn(**one) for one in data.get("drawn", ()))
    _check_drawn(path, data, drawn)
    return Row(method, pieces, folder, stated, data["files"], frozenset(data["files"]) - there, means or "", drawn)


def commitment_of_row(row: Row) -> str:
    """The SHA-256 of what a row is before its levels are drawn: the version of the protocol, the kind of the method and the
    settings that it plays by, and of each piece the suite with its hash, the seed, the SHA-256 of its file (weights, or
    recorded actions), and the code of the user's own that plays it. The row has all of its files, or drawn levels that name
    them."""
    files = {(one.suite, one.seed): one.file for one in row.drawn} or {
        (one.suite, one.seed): sha256_of(row.folder / one.file, "file", RunFolderError) if one.file else ""
        for one in row.pieces
    }
    parts = [
        [one.suite, one.suite_hash, one.seed, files[one.suite, one.seed], one.made_with.get("code", {})]
        for one in row.pieces
    ]
    played = {key: value for key, value in row.method.settings.items() if key in DRAWN}
    player = row.method.name if row.method.kind == "player" else ""
    data = [PROTOCOL, row.method.kind, player, played, parts]
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def _check_drawn(path: Path, data: Mapping[str, Any], drawn: Sequence[Drawn]) -> None:
    """Raises :class:`RunFolderError` where drawn levels are of another protocol, of other pieces, or come to no numbers."""
    if not drawn:
        return
    if data["kind"] == "actions" and "policy" not in data["settings"]:
        raise RunFolderError(f"{path}: drawn: recorded actions, without a policy, are played on no drawn levels")
    if data.get("protocol") != PROTOCOL:
        raise RunFolderError(
            f"{path}: its levels were drawn by protocol {data.get('protocol')}, and this version plays protocol {PROTOCOL};"
            " such numbers do not compare. Make the row again: again=ROW root=FOLDER"
        )
    files = {(one["suite"], one["seed"]): one["file"] for one in data["pieces"]}
    if [*files] != [(one.suite, one.seed) for one in drawn]:
        raise RunFolderError(f"{path}: drawn: it must have the pieces of the row, each once and in their order")
    for one in drawn:
        where = f"{path}: drawn: {one.suite}, seed {one.seed}"
        file = files[one.suite, one.seed]
        if one.file[:DIGITS] != data["files"].get(file, ""):
            raise RunFolderError(f"{where}: its file has the SHA-256 {data['files'].get(file)}..., not {one.file}")
        chance, most = one.random / RANDOM_PLAYS, one.count
        steps = min(one.steps, one.planner_steps)
        by_time = 0 <= (one.by_time or 0) <= one.solved <= most
        if not (by_time and 0 <= chance < one.planner <= most and steps >= 0):
            numbers = f"{one.solved} solved of {most}, random {chance:g}, planner {one.planner}, by time {one.by_time}"
            raise RunFolderError(f"{where}: {numbers} cannot be")


def _checked(path: Path, schema: pa.Schema, pieces: Sequence[Piece]) -> pa.Table:
    """The table of a row; raises :class:`RunFolderError` where columns are others, a number is absent or not finite, or a level
    set of a piece is not there."""
    table = read_table(path, schema=schema)
    if table.schema.names != schema.names:
        raise RunFolderError(f"{path}: it has other columns than {', '.join(schema.names)}")
    for one in schema:
        if pa.types.is_floating(one.type) and not np.isfinite(table[one.name]).all():
            raise RunFolderError(f"{path}: some values in the column '{one.name}' are not finite")
    there = {tuple(one.values()) for one in table.group_by([*KEYS, "levels"]).aggregate([]).to_pylist()}
    stated = {(one.suite, one.seed, name) for one in pieces for name in one.levels}
    tests = {(one.suite, one.seed, "test") for one in pieces}
    for name, seed, levels in sorted(there ^ stated | tests - there):
        which = f"episodes, which {ROW} does not state," if (name, seed, levels) in there else "no episodes"
        raise RunFolderError(f"{path}: there are {which} of {name}, seed {seed}, on its levels '{levels}'")
    return table


def _description(path: Path) -> dict[str, Any]:
    data = read_json(path, FORM, only=True)
    if re.search("[\ud800-\udfff]", json.dumps(data, ensure_ascii=False)):
        raise RunFolderError(f"{path}: a text in it has half of a character of UTF-16, which cannot be written")
    if data["format"] != FORMAT or data["kind"] not in KINDS:
        raise RunFolderError(f"{path}: format {data['format']}, kind '{data['kind']}' is not what this version reads")
    if not NAME.fullmatch(data["name"]):
        raise RunFolderError(f"{path}: name: {shown(data['name'])} must be of letters, digits, spaces and _ . + -")
    if (data["kind"] == "player") != (data["name"] in PLAYERS):
        raise RunFolderError(f"{path}: rows of players alone are called {', '.join(PLAYERS)}; name: {data['name']}")
    with naming(path, RunFolderError):  # libraries may have any version, but files of code have hashes
        require_form(data["made_with"], [{"code?": {str: str}}], "made_with")
    if any(not 0 <= one["made_with"] < len(data["made_with"]) for one in data["pieces"]):
        raise RunFolderError(f"{path}: a piece was made with what made_with does not list")
    if not 0 < len({(one["suite"], one["seed"]) for one in data["pieces"]}) == len(data["pieces"]):
        raise RunFolderError(f"{path}: pieces: there must be some, and each suite with each seed once")
    if any(Path(name).name != name for name in (*data["files"], *(one["file"] for one in data["pieces"]))):
        raise RunFolderError(f"{path}: files lie beside it, in no other folder")
    return data


def add_pieces(folder: Path, method: Method, new: Sequence[NewPiece]) -> Row:
    """The row with further pieces, written; those that it has of the same suite and seed are replaced.

    Raises:
        RunFolderError: the folder holds the row of another method, or cannot be written.
    """
    make_folder(folder)
    with locked(folder.parent, RunFolderError, "start the command again later", WAIT):
        _take(folder)
        before = row_of(folder, method)
        if before is None and (others := {one.name for one in folder.glob("[!.]*")}):
            raise RunFolderError(f"{folder} holds no row but {min(others)}; name another folder: rows=..., or row=...")
        added = {(one.piece.suite, one.piece.seed) for one in new}
        kept = [] if before is None else [one for one in before.pieces if (one.suite, one.seed) not in added]
        pieces = sorted([*kept, *(one.piece for one in new)], key=lambda one: (one.suite, one.seed))
        tables = [] if before is None else [before.episodes()]
        tables = [*(_without(one, added) for one in tables), *(one.episodes.cast(EPISODES) for one in new)]
        staged = folder / STAGED
        shutil.rmtree(staged, ignore_errors=True)  # of a process that was killed before all was there
        for one in new:
            if one.path is not None:
                write_bytes(staged / one.piece.file, one.path.read_bytes())
        episodes = pa.concat_tables(tables).sort_by([(key, "ascending") for key in KEYS])
        write_parquet(staged / TABLE, episodes, "zstd")
        write_means(staged, episodes)
        _write(staged, method, pieces, {} if before is None else before.files)
        _take(folder)
    return read_row(folder)


def _take(folder: Path) -> None:
    """Puts what is staged for a row in its place once all of it is there, the description last."""
    staged = folder / STAGED
    if (staged / ROW).exists():
        for path in sorted(staged.iterdir(), key=lambda one: one.name == ROW):
            path.replace(folder / path.name)
        staged.rmdir()


def write_drawn(row: Row, drawn: Sequence[Drawn]) -> Row:
    """The row with what came of drawn levels, written; raises :class:`RunFolderError` where it has changed meanwhile."""
    with locked(row.folder.parent, RunFolderError, "start the command again later", WAIT):
        if read_row(row.folder) != row:
            raise RunFolderError(f"{row.folder}: the row changed while its levels were played; start the command again")
        _write(row.folder, row.method, row.pieces, row.files, drawn)
    return read_row(row.folder)


def row_of(folder: Path, method: Method) -> Row | None:
    """The row of a method in a folder, None where there is none; raises :class:`RunFolderError` if it is of another method."""
    if not (folder / ROW).exists():
        return None
    row = read_row(folder)
    there, here = ({**vars(one), "name": "", "says": ""} for one in (row.method, method))  # those two may differ
    if difference := next(differences(there, _plain(here)), None):
        raise RunFolderError(f"{folder} is the row of another method: {difference}. Name yours: row=...")
    return row


def _without(episodes: pa.Table, keys: set[tuple[str, int]]) -> pa.Table:
    names = zip(*(episodes[key].to_pylist() for key in KEYS), strict=True)
    return episodes.filter(pa.array([key not in keys for key in names], pa.bool_()))


def means_of(episodes: pa.Table) -> pa.Table:
    """The mean return and the mean success on each level, in the order in which the levels were played."""
    found = (
        episodes.to_pandas().groupby(list(LEVEL), sort=False, dropna=False)[["return", "success"]].mean().reset_index()
    )
    return pa.Table.from_pandas(found, preserve_index=False).replace_schema_metadata(None)


def write_means(folder: Path, episodes: pa.Table) -> None:
    """Writes the means of the levels where some were played several times; such episodes are many."""
    means = means_of(episodes)
    if len(means) < len(episodes):
        write_parquet(folder / MEANS, means, "zstd")


def _write(
    folder: Path, method: Method, pieces: Sequence[Piece], known: Mapping[str, str], drawn: Sequence[Drawn] = ()
) -> None:
    """Writes the description of a row, whose other files are written already.

    Args:
        known: the hashes of files that the folder may lack.
    """
    kept = {TABLE, *(one.file for one in pieces if one.file)}
    texts = [*dict.fromkeys(json.dumps(one.made_with) for one in pieces)]
    listed = [{**dataclasses.asdict(one), "made_with": texts.index(json.dumps(one.made_with))} for one in pieces]
    data = {"format": FORMAT, **dataclasses.asdict(method), "pieces": listed, "made_with": [*map(json.loads, texts)]}
    files = {name: file_hash(folder / name) if (folder / name).exists() else known[name] for name in sorted(kept)}
    if drawn:
        data |= {"drawn": [dataclasses.asdict(one) for one in drawn], "protocol": PROTOCOL}
    data = _plain({**data, "files": files})
    means = {"means": file_hash(folder / MEANS)} if (folder / MEANS).exists() else {}
    write_text(folder / ROW, json.dumps({**data, **means, "hash": hash_of(data)}, indent=1) + "\n")


def _plain(data: Any) -> Any:
    """Data as JSON gives it back."""
    return json.loads(json.dumps(data))


def hash_of(data: Any) -> str:
    """Sixteen digits that are equal for equal plain data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:DIGITS]


def file_hash(path: Path) -> str:
    """Sixteen digits of a file's content."""
    return sha256_of(path, "file", RunFolderError)[:DIGITS]


def write_piece(folder: Path, piece: Piece, episodes: pa.Table) -> None:
    """Writes a piece into a folder of its own, in which its file lies already."""
    write_parquet(folder / TABLE, episodes)
    write_json(folder / PIECE, dataclasses.asdict(piece))


def read_piece(folder: Path) -> NewPiece | None:
    """The piece in a folder of its own; None where there is none."""
    if not (folder / PIECE).exists():
        return None
    piece = Piece(**read_json(folder / PIECE))
    return NewPiece(piece, read_table(folder / TABLE), folder / piece.file if piece.file else None)
