"""Exit codes, tables, complaints and progress, on a terminal and in a pipe."""

import contextlib
import signal
import sys
from enum import StrEnum
from pathlib import Path
from threading import Event
from typing import Annotated

import numpy as np
import pytest
import typer
from matplotlib import image
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from erm.common import console, errors
from erm.common.errors import DataError, OptionError
from erm.common.gate.damage import refused


def exit_code(body, arguments=()) -> int:
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(body)
    old, sys.argv = sys.argv, ["x", *arguments]
    try:
        with pytest.raises(SystemExit) as stop:
            console.run(app)
    finally:
        sys.argv = old
    return int(stop.value.code or 0)


def test_all_done_is_0(capsys):
    assert exit_code(lambda: None) == 0
    assert capsys.readouterr().err == ""


def test_a_data_error_is_one_line_and_1(capsys):
    def body() -> None:
        raise DataError("x.h5: broken; expected whole")

    assert exit_code(body) == 1
    assert capsys.readouterr().err == "x.h5: broken; expected whole\n"


def test_wrong_usage_is_2(capsys):
    assert exit_code(lambda: None, ["--unknown"]) == 2
    assert "No such option" in capsys.readouterr().err


@pytest.mark.parametrize("bug", [ZeroDivisionError, EOFError])  # typer takes the end of a file for Ctrl-D
def test_a_fault_of_this_software_is_one_line_that_says_so_and_70(bug, capsys, monkeypatch):
    def body() -> None:
        raise bug("half\na line")

    assert exit_code(body) == 70
    (line,) = capsys.readouterr().err.split("\n")[-2:-1]  # typer ends the line that was being typed
    assert line.startswith(f"internal error: {bug.__name__} at test_console.py:")
    monkeypatch.setattr(errors, "with_traceback", Event())
    errors.with_traceback.set()  # the option --traceback
    assert exit_code(body) == 70
    assert "Traceback (most recent call last):\n" in capsys.readouterr().err


def test_too_little_memory_is_no_fault(capsys):
    def body() -> None:
        raise MemoryError

    assert exit_code(body) == 1
    assert capsys.readouterr().err == "the memory of this machine is not enough\n"


def test_names_do_not_steer_the_terminal(capsys):
    console.show(["name"], [("RX1\n\x1b[31mall done",)])
    assert capsys.readouterr().out == "name\nRX1\\n\\x1b[31mall done\n"
    assert str(DataError("a\x1b[31m.h5: \u202ebad")) == "a\\x1b[31m.h5: \\u202ebad"


def test_complaints_go_to_stderr_and_exit_with_1(capsys):
    console.report_failures([])
    with pytest.raises(SystemExit) as stop:
        console.report_failures(["one", "two"])
    assert stop.value.code == 1
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "one\ntwo\n")


def test_a_table_in_a_pipe_is_tab_separated(capsys):
    console.show(["a", "b"], [(1, "x y"), (2.5, None)])
    assert capsys.readouterr().out == "a\tb\n1\tx y\n2.5\tNone\n"


def test_a_table_on_a_terminal_is_ruled(capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    console.show(["a", "b"], [(1, "value")])
    out = capsys.readouterr().out
    assert "value" in out
    assert "\t" not in out
    assert len(out.splitlines()) > 3


def test_progress_in_a_pipe_is_silent(capsys):
    with console.progress("working", 2) as advance:
        advance()
        advance()
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")


def test_progress_on_a_terminal_goes_to_stderr(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with console.progress("working", 2) as advance:
        advance()
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "working" in printed.err


def test_a_figure_is_saved_whole_or_told(tmp_path):
    figure = Figure(figsize=(1, 1))
    console.save_figure(figure, tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(DataError, match=r"x\.xyz: "):
        console.save_figure(figure, tmp_path / "x.xyz")
    with pytest.raises(DataError) as caught:
        console.save_figure(figure, tmp_path / "x.png" / "y.png")
    assert str(caught.value) == f"{tmp_path / 'x.png'}: is a file; choose a folder to write into"
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]


@pytest.mark.parametrize("inches", [0.2, 3.0])
def test_a_figure_is_cut_to_what_is_drawn_wherever_it_is(tmp_path, inches):
    figure = Figure(figsize=(1, 1))
    figure.add_artist(Rectangle((1 + inches, 0.5), 0.1, 0.1, linewidth=0))
    console.save_figure(figure, tmp_path / "x.png")
    picture = image.imread(tmp_path / "x.png")
    rows, columns = np.nonzero((picture[..., :3] != 1).any(axis=2))
    height, width = picture.shape[:2]
    assert (np.ptp(rows), np.ptp(columns)) == pytest.approx((16, 16), abs=2)
    assert width - columns.max() == pytest.approx(17, abs=2)  # a tenth of an inch around
    if inches < 1:
        assert [rows.min(), height - rows.max(), columns.min()] == pytest.approx([17, 17, 17], abs=2)


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files")
def test_a_figure_on_a_full_disk_is_one_line_and_no_file(tmp_path):
    import resource

    figure = Figure()
    figure.add_subplot()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(DataError, match=r"x\.pdf: cannot be written \(File too large\); is the disk full"):
            console.save_figure(figure, tmp_path / "x.pdf")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_a_figure_saved_twice_is_the_same_bytes_without_a_date(tmp_path, suffix):
    figure = Figure(figsize=(1, 1))
    line = figure.add_subplot().plot([0, 1])[0]
    line.set_clip_path(figure.patch)  # an SVG names it
    for name in ("one", "two"):
        console.save_figure(figure, tmp_path / name / f"x.{suffix}")
    first, second = ((tmp_path / name / f"x.{suffix}").read_bytes() for name in ("one", "two"))
    assert first == second
    assert b"CreationDate" not in first  # two in the same second would be the same
    assert b"<dc:date>" not in first


def test_an_interrupt_that_a_library_swallows_is_raised_at_the_next_step(capsys):
    steps = []

    def body() -> None:
        with console.progress("working", 3) as advance:
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                steps.append("swallowed")  # as by a callback out of compiled code
            steps.append("first")
            advance()
            steps.append("second")

    before = signal.getsignal(signal.SIGINT)
    try:
        assert exit_code(body) == console.INTERRUPTED
        assert exit_code(lambda: None) == 0  # it is told once
    finally:
        signal.signal(signal.SIGINT, before)
    assert steps == ["swallowed", "first"]
    assert "interrupted" in capsys.readouterr().err


def test_an_interrupt_that_the_interpreter_loses_is_raised_at_the_next_step(capsys):
    class Leaving:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    def body() -> None:
        with console.progress("working", 1) as advance:
            Leaving()
            advance()

    before = signal.getsignal(signal.SIGINT)
    try:
        assert exit_code(body) == console.INTERRUPTED
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "interrupted; finished files are complete, unfinished ones were removed\n"


@pytest.fixture
def handlers():
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("handlers")
def test_an_interrupt_that_a_library_makes_an_error_of_is_no_error_of_a_file(capsys):
    def body() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise DataError("x.h5: damaged HDF5 file (object visitation failed)") from None

    assert exit_code(body) == console.TERMINATED
    assert capsys.readouterr().err == "interrupted; finished files are complete, unfinished ones were removed\n"
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL  # what comes later ends the process without a word


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("swallowed", [True, False])
def test_an_interrupt_within_hdf5_is_no_damage_that_a_batch_goes_on_after(swallowed, capsys):
    gone_on = []

    def body() -> None:
        with contextlib.suppress(DataError), refused(Path("x.h5")):
            try:
                signal.raise_signal(signal.SIGTERM)
            except KeyboardInterrupt:
                if not swallowed:
                    raise RuntimeError("object visitation failed") from None
        gone_on.append("next file")

    assert exit_code(body) == console.TERMINATED
    assert not gone_on
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.usefixtures("handlers")
def test_an_interrupt_before_the_command_begins_is_one_line(capsys, monkeypatch):
    monkeypatch.setattr(console, "_run", lambda app: signal.raise_signal(signal.SIGTERM))
    assert exit_code(lambda: None) == console.TERMINATED
    assert capsys.readouterr().err.count("\n") == 1


def test_a_wrong_option_is_one_line_and_2(capsys):
    def body() -> None:
        raise OptionError("--x is nan; expected a number")

    assert exit_code(body) == 2
    assert capsys.readouterr().err == "--x is nan; expected a number\n"


class Colour(StrEnum):
    red = "red"
    green = "green"


def coloured(
    size: Annotated[float, typer.Option(min=0.0)] = 1.0,
    count: Annotated[int, typer.Option()] = 1,
    colour: Annotated[Colour, typer.Option()] = Colour.red,
    place: Annotated[tuple[float, float], typer.Option()] = (0.0, 0.0),
) -> None:
    """Take options of all kinds."""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--size", "-2"], ["--size", "-2", "0"]),
        (["--size", "nan"], ["--size", "nan", "0"]),
        (["--size", "large"], ["--size", "'large'"]),
        (["--count", "2.5"], ["--count", "2.5"]),
        (["--colour", "blue"], ["--colour", "'blue'", "'red', 'green'"]),
        (["--place", "3"], ["--place", "requires 2"]),
        (["--place", "3,4", "--size", "-6"], ["No such option: -6", "separate the numbers"]),
        (["--place", "1", "2", "-3"], ["No such option: -3", "separate the numbers"]),
        (["--colours", "red"], ["No such option", "--colour"]),
    ],
)
def test_wrong_usage_is_one_line_with_what_was_found(capsys, arguments, said):
    assert exit_code(coloured, arguments) == console.WRONG_USAGE
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "Value error" not in err
    for part in said:
        assert part in err
