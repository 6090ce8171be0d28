"""A command writes no file under a name that says it is of another kind."""

from pathlib import Path

import pytest

from segar.cli import main


@pytest.mark.parametrize("command", ["sample", "playground", "hardness"])
def test_a_file_has_the_ending_of_its_kind(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        main([command, "empty-easy", "-o", str(tmp_path / "x.txt")])
    assert refused.value.code == 2 and "-o/--output: must end in ." in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
