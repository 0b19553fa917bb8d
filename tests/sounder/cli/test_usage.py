"""Wrong usage, files that are not there, and help."""

import subprocess
import sys
from importlib.metadata import version

import pytest

from .commands import names, run


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["process"],
        ["process", "x.h5"],
        ["process", "x.h5", "--out", "y", "--averaging", "median"],
        ["process", "x.h5", "--out", "y", "--unknown"],
        ["figures", "x.h5", "--overlay", "--out", "y"],
        ["predict"],
    ],
)
def test_wrong_usage_is_2(arguments, capsys):
    assert run(*arguments) == 2


@pytest.mark.parametrize("command", ["info", "simulate", "convert"])
def test_a_missing_file_is_one_line_and_1(tmp_path, command, capsys):
    out = () if command == "info" else ("--out", tmp_path / "out")
    assert run(command, tmp_path / "absent", *out) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{tmp_path / 'absent'}: ")
    assert names(tmp_path) == []


def test_version_is_reported(capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out == f"sounder-to-map {version('sounder-to-map')}\n"


def test_help_says_what_each_command_is_for_in_a_line(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert run("--help") == 0
    shown = capsys.readouterr().out
    assert "Process raw captures of a radio channel sounder." in shown
    assert "..." not in shown.partition("Commands:")[2]


@pytest.mark.slow
def test_help_imports_nothing_heavy():
    program = (
        "import sys\n"
        "from sounder import cli\n"
        "sys.argv = ['sounder', 'process', '--help']\n"
        "try:\n    cli.main()\n"
        "except SystemExit as stop:\n    assert not stop.code\n"
        "print([m for m in ('numpy', 'xarray', 'numba', 'scipy', 'matplotlib', 'h5py') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
