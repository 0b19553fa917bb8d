"""A command line that is interrupted while it loads says so in one line."""

import pytest

from erm.common.launch import INTERRUPTED, launch


@pytest.fixture
def module(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)

    def write(name: str, text: str) -> str:
        (tmp_path / f"{name}.py").write_text(text)
        return name

    return write


def test_ctrl_c_during_an_import_is_one_line_and_130(module, capsys):
    with pytest.raises(SystemExit) as stop:
        launch(module("interrupted_import", "raise KeyboardInterrupt"))
    assert stop.value.code == INTERRUPTED
    assert capsys.readouterr().err == "interrupted; nothing was done\n"


def test_what_was_loaded_runs(module, capsys):
    launch(module("loaded_import", "def main():\n    print('ran')\n"))
    assert capsys.readouterr().out == "ran\n"
