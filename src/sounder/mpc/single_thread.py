"""Linear algebra on one thread, so that results do not depend on the number of threads.

BLAS shares large products among as many threads as there are processors, or as ``OMP_NUM_THREADS`` says, as dask does
for its workers. Each number of threads adds in an order of its own, and rounds differently.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import OpenBLASController, threadpool_limits

_lock = threading.Lock()
_limits: list[threadpool_limits] = []
_inside = 0


@contextmanager
def single_thread() -> Iterator[None]:
    """Have BLAS use one thread for each thread that calls it.

    The number is one for the whole process: the first context to be entered sets it, the last to be left restores it.
    """
    global _inside
    with _lock:
        if _inside == 0:
            _release_thread_control()
            _limits.append(threadpool_limits(1, user_api="blas"))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _release_thread_control()
                _limits.pop().restore_original_limits()
                _release_thread_control()


def _release_thread_control() -> None:
    """Let any thread change the limit.

    Since threadpoolctl 3.8 only the thread that first set one may, as long as it is alive.
    """
    clear = getattr(OpenBLASController, "clear_controlling_thread", None)
    if clear is not None:
        clear(force=True)
