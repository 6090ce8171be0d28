"""Odd calls of the command end with one line that says what is wrong, an exit status, and no traceback."""

import errno
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import segar
from segar import cli

MODULES = {
    "bad": "import nothing_there\n",
    "syntax": "def (\n",
    "raises": "1 / 0\n",
    "number": "x = 3\ndef boom():\n    raise OSError('no')\ndef needs(a):\n    return a\n",
}
# What is called, and what the message names.
CALLS = """
                                             | required
--nope                                       | required
nope                                         | 'nope'
sample                                       | family
sample objectx3-hard -o a.npz                | no level family 'objectx3-hard'. Did you mean 'objectsx3-hard'?
sample place-few-v1 -o a.npz                 | The suite place-few-v1 has levels of its own: `segar suites
sample place-fw-v1 -o a.npz                  | 'place-fw-v1' is no level family. The suite place-few-v1
sample empty-easy -o                         | output
sample empty-easy -o ''                      | empty
sample empty-easy -o .                       | folder
sample empty-easy -o link                    | folder
sample empty-easy -o file/a.npz              | file/a.npz
sample empty-easy -o missing/a.npz           | levels cannot be written to missing/a.npz
hardness empty-easy -o x.txt                 | -o/--output: must end in .
playground empty-easy -o x.txt               | -o/--output: must end in .
sample empty-easy -o x.txt                   | -o/--output: must end in .
sample empty-easy -o /dev/full               | device
sample empty-easy -o /proc/x.npz             | /proc/x.npz
sample empty-easy -n 0 -o a.npz              | '0'
sample empty-easy -n 10000000000 -o a.npz    | 10000000000
sample empty-easy --seed -1 -o a.npz         | '-1'
sample '' -o a.npz                           | no level family
sample Empty-Easy -o a.npz                   | empty-easy
distance file file                           | file
distance ok.npz text.npz                     | text.npz is not a level file
distance ok.npz nothing.npz                  | there is no level file nothing.npz
distance ok.npz empty-hard                   | sample it first: segar sample empty-hard -o levels.npz
distance ok.npz ok.npz --mode nope           | nope
distance ok.npz ok.npz --resamples 1         | '1'
distance '' ''                               | level file
hardness nope.npz                            | there is no level file nope.npz
hardness lab.py:gale                         | sample it first: segar sample lab.py:gale -o levels.npz
hardness ok.npz --task putput                | no task is called 'putput'. Did you mean 'puttputt'?
hardness ok.npz --task os:sep                | 'os:sep' is no segar.Task, nor a function that makes one
hardness ok.npz --task billiards             | choose the task that these levels are for
hardness ok.npz --world no_such:world        | 'no_such:world' cannot be imported: No module named
hardness ok.npz --plays 0                    | '0'
hardness ok.npz --samples 1                  | '1'
hardness ok.npz --iterations 0               | '0'
hardness ok.npz --threads 100000000          | 100000000
hardness ok.npz --seed 1.5                   | '1.5'
kernel show segar:World                      | 'segar:World' is not a LevelDistribution but <class
gallery -o x.jpg                             | x.jpg
gallery --signs -o x.PDF                     | x.PDF
describe empty-easy -o x.pgn                 | png, pdf or svg, not 'x.pgn'. Did you mean '.png'?
record empty-easy -o x.mp3                   | x.mp3
record empty-easy -o x.npz                   | x.npz
record empty-easy -o file/below              | file/below
record empty-easy -o folder                  | folder
record empty-easy -o ../x-v0                 | ../x-v0
record empty-easy -o /dev/full               | /dev/full
record empty-easy -o d --episodes 0          | '0'
record empty-easy -o d --batch 0             | '0'
record empty-easy -o d --policy nope         | nope
record empty-easy -o d --observation nope    | nope
record empty-easy -o d --task nope           | nope
record empty-easy -o x.mp4 --check           | --check
record empty-easy -o x.mp4 --size 65         | 65
lab nope                                     | nope
lab serve --budget 0                         | '0'
lab serve --family nope                      | nope
lab serve --world nope                       | nope
lab serve --world segar:DEFAULT_RULES        | rule space
lab serve --noise -1                         | noise
lab serve --session ok.npz                   | ok.npz
lab baselines --baselines nope -o g.csv      | nope
lab baselines -o file                        | file
lab figure nope.csv -o f.png                 | nope.csv
lab figure ok.npz -o f.png                   | ok.npz
play empty-easy --size 1                     | '1'
play empty-easy --steps 0                    | '0'
"""
LINES = [line.rsplit(" | ", 1) for line in CALLS.strip("\n").splitlines()]
TABLE = [(shlex.split(call), named.strip()) for call, named in LINES]
OWN = (  # commands that take an object of the user's
    "sample {} -o a.npz",
    "describe {}",
    "compile {}",
    "kernel show {}",
    "distance ok.npz ok.npz --world {}",
    "hardness ok.npz --task {}",
    "lab baselines --family {} -o q.csv",
)
NAMES = {
    ".:x": "module:attribute",
    "..:x": "module:attribute",
    ":x": "module:attribute",
    "x:": "module:attribute",
    "a..b:x": "module:attribute",
    "nothing_there:x": "No module named",
    "bad:x": "No module named",
    "syntax:x": r"SyntaxError: invalid syntax",
    "raises:x": "ZeroDivisionError: division by zero (raises.py:1)",
    "number:y": "'number' has no 'y'",
    "number:x": "number:x",
    "number:x.y.z": "has no 'y'",
    "number:boom": "OSError: no (number.py:3)",
    "number:needs": "missing a required argument: 'a'",
}
# Each command with one wrong name, and the first with every one.
WRONG = [(OWN[0], *one) for one in NAMES.items()] + [(form, *next(iter(NAMES.items()))) for form in OWN[1:]]
TABLE += [(shlex.split(form.format(name)), said) for form, name, said in WRONG]


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A working directory with files of some kinds."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    for name, text in MODULES.items():
        Path(f"{name}.py").write_text(text)
    Path("file").write_text("years of work")
    Path("text.npz").write_text("no archive")
    Path("folder").mkdir()
    Path("folder/other.txt").write_text("years of work")
    Path("link").symlink_to("folder")
    segar.family("empty-easy").sample(3).save("ok.npz")
    yield tmp_path
    for name in MODULES:
        sys.modules.pop(name, None)


def outcome(arguments: list[str]) -> int | str | None:
    try:
        return cli.main(arguments)
    except SystemExit as end:  # argparse's
        return end.code


@pytest.mark.parametrize(("arguments", "named"), TABLE, ids=[" ".join(arguments) for arguments, _ in TABLE])
def test_an_odd_call_ends_with_one_line_that_names_the_culprit(place, capsys, arguments, named):
    before = {path.name for path in place.iterdir()}
    assert outcome(arguments) == cli.USAGE_ERROR
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("segar") and named in line and "Traceback" not in line
    assert {path.name for path in place.iterdir()} - before <= {"__pycache__"}
    assert Path("file").read_text() == "years of work" and Path("folder/other.txt").read_text() == "years of work"


@pytest.mark.parametrize(
    ("raised", "status", "said"),
    [
        (KeyboardInterrupt(), 130, "segar: stopped; what was finished before is kept"),
        (MemoryError("Unable to allocate 9 TiB"), 1, "segar: there is not enough memory (Unable to allocate 9 TiB)"),
        (OSError(errno.ENOSPC, "No space left on device", "k.nbi"), 1, "segar: k.nbi: No space left on device"),
    ],
    ids=["Ctrl-C", "memory", "disk"],
)
@pytest.mark.parametrize(
    "command", ["compile empty-easy", "record empty-easy -o odd/call-v0 --observation state --episodes 1"]
)
def test_what_the_machine_or_the_user_refuses_is_one_line(place, capsys, monkeypatch, command, raised, status, said):
    def refuse(*arguments, **options):
        raise raised

    monkeypatch.setattr("segar.engine.simulator.Simulator.act", refuse)
    monkeypatch.setattr("segar.envs.vector.VectorEnv.reset", refuse)
    assert outcome(shlex.split(command)) == status
    assert capsys.readouterr().err.startswith(said)


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_what_the_caller_closed_leads_nowhere_and_no_file_takes_its_place(tmp_path, closed):
    code = "import segar.cli; end = segar.cli.main(['families']); exit(end or open('a', 'w').fileno() < 3)"
    subprocess.run(f"{shlex.join([sys.executable, '-c', code])} {closed}", shell=True, cwd=tmp_path, check=True)


def test_a_working_folder_that_is_gone_is_told(tmp_path):
    command = f"rmdir {tmp_path} && {shlex.join([sys.executable, '-m', 'segar', 'families'])}"
    told = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True)
    assert (told.returncode, told.stdout) == (1, "")
    assert told.stderr.startswith("segar: the working folder") and len(told.stderr.splitlines()) == 1
