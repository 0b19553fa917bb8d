"""Averages of many directions, shared among threads."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from erm.common.errors import DataError
from sounder.kernels.correlation.captures import Averages, Captures, Correlator

# Enough tasks a thread that none waits long for the last one.
TASKS_PER_THREAD = 4


def processors() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def average_directions(iq: Captures, correlator: Correlator, threads: int | None = None) -> Averages:
    """Average the correlation of each direction over its snapshots.

    A direction is averaged by one thread from its first snapshot to its last, so that the result does not
    depend on the number of threads, to the last bit. Safe to call from several threads at once.

    Parameters
    ----------
    iq : array
        int16 (direction, snapshot, sample, 2) or complex64 (direction, snapshot, sample), C-contiguous or a
        memory map of such.
    correlator : Correlator
    threads : int, optional
        All processors of this process if not given.

    Returns
    -------
    correlation : complex64 (direction, sample)
        Coherent mean.
    power : float64 (direction, sample)
        Mean of the squared magnitude.
    """
    if threads is None:
        threads = processors()
    if threads < 1:
        raise DataError(f"threads: {threads}, expected 1 or more; leave the option out to use all processors")
    directions = len(iq)
    correlation = np.empty((directions, correlator.samples), np.complex64)
    power = np.empty((directions, correlator.samples))

    def task(some: slice) -> None:
        correlator.average_directions(iq[some], correlation[some], power[some])

    size = -(-directions // (threads * TASKS_PER_THREAD)) or 1
    tasks = [slice(first, first + size) for first in range(0, directions, size)]
    if threads == 1 or len(tasks) < 2:
        for some in tasks:
            task(some)
        return correlation, power
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(task, tasks):
            pass
    return correlation, power
