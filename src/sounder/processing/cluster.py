"""Positions in parallel processes, by dask: on this machine, or on a running cluster."""

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.storage import clear_leftovers
from sounder.kernels.compiler.compile import processors
from sounder.options import Options
from sounder.processing.jobs import Job, Source, reopen
from sounder.processing.position import Filters, Outcome, process_position

if TYPE_CHECKING:
    from distributed import Client

RETRIES = 3
"""Times a position is tried again after its worker was lost."""


def run(
    pairs: Sequence[tuple[Job, Path]],
    options: Options,
    *,
    workers: int,
    threads: int | None,
    scheduler: str | None,
) -> Iterator[Outcome]:
    """Process positions on dask workers and yield what became of each, in order.

    Only names travel: a worker opens the files itself and writes the product itself, whole or not at all, so a
    worker that is lost costs no more than its positions' second try.

    Parameters
    ----------
    pairs : sequence of (Job, Path)
        Each position and its product.
    options : Options
    workers : int
        Processes to start; of no effect with ``scheduler``.
    threads : int, optional
        Threads in each process; default an equal share of the processors.
    scheduler : str, optional
        Address of a running scheduler.

    Raises
    ------
    DataError
        dask is not installed, or the scheduler does not answer.
    """
    if not pairs:
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise DataError("--workers and --scheduler need the extra: pip install 'sounder-to-map[cluster]'") from None
    with ExitStack() as stack:
        if scheduler is None:
            _warm(pairs[0][0])
            with _deaf_to_interrupts():
                cluster = stack.enter_context(
                    LocalCluster(
                        n_workers=min(workers, len(pairs)),
                        threads_per_worker=1,
                        dashboard_address=":0",  # any free port: there may be other clusters
                        silence_logs=50,
                    )
                )
            client = stack.enter_context(Client(cluster))
            share: int | None = threads or max(processors() // workers, 1)
        else:
            client = stack.enter_context(_connect(Client, scheduler))
            share = threads
        futures = [
            client.submit(_work, job.source, target.absolute(), options, share, retries=RETRIES, pure=False)
            for job, target in pairs
        ]
        for (_, target), future in zip(pairs, futures, strict=True):
            part: Outcome = future.result()
            part.products = [target for _ in part.products]
            clear_leftovers(target)  # of workers that were lost
            yield part


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let processes that start meanwhile ignore Ctrl-C: it is this process's to end them."""
    if threading.current_thread() is not threading.main_thread():  # only there may handlers be set
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _connect(client: type["Client"], scheduler: str) -> "Client":
    try:
        return client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise DataError(f"{scheduler}: no dask scheduler answers ({error}); start one with: dask scheduler") from None


def _work(source: Source, target: Path, options: Options, threads: int | None) -> Outcome:
    try:
        job = reopen(source)
    except DataError as error:
        return Outcome(failures=[str(error)])
    return process_position(job, target, options, filters=_filters(), threads=threads)


@cache
def _filters() -> Filters:
    """Filters of this worker."""
    return Filters()


def _warm(job: Job) -> None:
    """Compile the kernels here, once, so that the workers find them in the cache."""
    from sounder.instrument.waveform import chips
    from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
    from sounder.mpc.extract import extract

    sounder = job.recording.sounder
    correlator = MSequenceCorrelator(chips(sounder.waveform), sounder.waveform.samples_per_chip)
    correlator.average(np.zeros((1, correlator.samples, 2), np.int16))
    shape = {"azimuth": 1, "elevation": 1, "delay": sounder.waveform.samples}
    coords = {name: np.arange(size) for name, size in shape.items()}
    silence = np.zeros(tuple(shape.values()), np.complex64)
    with suppress(DataError):  # each position will say what is wrong with its calibration
        extract(xr.Dataset({"cir": (tuple(shape), silence)}, coords=coords), Filters().of(job), sounder)
