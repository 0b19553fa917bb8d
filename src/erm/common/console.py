"""Shared by both command lines: tables, error reports, progress bars, figure files, exit codes."""

import io
import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from erm.common.atomic import atomic_path
from erm.common.errors import DataError, OptionError, internal_error, with_traceback
from erm.common.gate import limits
from erm.common.interrupts import interrupt, interrupted, listen, raise_lost_interrupt, terminated
from erm.common.launch import INTERRUPTED
from erm.common.messages import Loudness, detail, failure, loudness
from erm.common.printable import printable
from erm.common.storage import SOFTWARE
from erm.common.usage import usage_message

if TYPE_CHECKING:
    import typer
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DATA_FAILED, WRONG_USAGE, INTERNAL = 1, 2, 70
"""Exit codes; 70 is that of sysexits.h for an internal error."""
TERMINATED = 128 + signal.SIGTERM
"""Exit code after a request to end, as shells report it."""
UNDATED = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Dates left out of the metadata of figures, so that the same figure gives the same bytes."""
DPI = 160
"""Resolution of figures; chosen."""
ROOM = 1.0
"""Room around a figure for texts outside it [inch]; chosen. More takes longer; with less, more figures need twice."""


def run(app: "typer.Typer") -> None:
    """Run a command line; errors are printed in one line on stderr.

    Exit codes: 0 all done, 1 data failed, 2 wrong usage, 70 internal error, 130 after Ctrl-C, 143 after SIGTERM.
    """
    usual = sys.unraisablehook
    try:
        listen(interrupt)
        sys.unraisablehook = _unraisable
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")  # the terminal may lack a letter of a name
        code = _run(app)
        listen(signal.SIG_DFL)  # nothing is left to clean up
        if sys.stdout is not None:
            sys.stdout.flush()
    except KeyboardInterrupt:
        code = _stopped()
    except OSError as error:
        code = _stopped() if interrupted.is_set() else _output_failed(error)
    finally:
        sys.unraisablehook = usual
    raise SystemExit(code)


def _run(app: "typer.Typer") -> int:
    """Exit code of a command line."""
    from typer import Abort, BadParameter

    usage_error: type[BadParameter] = BadParameter.__mro__[1]  # its parent class, which typer does not export
    try:
        code = app(standalone_mode=False)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else DATA_FAILED
    except OSError:
        raise
    except Exception as error:
        cause = error.__cause__ or error if isinstance(error, Abort) else error
        if interrupted.is_set():  # some libraries make errors of their own of it
            return _stopped()
        if isinstance(cause, DataError):
            failure(str(cause))
            return WRONG_USAGE if isinstance(cause, OptionError) else DATA_FAILED
        if isinstance(cause, usage_error):
            failure(usage_message(cause))
            return WRONG_USAGE
        if isinstance(cause, MemoryError):
            print("the memory of this machine is not enough", file=sys.stderr)
            return DATA_FAILED
        print(internal_error(cause), file=sys.stderr)  # typer takes the end of a file (EOFError) for the end of typing
        return INTERNAL
    return _stopped() if code == INTERRUPTED else code or 0


def _stopped() -> int:
    """Say that the command was asked to end."""
    print("interrupted; finished files are complete, unfinished ones were removed", file=sys.stderr)
    return TERMINATED if terminated.is_set() else INTERRUPTED


def _output_failed(error: OSError) -> int:
    """Report that nothing more can be printed; a reader that has seen enough, such as ``head``, is not reported."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # what is left must not fail again when Python ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    if not isinstance(error, BrokenPipeError):
        where = error.filename or "the output"
        print(f"{where}: cannot be written or read ({error.strerror or error})", file=sys.stderr)
    return DATA_FAILED


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    """Print nothing for a lost KeyboardInterrupt: `raise_lost_interrupt` raises it again."""
    if not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)


def add_options(app: "typer.Typer", examples: Mapping[str, Sequence[str]]) -> None:
    """Add to a command line what comes before the command: version, limits of files, how much it says.

    ``examples`` are lines that ``--help`` of each command shows.
    """
    import typer

    for command in app.registered_commands:
        name = str(command.name or getattr(command.callback, "__name__", ""))
        command.epilog = "\n".join(["\b", "Examples:", *(f"  {line}" for line in examples[name])])

    defaults = limits.current()

    def print_version(given: bool) -> None:
        if given:
            print(SOFTWARE)
            raise typer.Exit

    @app.callback(help=app.info.help)
    def options(
        context: typer.Context,
        version: bool = typer.Option(
            False, "--version", callback=print_version, is_eager=True, help="Print the version."
        ),
        max_memory: float = typer.Option(
            defaults.max_bytes / limits.GIB, min=0.001, help="Largest array that is read from a file [GiB]."
        ),
        virtual: bool = typer.Option(
            False, "--virtual", help="Read virtual HDF5 datasets, whose data are in other files of the folder."
        ),
        traceback: bool = typer.Option(False, "--traceback", help="Show where an internal error arose."),
        quiet: bool = typer.Option(False, "--quiet", "-q", help="Print failures and --json only."),
        verbose: bool = typer.Option(False, "--verbose", "-v", help="Also print how long each step took."),
    ) -> None:
        del version
        if quiet and verbose:
            raise typer.BadParameter("give either --quiet or --verbose")
        level = Loudness.QUIET if quiet else Loudness.VERBOSE if verbose else Loudness.USUAL
        context.with_resource(loudness(level))
        if traceback:
            with_traceback.set()
        limits.allow(limits.Limits(int(max_memory * limits.GIB), virtual))


def show(header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table: with rules on a terminal, tab-separated in a pipe. Control characters are escaped."""
    cells = [[printable(str(cell)) for cell in row] for row in rows]
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


def report_failures(failures: Sequence[str], *, internal: bool = False) -> None:
    """Print one line for each failure on stderr, and exit with code 1 if there are any; 70 if one is ``internal``."""
    for line in failures:
        failure(line)
    if failures:
        raise SystemExit(INTERNAL if internal else DATA_FAILED)


@contextmanager
def drawing() -> Iterator[None]:
    """Draw in the style of matplotlib itself meanwhile: a matplotlibrc of the caller has no say in files.

    It can decorate a function, too.
    """
    from matplotlib import style

    with style.context("default", after_reset=True):
        yield


def save_figure(drawn: "Figure | Axes", path: Path) -> None:
    """Save a figure, or the figure of some axes, cut to what is drawn. The file is written completely or not at all.

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
        suffix = path.suffix.lower()
        content = _png(figure) if suffix == ".png" else b""
        try:
            temporary.write_bytes(content or _tight(figure, suffix))
        except ValueError as error:
            raise DataError(f"{path}: {error}") from None


def _png(figure: "Figure") -> bytes:
    """Draw a figure once, with room around it, and cut the image; nothing if the room is not enough.

    matplotlib finds what is drawn by a second layout of all texts, which takes as long as to draw them.
    """
    import numpy as np
    from matplotlib import rcParams
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from erm.common.png import png

    canvas = figure.canvas if type(figure.canvas) is FigureCanvasAgg else FigureCanvasAgg(figure)
    figure.savefig(io.BytesIO(), format="rgba", dpi=DPI, bbox_inches=figure.bbox_inches.padded(ROOM))
    image = np.asarray(canvas.buffer_rgba())
    colour = image.view(np.uint32)[..., 0]
    inked = colour != colour[0, 0]
    edge = round(rcParams["savefig.pad_inches"] * DPI)
    cut = []
    for axis, size in enumerate(inked.shape):
        found = np.flatnonzero(inked.any(axis=1 - axis))
        if not found.size or found[0] < edge or found[-1] + edge >= size:
            return b""
        cut.append(slice(found[0] - edge, found[-1] + edge + 1))
    return png(image[tuple(cut)], DPI)


def _tight(figure: "Figure", suffix: str) -> bytes:
    """Have matplotlib measure what is drawn: it draws a figure with a layout twice for that, and others once."""
    from matplotlib import rcParams

    box = "tight" if figure.get_layout_engine() else figure.get_tightbbox().padded(rcParams["savefig.pad_inches"])
    content = io.BytesIO()  # matplotlib fails in many ways where it cannot write
    figure.savefig(content, format=suffix[1:], dpi=DPI, bbox_inches=box, metadata=UNDATED.get(suffix))
    return content.getvalue()


@contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that advances a progress bar by one. The bar is shown on a terminal only."""
    with _timed(f"{label}: {total}"):
        if sys.stderr.isatty():
            with _bar(label, total) as advance:
                yield advance
        else:
            yield raise_lost_interrupt


@contextmanager
def _timed(label: str) -> Iterator[None]:
    """Say with ``--verbose`` how long a block took."""
    start = time.perf_counter()
    yield
    detail(f"{label} in {time.perf_counter() - start:.1f} s")


@contextmanager
def _bar(label: str, total: int) -> Iterator[Callable[[], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)

        def advance() -> None:
            bar.advance(task)
            raise_lost_interrupt()

        yield advance
