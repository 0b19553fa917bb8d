"""What commands say: --quiet, --verbose, JSON, colours on terminals only, examples of --help, completion."""

import json
import os
import re
import shlex
import subprocess
import sys

import pytest
import typer

import erm.cli
import sounder.cli
from erm.cli.examples import EXAMPLES as OF_ERM
from erm.common import console, messages
from sounder.cli.examples import EXAMPLES as OF_SOUNDER


def said(capsys, *arguments: str) -> tuple[str, str]:
    app = typer.Typer()

    @app.command()
    def work() -> None:
        with console.progress("working", 3):
            print("a line")
        messages.note("a note")
        messages.write_json({"a": 1})
        console.report_failures(["a failure"])

    @app.command()
    def other() -> None:
        """With one command alone there are no options before it."""

    console.add_options(app, {"work": (), "other": ()})
    old, sys.argv = sys.argv, ["x", *arguments, "work"]
    try:
        with pytest.raises(SystemExit) as stop:
            console.run(app)
    finally:
        sys.argv = old
    assert stop.value.code == 1
    return tuple(capsys.readouterr())


def test_quiet_leaves_failures_and_json(capsys):
    assert said(capsys, "--quiet") == ('{\n  "a": 1\n}\n', "a failure\n")
    assert said(capsys) == ('a line\n{\n  "a": 1\n}\n', "a note\na failure\n")  # nothing stays quiet


def test_verbose_tells_how_long_steps_take(capsys):
    _, errors = said(capsys, "--verbose")
    assert re.fullmatch(r"working: 3 in \d+\.\d s\na note\na failure\n", errors)


def test_colours_are_for_terminals_that_want_them(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.delenv("NO_COLOR", raising=False)
    messages.failure("broken")
    monkeypatch.setenv("NO_COLOR", "")
    messages.failure("broken")
    assert capsys.readouterr().err == "\x1b[31mbroken\x1b[0m\nbroken\n"


@pytest.mark.parametrize(("cli", "examples"), [(sounder.cli, OF_SOUNDER), (erm.cli, OF_ERM)])
def test_examples_of_the_help_are_command_lines_of_their_command(cli, examples):
    commands = typer.main.get_command(cli.app).commands
    assert sorted(examples) == sorted(commands)
    for name, lines in examples.items():
        for line in lines:
            program, command, *arguments = shlex.split(line)
            assert (program, command) == (cli.__name__.partition(".")[0], name)
            commands[name].make_context(name, arguments)  # raises an error where an option is unknown or wrong


@pytest.mark.slow
def test_words_are_completed():
    code = "import sys; sys.argv = ['sounder']; from sounder.__main__ import main; main()"
    asked = {"_SOUNDER_COMPLETE": "complete_bash", "COMP_WORDS": "sounder par", "COMP_CWORD": "1"}
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True)
    assert done.stdout.split() == ["parameters"]


def test_json_has_no_numbers_that_json_does_not_know(capsys):
    with pytest.raises(ValueError, match="JSON"):
        messages.write_json({"a": float("nan")})
    messages.write_json([1.5])
    assert json.loads(capsys.readouterr().out) == [1.5]
