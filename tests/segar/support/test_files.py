"""Files are replaced as a whole: through links, with the permissions that they had, and never what is no file."""

import os
import signal
import socket
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from segar.errors import SegarError
from segar.support import UNFINISHED, locked, read_table, remove_unfinished, replacing


def write(path: Path, text: str) -> None:
    with replacing(path, "the text") as beside:
        beside.write_text(text)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_link_stays_and_the_file_that_it_leads_to_is_replaced(tmp_path):
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "blob").write_text("old")
    (tmp_path / "middle").symlink_to(Path("store") / "blob")
    (tmp_path / "link.txt").symlink_to("middle")
    with replacing(tmp_path / "link.txt", "the text") as beside:
        assert beside.suffix == ".txt"  # what writes it chooses the format by it
        beside.write_text("new")
    assert (tmp_path / "link.txt").is_symlink() and (tmp_path / "middle").is_symlink()
    assert (tmp_path / "store" / "blob").read_text() == "new" and not (tmp_path / "store" / "blob").is_symlink()
    assert names(tmp_path) == {"store", "middle", "link.txt"} and names(tmp_path / "store") == {"blob"}


def test_a_link_that_leads_nowhere_yet_leads_to_the_new_file(tmp_path):
    (tmp_path / "link").symlink_to("target")
    write(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "target").read_text() == "new"


@pytest.mark.parametrize("bits", [0o600, 0o640, 0o644, 0o400, 0o755])
def test_a_file_keeps_its_permissions(tmp_path, bits):
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(bits)
    with replacing(path, "the text") as beside:
        assert mode(beside) & ~bits & 0o077 == 0  # nobody reads in the meantime what nobody may read
        beside.write_text("new")
    assert path.read_text() == "new" and mode(path) == bits


def test_a_new_file_has_the_permissions_that_all_new_files_have(tmp_path):
    write(tmp_path / "file", "new")
    (tmp_path / "other").touch()
    assert mode(tmp_path / "file") == mode(tmp_path / "other")


def device(path: Path) -> None:
    if os.geteuid():
        pytest.skip("only root makes devices")
    os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 7))  # as /dev/full


def listening(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


@pytest.mark.parametrize(
    ("make", "kind"),
    [(Path.mkdir, "a folder"), (os.mkfifo, "a pipe"), (listening, "a socket"), (device, "a device")],
    ids=["folder", "pipe", "socket", "device"],
)
@pytest.mark.parametrize("through_link", [False, True])
def test_what_is_no_file_is_refused_and_stays(tmp_path, monkeypatch, make, kind, through_link):
    monkeypatch.chdir(tmp_path)  # addresses of sockets are short
    make(Path("it"))
    before = os.stat("it")
    if through_link:
        Path("link").symlink_to("it")
    path = Path("link" if through_link else "it")
    with pytest.raises(SegarError, match=f"the text cannot be written to {path}: it is {kind} and no file"):
        write(path, "new")
    assert (os.stat("it").st_mode, os.stat("it").st_ino, os.stat("it").st_rdev) == (
        before.st_mode, before.st_ino, before.st_rdev,
    )  # fmt: skip
    assert names(tmp_path) <= {"it", "link"}


@pytest.mark.parametrize("path", ["", ".", "loop", "file/below", "missing/file", "x" * 300])
def test_a_place_that_cannot_be_written_is_named(tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    Path("loop").symlink_to("loop")
    with pytest.raises(SegarError, match=r"the text cannot be written to .*; (name a file|nothing was changed)"):
        write(Path(path), "new")
    assert names(tmp_path) == {"file", "loop"}


def test_a_long_name_can_be_replaced(tmp_path):
    path = tmp_path / f"{'x' * 250}.npz"
    write(path, "new")
    assert path.read_text() == "new"


WRITER = """
import sys, time
from pathlib import Path
from segar.support import replacing
with replacing(Path(sys.argv[1]), "the text") as beside:
    beside.write_text("half")
    Path(f"{beside}-journal").write_text("of a database")
    print("writing", flush=True)
    time.sleep(60)
"""


def test_the_next_writer_removes_what_a_killed_one_left_and_nothing_that_a_living_one_writes(tmp_path):
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, tmp_path / name], stdout=subprocess.PIPE)
        for name in ("living", "killed")
    ]
    try:
        for writer in writers:
            assert writer.stdout is not None and writer.stdout.readline() == b"writing\n"
        assert len(names(tmp_path)) == 4
        writers[1].send_signal(signal.SIGKILL)
        writers[1].wait()
        write(tmp_path / "another", "whole")
        left = names(tmp_path) - {"another"}
        assert len(left) == 2 and all(name.startswith(UNFINISHED) for name in left)
        remove_unfinished(tmp_path)
        assert names(tmp_path) - {"another"} == left
    finally:
        for writer in writers:
            writer.kill()
            writer.communicate()
    remove_unfinished(tmp_path)
    assert names(tmp_path) == {"another"}


def test_a_block_that_fails_leaves_what_was_there(tmp_path):
    (tmp_path / "file").write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "file", "the text") as beside:
        beside.write_text("half")
        raise KeyboardInterrupt
    assert (tmp_path / "file").read_text() == "old" and names(tmp_path) == {"file"}


def test_a_locked_folder_keeps_others_out(tmp_path):
    refused = pytest.raises(SegarError, match=r"another process is at work in .*; come later")
    with locked(tmp_path, SegarError, "come later"), refused, locked(tmp_path, SegarError, "come later"):
        pass
    with locked(tmp_path, SegarError, "come later"):
        pass
    (tmp_path / "file").touch()
    refused = pytest.raises(SegarError, match=r"cannot use the folder .*file: ")
    with refused, locked(tmp_path / "file", SegarError, "come later"):
        pass


def test_a_small_table_that_stands_for_much_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "1")
    path, numbers = tmp_path / "bomb.parquet", np.zeros(200_000)
    repeated = pa.DictionaryArray.from_arrays(pa.array([0] * 4000, pa.int32()), pa.array(["x" * 100_000]))
    lists = pa.ListArray.from_arrays([0, len(numbers)], pa.array(numbers))
    for table, says in (
        (pa.table({"algorithm": repeated, "seed": range(4000)}), "more than 1,000,000"),
        (pa.table({"seed": numbers}), "would expand to 1,6.*SEGAR_FILE_LIMIT"),
        (pa.table({"values": lists}), "would expand to 1,6"),
    ):
        pq.write_table(table, path, compression="zstd", store_schema=False)
        with pytest.raises(SegarError, match=f"bomb.parquet.*{says}"):
            read_table(path, "table", SegarError)


def test_a_size_below_0_in_the_footer_of_a_table_makes_no_room_for_what_another_column_expands_to(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("SEGAR_FILE_LIMIT", "1")
    path, numbers = tmp_path / "bomb.parquet", pa.array(np.zeros(200_000))
    table = pa.table({"values": pa.ListArray.from_arrays([0, len(numbers)], numbers), "noise": [os.urandom(4_000_000)]})
    pq.write_table(table, path, compression="none", use_dictionary=["values.list.element"], write_statistics=False)
    content = bytearray(path.read_bytes())
    stated, digits = 2 * pq.ParquetFile(path).metadata.row_group(0).column(1).total_uncompressed_size, bytearray()
    while stated:
        digits.append(stated & 127 | (128 if stated > 127 else 0))
        stated >>= 7
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    content[content.index(digits, footer)] |= 1  # the last bit is the sign
    path.write_bytes(content)
    assert pq.ParquetFile(path).metadata.row_group(0).column(1).total_uncompressed_size < -4_000_000
    with pytest.raises(SegarError, match=r"bomb.parquet.*would expand to 1,6"):
        read_table(path, "table", SegarError, ["values"])
