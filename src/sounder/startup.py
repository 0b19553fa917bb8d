"""What the commands need not do, although what they import would: a third of the time that they take to start."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def spare_imports() -> None:
    """Have xarray and numba not look for dask and SciPy's BLAS, which no product and no kernel needs.

    Both look once, and then know that it is not there; so this is for a process of our own, not for a library. dask
    itself can still be imported.
    """
    with _hidden("dask"):
        import xarray as xr

        xr.Variable((), 0.0)
    with _hidden("scipy.linalg"):
        import numba.np.arraymath  # noqa: F401 (to have it look now)


def collect_seldom() -> None:
    """Have the garbage collector look less often; importing and compiling make many objects and little garbage."""
    gc.set_threshold(50_000, 20, 50)


@contextmanager
def _hidden(module: str) -> Iterator[None]:
    """Have the import of a module fail, unless it was imported before."""
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]  # what Python itself calls a module not to be had
    try:
        yield
    finally:
        del sys.modules[module]
