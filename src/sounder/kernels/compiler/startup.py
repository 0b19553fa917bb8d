"""How the commands start: without what they need not do although what they import would, and compiling at once."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def start_processing() -> None:
    """Import what processing needs, while what is not compiled yet is compiled by a process of its own.

    xarray and numba are kept from looking for dask and SciPy's BLAS, which no product and no kernel needs: a third of
    the time. Both look once, and then know that it is not there; so this is for a process of our own, not for a
    library. dask itself can still be imported.
    """
    start_compiling()
    from sounder.kernels.compiler.by_address import compile_meanwhile
    from sounder.kernels.extraction.fit_path import fit

    compile_meanwhile(fit, "sounder.kernels.compiler.ahead")
    with _hidden("dask"):
        import xarray as xr

        xr.Variable((), 0.0)


def start_compiling() -> None:
    """Import numba, and have the garbage collector look less often: compiling makes many objects and little garbage."""
    gc.set_threshold(50_000, 20, 50)
    with _hidden("scipy.linalg"):
        import numba.np.arraymath  # noqa: F401 (to have it look now)


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
