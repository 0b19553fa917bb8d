"""From recordings to products. Each position is processed separately: a failure affects only its position."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import partial
from pathlib import Path

from erm.common.atomic import clear_leftovers
from erm.common.errors import DataError
from erm.common.outputs import locked
from sounder.kernels.compiler.machine import processors
from sounder.options import Options
from sounder.processing.jobs import Job, merge_failures
from sounder.processing.position import FilterCache, Outcome, existing_product, process_position
from sounder.quality.quadrature import remarks_on_quadrature
from sounder.recordings.recording import Recording


class OutputPaths:
    """Paths of outputs in a folder. Each is given once, and never that of an input.

    Parameters
    ----------
    out : Path
        The folder.
    inputs : iterable of Path
        Files that are read.
    """

    def __init__(self, out: Path, inputs: Iterable[Path]) -> None:
        self._out = out
        self._inputs = {path.resolve() for path in inputs}
        self._taken: dict[Path, str] = {}

    def claim(self, recording: Recording, name: str | None = None) -> Path:
        """Path for a position, named after it unless a name is given.

        Raises
        ------
        DataError
            The path was given to another position, or is an input.
        """
        safe = re.sub(r"[^\w.+-]+", "_", recording.name).strip("._") or recording.source.stem
        return self.reserve(name or safe, f"{recording.source}: position {recording.name}")

    def reserve(self, name: str, owner: str) -> Path:
        """Path ``name.h5`` for ``owner``, a text for errors.

        Raises
        ------
        DataError
            The path was given to another owner, or is an input.
        """
        target = self._out / f"{name}.h5"
        if target in self._taken:
            raise DataError(
                f"{owner}: {target} is already taken by {self._taken[target]}; "
                "give the positions different names or write them to different folders"
            )
        if target.resolve() in self._inputs:
            raise DataError(f"{owner}: the output {target} is an input; choose another --out")
        self._taken[target] = owner
        return target

    def release(self, target: Path) -> None:
        """Make a path free again, because nothing was written to it."""
        del self._taken[target]


def process_side_by_side(
    named: Sequence[tuple[Job, Path]], options: Options, *, filters: FilterCache, threads: int
) -> Iterator[Outcome]:
    """Process as many positions at a time as there are threads, and yield their outcomes in order.

    Much of a position is serial. So threads are given to positions first, and to the directions of each where there are
    fewer positions than threads.
    """
    if not named:
        return
    together = min(threads, len(named))
    each = partial(process_position, options=options, filters=filters, threads=threads // together)
    context = copy_context()  # what is kept in memory, for one: threads have a context of their own

    def run(one: tuple[Job, Path]) -> Outcome:
        return context.copy().run(each, *one)

    with ThreadPoolExecutor(together) as pool:
        try:
            yield from pool.map(run, named)
        finally:  # Ctrl-C too: positions that are being processed are completed, others are not begun
            pool.shutdown(wait=False, cancel_futures=True)


def process(
    jobs: Sequence[Job],
    out: Path | str,
    *,
    options: Options | None = None,
    threads: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Callable[[], None] | None = None,
    each: Callable[[Outcome], None] | None = None,
) -> Outcome:
    """Process recordings into products, one for each position.

    The products are the same, to the last byte, for any number of threads and workers. If positions share a name, the
    first in the order of the jobs that succeeds gets the product of this name.

    Parameters
    ----------
    jobs : sequence of Job
        From :func:`sounder.processing.jobs.gather`.
    out : path
        Folder of the products. A product is named after its position.
    options : Options, optional
    threads : int, optional
        Threads in each process. Default: one for each processor.
    workers : int
        Processes on this machine, started by dask.
    scheduler : str, optional
        Address of a running dask scheduler, such as ``tcp://host:8786``; its workers must see the same files.
    resume : bool
        Keep products that exist already and would be made the same again. Half-written files of a killed process are
        removed.
    progress : callable, optional
        Called after each position.
    each : callable, optional
        Called with the outcome of each position as soon as it is known.

    Returns
    -------
    Outcome
        In the order of the jobs.

    Raises
    ------
    DataError
        The dask scheduler cannot be reached, dask is not installed, or another process writes into the folder.

    Examples
    --------
    >>> import sounder, tempfile
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> jobs, failures = sounder.gather(recordings, calibration=b2b)
    >>> outcome = sounder.process(jobs, tempfile.mkdtemp())
    >>> [product.name for product in outcome.products], outcome.failures
    (['synthetic-two-paths.h5'], [])
    """
    options = options or Options()
    paths = OutputPaths(Path(out), {path for job in jobs for path in (job.recording.source, job.b2b.source)})
    filters = FilterCache()

    def run(named: Sequence[tuple[Job, Path]]) -> Iterable[Outcome]:
        if workers > 1 or scheduler is not None:
            from sounder.processing.cluster import process_on_workers  # distributed is optional and slow to import

            return process_on_workers(named, options, workers=workers, threads=threads, scheduler=scheduler)
        return process_side_by_side(named, options, filters=filters, threads=threads or processors())

    def outcomes(named: dict[int, tuple[Job, Path]]) -> Iterator[tuple[int, Outcome]]:
        """Yield outcomes with the indices of their jobs: of existing products first."""
        missing = dict(named)
        for index, (job, target) in named.items() if resume else ():
            if (part := existing_product(job, target, options)) is not None:
                del missing[index]
                yield index, part
            clear_leftovers(target)
        yield from zip(missing, run(list(missing.values())), strict=True)

    parts: dict[int, Outcome] = {}
    with locked(Path(out)):
        while len(parts) < len(jobs):  # again, if a position failed and left its name to another
            named: dict[int, tuple[Job, Path]] = {}
            refused: dict[int, Outcome] = {}
            for index, job in enumerate(jobs):
                if index not in parts:
                    try:
                        named[index] = job, paths.claim(job.recording)
                    except DataError as error:
                        refused[index] = Outcome(failures=[str(error)])
            if not named:
                parts |= refused
            for index, part in outcomes(named):
                parts[index] = part
                if not part.products:
                    paths.release(named[index][1])
                if progress is not None:
                    progress()
                if each is not None:
                    each(part)
    ordered = [parts[index] for index in range(len(jobs))]
    sources = [job.recording.source for job in jobs]
    failures = [(failure, source) for part, source in zip(ordered, sources, strict=True) for failure in part.failures]
    return Outcome(
        products=[product for part in ordered for product in part.products],
        failures=[*merge_failures(failures, sources), *_shared(jobs, ordered)],
        notes=[note for part in ordered for note in part.notes],
        already=sum(part.already for part in ordered),
        internal=any(part.internal for part in ordered),
    )


def _shared(jobs: Sequence[Job], outcomes: Sequence[Outcome]) -> list[str]:
    """One line for each back-to-back with a fault that all its positions share, told by none of them alone."""
    lines = []
    for b2b in dict.fromkeys(job.b2b.source for job in jobs):
        of_b2b = [part.evidence for job, part in zip(jobs, outcomes, strict=True) if job.b2b.source == b2b]
        evidence = [one for one in of_b2b if one]
        for remark in remarks_on_quadrature(evidence):
            if not any(remarks_on_quadrature([one]) for one in evidence):
                lines.append(f"{b2b}: {len(evidence)} positions together: {remark.meaning}: {remark.code.action}")
    return lines
