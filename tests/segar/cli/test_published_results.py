"""``segar results``: published files are fetched whole, checked, and from an address that the user names."""

import contextlib
import functools
import http.server
import json
import threading
from pathlib import Path

import pytest

from segar.cli import main
from segar.errors import SegarError
from segar.support import ADDRESS, MANIFEST, RESULTS, read_manifest, sha256_of

FILES = {"benchmark/mine/a-v1-s2.npz": b"weights", "standard/report.html": b"<p>page</p>"}


@pytest.fixture
def published(tmp_path):
    """What an address serves."""
    for name, content in FILES.items():
        (tmp_path / "served" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "served" / name).write_bytes(content)
    return tmp_path / "served"


@pytest.fixture
def folder(published, tmp_path, monkeypatch):
    """A folder of results with a manifest and none of its files, beside an address that is a folder."""
    lines = [
        f"{name},{len(FILES[name])},{sha256_of(published / name, 'file', SegarError)},make {name}\n" for name in FILES
    ]
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / MANIFEST).write_text("path,bytes,sha256,made_by\n" + "".join(lines))
    monkeypatch.setenv(ADDRESS, published.as_uri())
    return tmp_path / "results"


@pytest.fixture
def server(published):
    """An address on loopback."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=published)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{made.server_port}"
        made.shutdown()
        thread.join()


def call(*arguments, folder):
    return main(["results", *arguments, "--folder", str(folder)])


def files_in(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_files_come_from_a_folder_and_are_not_fetched_again(folder, capsys):
    assert call("fetch", "--json", folder=folder) == 0
    assert json.loads(capsys.readouterr().out) == {"fetched": [*FILES]}
    assert {name: (folder / name).read_bytes() for name in FILES} == FILES
    assert call("fetch", "--json", folder=folder) == 0
    assert json.loads(capsys.readouterr().out) == {"fetched": []}


def test_a_part_can_be_named(folder, capsys):
    assert call("fetch", "benchmark/mine", folder=folder) == 0
    assert files_in(folder) == {MANIFEST, "benchmark/mine/a-v1-s2.npz"}
    assert call("fetch", "benchmark/mime", folder=folder) == 2
    said = "no published file is benchmark/mime or lies in it. Did you mean 'benchmark/mine'?"
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"WEIGHTS", b"", b"weights and more"])
def test_a_file_that_is_another_one_is_refused_and_not_kept(folder, published, content, capsys):
    (published / "benchmark/mine/a-v1-s2.npz").write_bytes(content)
    assert call("fetch", "benchmark", folder=folder) == 2
    assert "a-v1-s2.npz is not the published file" in capsys.readouterr().err
    assert files_in(folder) == {MANIFEST} and not list(folder.glob(".unfinished-*"))


def test_files_come_from_a_server_and_what_is_not_there_is_named_with_the_command_that_makes_it(
    folder, published, server, monkeypatch, capsys
):
    (published / "standard/report.html").unlink()
    for address in (published.as_uri(), server):
        monkeypatch.setenv(ADDRESS, address)
        assert call("fetch", "standard", folder=folder) == 2
        error = capsys.readouterr().err
        assert f"{address}/standard/report.html cannot be got" in error and "make standard/report.html" in error
    assert files_in(folder) == {MANIFEST}
    (published / "standard/report.html").write_bytes(FILES["standard/report.html"])
    assert call("fetch", folder=folder) == 0
    assert {name: (folder / name).read_bytes() for name in FILES} == FILES


class Endless(http.server.BaseHTTPRequestHandler):
    """Sends zeros until its client hangs up; of other files, leads to an address that is none."""

    sent = 0

    def do_GET(self):
        self.send_response(200 if self.path.startswith("/benchmark") else 302)
        self.send_header("Location", "http://[none")
        self.end_headers()
        with contextlib.suppress(OSError):
            while self.path.startswith("/benchmark") and Endless.sent < 2**30:
                Endless.sent += self.wfile.write(bytes(2**20))


def test_of_a_server_that_sends_without_end_or_leads_nowhere_no_more_is_read_than_the_file_has(
    folder, monkeypatch, capsys
):
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Endless) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        monkeypatch.setenv(ADDRESS, f"http://127.0.0.1:{made.server_port}")
        assert call("fetch", "benchmark", folder=folder) == 2 and Endless.sent < 2**27
        assert "is not the published file of 7 bytes" in capsys.readouterr().err
        assert call("fetch", "standard", folder=folder) == 2
        assert "cannot be got (" in capsys.readouterr().err
        made.shutdown()
        thread.join()
    assert files_in(folder) == {MANIFEST}


def test_a_file_that_has_another_size_than_the_manifest_says_is_not_fetched(folder, capsys):
    text = (folder / MANIFEST).read_text()
    (folder / MANIFEST).write_text(text.replace("npz,7,", "npz,6,"))
    assert call("fetch", "benchmark", folder=folder) == 2
    assert "is not the published file of 6 bytes" in capsys.readouterr().err and files_in(folder) == {MANIFEST}


@pytest.mark.parametrize("address", [None, "", "/a/folder", "ftp://host", "http:host", "http//["])
def test_without_an_address_the_command_says_what_is_missing(folder, address, monkeypatch, capsys):
    monkeypatch.delenv(ADDRESS) if address is None else monkeypatch.setenv(ADDRESS, address)
    assert call("fetch", folder=folder) == 2
    error = capsys.readouterr().err
    assert ADDRESS in error and "file:///folder" in error and "make benchmark/mine" in error


def test_a_file_of_ones_own_is_not_overwritten(folder, capsys):
    (folder / "standard").mkdir()
    (folder / "standard/report.html").write_text("mine")
    assert call("fetch", folder=folder) == 2
    assert "is another file than the published one" in capsys.readouterr().err
    assert (folder / "standard/report.html").read_text() == "mine"
    assert call("record", "standard", folder=folder) == 0 and call("fetch", folder=folder) == 0
    assert (folder / "standard/report.html").read_text() == "mine"


def test_the_list_says_what_is_here_and_what_makes_the_rest(folder, capsys):
    call("fetch", "benchmark", folder=folder)
    capsys.readouterr()
    assert call("list", folder=folder) == 0
    first, mine, page = capsys.readouterr().out.splitlines()
    assert first.split()[:3] == ["path", "bytes", "here"]
    assert "yes" in mine and "no" in page and "make standard/report.html" in page


@pytest.mark.parametrize(
    "line",
    [
        "../x,1,00,make x",
        "x,one,00,make x",
        "x,²,00,make x",
        "x,1,00",
        "/x,1,00,make x",
        "x\0,1,00,make x",
        f"x,{'9' * 5000},00,make x",
        "x,1,00,make \x1b[31mx",
    ],
    ids=["outside", "size", "odd size", "short", "absolute", "null", "long size", "colours"],
)
def test_a_manifest_that_is_none_is_refused_with_its_line(folder, line):
    (folder / MANIFEST).write_text(f"path,bytes,sha256,made_by\n{line}\n")
    with pytest.raises(SegarError, match=f"{MANIFEST}.*line 2"):
        read_manifest(folder)


@pytest.mark.results
def test_what_is_in_git_is_small_and_what_is_not_is_in_the_manifest():
    shipped = {one.path for one in read_manifest(RESULTS)}
    here = [path for path in RESULTS.rglob("*") if path.is_file() and str(path.relative_to(RESULTS)) not in shipped]
    assert sum(path.stat().st_size for path in here) <= 20e6
    assert not [path for path in here if path.suffix in (".pdf", ".html")]
    assert not any(Path(name).is_absolute() for name in shipped)
