"""Shared by both command lines: tables, error reports, progress bars, figure files, exit codes."""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from erm.common.errors import DataError, OptionError
from erm.common.gate import limits
from erm.common.launch import INTERRUPTED
from erm.common.storage import SOFTWARE, atomic_path
from erm.common.usage import usage_message

if TYPE_CHECKING:
    import typer
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DATA_FAILED, WRONG_USAGE = 1, 2
"""Exit codes."""
UNDATED = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Dates left out of the metadata of figures, so that the same figure gives the same bytes."""


def run(app: "typer.Typer") -> None:
    """Run a command line. Exit codes: 0 all done, 1 data failed, 2 wrong usage, 130 after Ctrl-C.

    Errors are printed in one line on stderr.
    """
    from typer import Abort, BadParameter

    usage_error: type[BadParameter] = BadParameter.__mro__[1]  # its parent class, which typer does not export
    signal.signal(signal.SIGINT, _interrupt)
    usual, sys.unraisablehook = sys.unraisablehook, _unraisable
    try:
        code = app(standalone_mode=False)
    except DataError as error:
        print(error, file=sys.stderr)
        raise SystemExit(WRONG_USAGE if isinstance(error, OptionError) else DATA_FAILED) from None
    except usage_error as error:
        print(usage_message(error), file=sys.stderr)
        raise SystemExit(WRONG_USAGE) from None
    except Abort as abort:  # Ctrl-C in versions of typer that do not return 130
        if isinstance(abort.__cause__, EOFError):  # typer takes the end of a file for the end of typing
            raise abort.__cause__ from None
        code = INTERRUPTED
    finally:
        sys.unraisablehook = usual
    if code == INTERRUPTED:
        print("interrupted; finished files are complete, unfinished ones were removed", file=sys.stderr)
    raise SystemExit(code or 0)


_interrupted = Event()


def _interrupt(number: int, frame: object) -> None:
    """Raise KeyboardInterrupt and remember it: libraries lose what is raised within their callbacks."""
    _interrupted.set()
    signal.default_int_handler(number, None)


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    """Print nothing for a lost KeyboardInterrupt: `_raise_lost_interrupt` raises it again."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


def _raise_lost_interrupt() -> None:
    """Raise KeyboardInterrupt again if a library lost one."""
    if _interrupted.is_set():
        _interrupted.clear()
        raise KeyboardInterrupt


def add_options(app: "typer.Typer") -> None:
    """Add the options before the command to a command line: ``--version`` and the limits of files."""
    import typer

    defaults = limits.current()

    def print_version(given: bool) -> None:
        if given:
            print(SOFTWARE)
            raise typer.Exit

    @app.callback(help=app.info.help)
    def options(
        version: bool = typer.Option(
            False, "--version", callback=print_version, is_eager=True, help="Print the version."
        ),
        max_memory: float = typer.Option(
            defaults.max_bytes / limits.GIB, min=0.001, help="Largest array that is read from a file [GiB]."
        ),
        virtual: bool = typer.Option(
            False, "--virtual", help="Read virtual HDF5 datasets, whose data are in other files of the folder."
        ),
    ) -> None:
        del version
        limits.allow(limits.Limits(int(max_memory * limits.GIB), virtual))


def show(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table: with rules on a terminal, tab-separated in a pipe."""
    cells = [[str(cell) for cell in row] for row in rows]
    if not sys.stdout.isatty():
        for row in [list(header), *cells]:
            print("\t".join(row))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(*header)
    for row in cells:
        table.add_row(*row)
    Console().print(table)


def counted(number: int, thing: str) -> str:
    """Write a number of things: ``1 wall``, ``2 walls``."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def report_failures(failures: Sequence[str]) -> None:
    """Print one line for each failure on stderr, and exit with code 1 if there are any."""
    for failure in failures:
        print(failure, file=sys.stderr)
    if failures:
        raise SystemExit(DATA_FAILED)


def save_figure(drawn: "Figure | Axes", path: Path) -> None:
    """Save a figure, or the figure of some axes. The file is written completely or not at all.

    Raises
    ------
    DataError
        The suffix is not a known format, or the folder cannot be written to.
    """
    from matplotlib import rc_context

    figure = drawn.get_figure(root=True)
    if figure is None:
        raise DataError(f"{path}: axes without a figure cannot be saved")
    # parts of an SVG have random names without a salt
    with atomic_path(path) as temporary, rc_context({"svg.hashsalt": path.name}):
        try:
            figure.savefig(temporary, dpi=160, bbox_inches="tight", metadata=UNDATED.get(path.suffix.lower()))
        except ValueError as error:
            raise DataError(f"{path}: {error}") from None


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that advances a progress bar by one. The bar is shown on a terminal only."""
    if not sys.stderr.isatty():
        yield _raise_lost_interrupt
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)

        def advance() -> None:
            bar.advance(task)
            _raise_lost_interrupt()

        yield advance
