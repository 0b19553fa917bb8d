"""The fastest Fourier transforms in single precision that are installed."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.complex64]
LARGEST_FAST_FACTOR = 13
"""Largest prime factor of a length for which the libraries have a transform of their own; others take up to four times
as long (`benchmarks/orders.py`)."""


class Transforms(NamedTuple):
    """Forward and backward transform of rows, not scaled; the argument may be overwritten."""

    forward: Callable[[Rows], Rows]
    backward: Callable[[Rows], Rows]


@cache
def fastest_transforms() -> Transforms:
    """Those of MKL where ``mkl_fft`` is installed, of FFTW where ``pyfftw`` is, and of scipy otherwise.

    Examples
    --------
    >>> row = np.ones((1, 4), np.complex64)
    >>> fastest_transforms().forward(row.copy()).real.tolist()
    [[4.0, 0.0, 0.0, 0.0]]
    """
    for made in (_mkl, _fftw):
        try:
            return made()
        except ImportError:
            continue
    from scipy.fft import fft, ifft

    return Transforms(_rows(fft, overwrite_x=True), _rows(ifft, norm="forward", overwrite_x=True))


def _mkl() -> Transforms:
    import mkl_fft

    # not in place: mkl_fft 2 is wrong there for single long rows
    return Transforms(_rows(mkl_fft.fft, axis=1), _rows(mkl_fft.ifft, axis=1, norm="forward"))


def _fftw() -> Transforms:
    from pyfftw.interfaces import cache as plans
    from pyfftw.interfaces.scipy_fft import fft, ifft

    plans.enable()
    options: dict[str, Any] = {"planner_effort": "FFTW_MEASURE", "overwrite_x": True}
    return Transforms(_rows(fft, **options), _rows(ifft, norm="forward", **options))


def _rows(transform: Callable[..., Any], **options: Any) -> Callable[[Rows], Rows]:
    return partial(transform, **options)


def fast_length(period: int) -> int:
    """Length of transforms for a circular convolution of a period: itself, or twice as long, where that is faster.

    Examples
    --------
    >>> fast_length(1022), fast_length(8190)  # 2 * 7 * 73 and 2 * 3**2 * 5 * 7 * 13
    (2048, 8190)
    """
    from scipy.fft import next_fast_len

    rest = period
    for factor in range(2, LARGEST_FAST_FACTOR + 1):
        while rest % factor == 0:
            rest //= factor
    return period if rest == 1 else int(next_fast_len(2 * period))
