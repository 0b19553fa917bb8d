"""What both command lines share: tables, complaints, progress, figures saved whole, exit codes."""

import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from erm.common.errors import DataError, OptionError
from erm.common.launch import INTERRUPTED
from erm.common.storage import SOFTWARE, atomic_path
from erm.common.usage import told

if TYPE_CHECKING:
    import typer
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DATA_FAILED, WRONG_USAGE = 1, 2
"""Exit codes."""
UNDATED = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Metadata of figures without which the same figure would not be the same bytes."""


def run(app: "typer.Typer") -> None:
    """Run a command line: exit with 0 if all is done, 1 if data failed, 2 on wrong usage, 130 after Ctrl-C.

    What is wrong is told in one line.
    """
    from typer import Abort, BadParameter

    usage_error: type[BadParameter] = BadParameter.__mro__[1]  # its parent, which typer does not name
    signal.signal(signal.SIGINT, _interrupt)
    usual, sys.unraisablehook = sys.unraisablehook, _unraisable
    try:
        code = app(standalone_mode=False)
    except DataError as error:
        print(error, file=sys.stderr)
        raise SystemExit(WRONG_USAGE if isinstance(error, OptionError) else DATA_FAILED) from None
    except usage_error as error:
        print(told(error), file=sys.stderr)
        raise SystemExit(WRONG_USAGE) from None
    except Abort:  # Ctrl-C, of typers that do not return 130 for it
        code = INTERRUPTED
    finally:
        sys.unraisablehook = usual
    if code == INTERRUPTED:
        print("interrupted; what was finished is whole, the rest is not there", file=sys.stderr)
    raise SystemExit(code or 0)


_interrupted = Event()


def _interrupt(number: int, frame: object) -> None:
    """Raise KeyboardInterrupt, and note that it was: what is raised within a callback of a library is lost."""
    _interrupted.set()
    signal.default_int_handler(number, None)


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    """Say nothing of a Ctrl-C that a callback of the interpreter lost: it is raised again at the next step."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


def _go_on() -> None:
    """Raise KeyboardInterrupt again where one was lost."""
    if _interrupted.is_set():
        _interrupted.clear()
        raise KeyboardInterrupt


def add_version(app: "typer.Typer") -> None:
    """Give a command line the option ``--version``."""
    import typer

    def tell(asked: bool) -> None:
        if asked:
            print(SOFTWARE)
            raise typer.Exit

    @app.callback(help=app.info.help)
    def options(
        version: bool = typer.Option(False, "--version", callback=tell, is_eager=True, help="Tell the version."),
    ) -> None:
        del version


def show(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table: ruled on a terminal, tab-separated in a pipe."""
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
    """A number of things: ``1 wall``, ``2 walls``."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def complain(complaints: Sequence[str]) -> None:
    """Say on stderr what failed, and exit with 1 if anything did."""
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    if complaints:
        raise SystemExit(DATA_FAILED)


def save_figure(drawn: "Figure | Axes", path: Path) -> None:
    """Save a figure, or the figure of some axes, whole or not at all.

    Raises
    ------
    DataError
        The suffix names no format, or the folder cannot be written to.
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
    """Yield a function that advances a bar by one; nothing is shown unless stderr is a terminal."""
    if not sys.stderr.isatty():
        yield _go_on
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)

        def advance() -> None:
            bar.advance(task)
            _go_on()

        yield advance
