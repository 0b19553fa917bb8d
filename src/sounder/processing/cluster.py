"""Positions in parallel processes by dask, on this machine or on a running cluster."""

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
from sounder.kernels.compiler.machine import processors
from sounder.options import Options
from sounder.processing.jobs import Job, Source, reopen_job
from sounder.processing.position import FilterCache, Outcome, process_position

if TYPE_CHECKING:
    from distributed import Client

RETRIES = 3
"""How often a position is tried again after its worker was lost. Chosen; not derived."""


def process_on_workers(
    pairs: Sequence[tuple[Job, Path]],
    options: Options,
    *,
    workers: int,
    threads: int | None,
    scheduler: str | None,
) -> Iterator[Outcome]:
    """Process positions on dask workers, and yield their outcomes in order.

    Workers receive file names only. They open the files and write the products themselves, completely or not at all. If
    a worker is lost, its positions are tried again.

    Parameters
    ----------
    pairs : sequence of (Job, Path)
        Each position and the path of its product.
    options : Options
    workers : int
        Processes to start. It has no effect with ``scheduler``.
    threads : int, optional
        Threads in each process. Default: an equal share of the processors.
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
            _compile_kernels(pairs[0][0])
            with _interrupts_ignored():
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
def _interrupts_ignored() -> Iterator[None]:
    """Start processes that ignore Ctrl-C, so that this process ends them."""
    if threading.current_thread() is not threading.main_thread():  # handlers can be set in the main thread only
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
        raise DataError(f"{scheduler}: no dask scheduler answers ({error}); start one with `dask scheduler`") from None


def _work(source: Source, target: Path, options: Options, threads: int | None) -> Outcome:
    try:
        job = reopen_job(source)
    except DataError as error:
        return Outcome(failures=[str(error)])
    return process_position(job, target, options, filters=_filters(), threads=threads)


@cache
def _filters() -> FilterCache:
    """Filters of this worker."""
    return FilterCache()


def _compile_kernels(job: Job) -> None:
    """Compile the kernels once, in this process, so that the workers find them in the cache."""
    from sounder.instrument.waveform import chips
    from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
    from sounder.mpc.extract import extract_mpcs

    sounder = job.recording.sounder
    correlator = MSequenceCorrelator(chips(sounder.sequence), sounder.sequence.samples_per_chip)
    correlator.average(np.zeros((1, correlator.samples, 2), np.int16))
    shape = {"azimuth": 1, "elevation": 1, "delay": sounder.waveform.samples}
    coords = {name: np.arange(size) for name, size in shape.items()}
    silence = np.zeros(tuple(shape.values()), np.complex64)
    with suppress(DataError):  # processing the positions will report what is wrong with the calibration
        extract_mpcs(xr.Dataset({"cir": (tuple(shape), silence)}, coords=coords), FilterCache().get(job)[0], sounder)
