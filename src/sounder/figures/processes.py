"""Figures of many products, drawn by as many processes as there are processors; this one is one of them.

matplotlib takes one processor. Each process is a Python of its own that reads lines of JSON, what to draw, and answers
each with one. It is no fork, which would inherit the locks of threads, and no child of multiprocessing, which would run
the script of the caller again. It ends with its input, so also if the process that started it is killed.
"""

import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from subprocess import Popen

from matplotlib.axes import Axes

from erm.common.errors import DataError
from erm.common.gate import confined, limits
from sounder.figures.files import draw_elevations, draw_overlay, draw_product, product_axes
from sounder.kernels.compiler.machine import processors

PRODUCTS_PER_PROCESS = 10
"""Fewest products for each process: at least twice as many as are drawn while one starts, by
benchmarks/figures.py. With fewer it would gain less than it costs."""

Order = tuple[str, str, str, bool]
"""Product, folder, format, and whether also each elevation is drawn."""


def draw_products(
    products: Sequence[Path],
    out: Path,
    *,
    suffix: str = "png",
    overlay: bool = False,
    elevations: bool = False,
    progress: Callable[[], None] | None = None,
) -> tuple[list[Path], list[str]]:
    """Draw the figures of products.

    Parameters
    ----------
    products : sequence of Path
    out : Path
        Folder.
    suffix : str
        Format of the figures.
    overlay : bool
        Also draw the DAPS of the two products into one polar diagram.
    elevations : bool
        Also draw the DAPS with a panel for each elevation.
    progress : callable, optional
        Called after each product.

    Returns
    -------
    written : list of Path
    failures : list of str
        One line for each product that cannot be drawn.

    Raises
    ------
    DataError
        A process that draws was killed.
    """
    written: list[Path] = []
    failures: list[str] = []
    with Drawing(out, suffix=suffix, elevations=elevations) as drawing:
        for product in products:
            drawing.order(product)
        for drawn, failure in drawing.results():
            written += drawn
            failures += [failure] if failure else []
            if progress is not None:
                progress()
    if overlay and not failures:
        written += draw_overlay(products[0], products[1], out, suffix=suffix)
    return written, failures


class Drawing:
    """Figures of products, drawn in the background from when each product is ordered, if other processes draw them.

    Parameters and errors are those of :func:`draw_products`. It is a context: at its end, and so after Ctrl-C, what is
    being drawn is completed, and the rest is not begun.
    """

    def __init__(self, out: Path, *, suffix: str = "png", elevations: bool = False) -> None:
        self._folder, self._suffix, self._elevations = str(out), suffix, elevations
        self._orders: list[Order] = []
        self._drawn: list[Future[tuple[list[Path], str]]] = []
        self._processes: list[Popen[bytes]] = []
        self._idle: SimpleQueue[Popen[bytes]] = SimpleQueue()

    def __enter__(self) -> "Drawing":
        self._threads = ThreadPoolExecutor(max(processors() - 1, 1))
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(cancel_futures=True)
        for process in self._processes:
            process.__exit__(None, None, None)

    def __len__(self) -> int:
        return len(self._orders)

    def order(self, product: Path) -> None:
        """Have a product drawn."""
        self._orders.append((str(product), self._folder, self._suffix, self._elevations))
        if len(self._processes) < min(processors() - 1, len(self) // PRODUCTS_PER_PROCESS):
            self._processes.append(confined.start(__name__, json.dumps(asdict(limits.current()))))
            self._idle.put(self._processes[-1])
        if self._processes:
            waiting = self._orders[len(self._drawn) :]
            self._drawn += [self._threads.submit(_ask, self._idle, order) for order in waiting]

    def results(self) -> Iterator[tuple[list[Path], str]]:
        """Wait for the files of each product and what failed, in the order of the orders.

        Meanwhile this process draws the last of those that are not begun.
        """
        axes = product_axes() if self._orders else []
        mine: dict[int, tuple[list[Path], str]] = {}
        for index, drawn in enumerate(self._drawn):
            for later in range(len(self._drawn) - 1, index, -1):
                if drawn.done():
                    break
                if self._drawn[later].cancel() and later not in mine:
                    mine[later] = _draw(axes, self._orders[later])
            yield mine[index] if index in mine else drawn.result()
        for order in self._orders[len(self._drawn) :]:
            yield _draw(axes, order)


def _ask(idle: "SimpleQueue[Popen[bytes]]", order: Order) -> tuple[list[Path], str]:
    """Have an idle process draw."""
    process = idle.get()
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(order).encode() + b"\n")
        process.stdin.flush()
        answer = json.loads(process.stdout.readline())
    except (OSError, ValueError):
        with suppress(OSError):
            process.stdin.close()
        raise DataError(f"{order[0]}: not drawn (drawing ended in {confined.KILLED}); draw it again") from None
    finally:
        idle.put(process)
    if "error" in answer:
        raise RuntimeError(answer["error"])
    return [Path(path) for path in answer["drawn"]], answer["failure"]


def _draw(axes: Sequence[Axes], order: Order) -> tuple[list[Path], str]:
    product, out = map(Path, order[:2])
    drawn: list[Path] = []
    try:
        drawn += draw_product(product, out, suffix=order[2], axes=axes)
        drawn += draw_elevations(product, out, suffix=order[2]) if order[3] else []
    except DataError as error:
        return drawn, str(error)
    return drawn, ""


def main() -> None:
    """Draw what each line of the input asks for, after whatever else the processors have to do."""
    if hasattr(os, "nice"):
        os.nice(10)
    limits.allow(limits.Limits(**json.loads(sys.argv[1])))
    axes = product_axes()
    for line in sys.stdin:
        try:
            drawn, failure = _draw(axes, json.loads(line))
            answer = {"drawn": [str(path) for path in drawn], "failure": failure}
        except Exception:  # the process that asks raises it
            answer = {"error": traceback.format_exc()}
        print(json.dumps(answer), flush=True)
