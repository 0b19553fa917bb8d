"""Positions in parallel processes by dask, on this machine or on a running cluster."""

import platform
import signal
import threading
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import xarray as xr

from erm.common.errors import DataError
from erm.common.storage import SOFTWARE
from sounder.kernels.compiler.machine import processors
from sounder.options import Options
from sounder.processing.jobs import Explained, Job, Source, reopen_job
from sounder.processing.main_guard import require_main_guard
from sounder.processing.position import FilterCache, Outcome, process_position

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

RETRIES = 3
"""How often a position is tried again after its worker was lost. Chosen; not derived."""
PATIENCE = 60
"""Time without any worker after which the others are given up [s]; chosen: a lost worker is replaced within seconds."""


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
        dask is not installed, the scheduler does not answer, or workers cannot be started.
    """
    if not pairs:
        return
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise DataError("--workers and --scheduler need the extra: pip install 'sounder-to-map[cluster]'") from None
    with ExitStack() as stack:
        if scheduler is None:
            require_main_guard()
            _compile_kernels(pairs[0][0])
            client = stack.enter_context(Client(stack.enter_context(_started(LocalCluster, min(workers, len(pairs))))))
            share: int | None = threads or max(processors() // workers, 1)
        else:
            client = stack.enter_context(_connect(Client, scheduler))
            share = threads
        made_with = _versions()
        futures = [
            client.submit(
                _work, made_with, _absolute(job.source), target.absolute(), options, share, retries=RETRIES, pure=False
            )
            for job, target in pairs
        ]
        for (job, target), future in zip(pairs, futures, strict=True):
            part = _outcome(client, future)
            part.failures, part.notes = (
                [_as_given(line, job) for line in each] for each in (part.failures, part.notes)
            )
            part.products = [target for _ in part.products]
            yield part


def _absolute(source: Source) -> Source:
    """Absolute paths: workers may run in another folder."""
    explained = {name: path and path.absolute() for name, path in vars(source.explained).items()}
    return Source(source.path.absolute(), source.position, Explained(**explained))


def _as_given(line: str, job: Job) -> str:
    """Name files as the user did."""
    for path in (job.source.path, *job.source.explained.files):
        line = line.replace(str(path.absolute()), str(path))
    return line


def _outcome(client: "Client", future: "Future[Any]") -> Outcome:
    """Outcome of a position; if it cannot be had any more, that is one line."""
    from distributed import KilledWorker

    try:
        while True:
            try:
                return cast(Outcome, future.result(timeout=PATIENCE))
            except TimeoutError:
                if not client.nthreads():
                    reason = f"no worker has answered for {PATIENCE} s"
                    break
    except KilledWorker:
        reason = f"lost a worker {RETRIES + 1} times at this position; is its memory enough?"
    except ImportError as error:
        reason = f"a worker cannot load this software ({error}); install it there"
    except (OSError, CancelledError):
        reason = "the scheduler is gone"
    return Outcome(failures=[f"dask: {reason}; complete products are kept, run it again for the others"])


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


@contextmanager
def _started(cluster: type["LocalCluster"], workers: int) -> Iterator["LocalCluster"]:
    """Start workers on this machine."""
    with ExitStack() as stack:
        with _interrupts_ignored():
            try:
                # any free port for the dashboard: there may be other clusters
                made = cluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50)
            except (OSError, RuntimeError) as error:
                reason = str(error.__cause__ or error).splitlines()[0]
                raise DataError(f"--workers {workers}: no worker can be started ({reason})") from None
            stack.enter_context(made)
        yield made


def _connect(client: type["Client"], scheduler: str) -> "Client":
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other versions: each worker compares what counts
            return client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise DataError(f"{scheduler}: no dask scheduler answers ({error}); start one with `dask scheduler`") from None


def _versions() -> dict[str, str]:
    """Versions that must be the same everywhere, so that products are the same to the last byte."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"software": SOFTWARE, "python": python} | {
        name: version(name) for name in ("numpy", "scipy", "numba", "h5py")
    }


def _work(made_with: dict[str, str], source: Source, target: Path, options: Options, threads: int | None) -> Outcome:
    for name, here in _versions().items():
        if here != (wanted := made_with[name]):
            return Outcome(failures=[f"{platform.node()}: a worker has {name} {here}; expected {wanted} as here"])
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
    from sounder.cir.responses import correlator_of
    from sounder.mpc.extract import extract_mpcs

    sounder = job.recording.sounder
    correlator = correlator_of(job.recording.kind, sounder)
    correlator.accumulator().add(np.zeros((1, correlator.samples, 2), np.int16))
    shape = {"azimuth": 1, "elevation": 1, "delay": sounder.waveform.samples}
    coords = {name: np.arange(size) for name, size in shape.items()}
    silence = np.zeros(tuple(shape.values()), np.complex64)
    with suppress(DataError):  # processing the positions will report what is wrong with the calibration
        extract_mpcs(xr.Dataset({"cir": (tuple(shape), silence)}, coords=coords), FilterCache().get(job)[0], sounder)
