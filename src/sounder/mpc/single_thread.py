"""Linear algebra on one thread, whose sums are the same to the last bit on any machine of a kind.

BLAS shares large products among as many threads as there are processors, or as ``OMP_NUM_THREADS`` says, as dask does
for its workers; each number of threads adds in an order of its own.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import OpenBLASController, threadpool_limits

_lock = threading.Lock()
_limits: list[threadpool_limits] = []
_inside = 0


@contextmanager
def one_thread() -> Iterator[None]:
    """Have BLAS use one thread of each thread that calls it.

    BLAS knows one number for the whole process: the first to come sets it, the last to go sets it back.
    """
    global _inside
    with _lock:
        if _inside == 0:
            _let_any_thread_set()
            _limits.append(threadpool_limits(1, user_api="blas"))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _let_any_thread_set()
                _limits.pop().restore_original_limits()
                _let_any_thread_set()


def _let_any_thread_set() -> None:
    """Since threadpoolctl 3.8 limits are silently kept unless the thread that set any first, if alive, changes them."""
    clear = getattr(OpenBLASController, "clear_controlling_thread", None)
    if clear is not None:
        clear(force=True)
