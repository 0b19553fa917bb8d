"""Captures as kernels take them, averages as they give them, and what correlators have in common."""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from erm.common.errors import DataError

Captures = npt.NDArray[Any]
Averages = tuple[npt.NDArray[np.complex64], npt.NDArray[np.float64]]


class Accumulator(Protocol):
    """Averages of captures that arrive in blocks."""

    count: int

    def add(self, iq: Captures) -> None:
        """Add captures, int16 (snapshot, sample, 2) or complex64 (snapshot, sample)."""

    def result(self) -> Averages:
        """Return mean correlation and mean power of all captures so far; more may follow."""


class Correlator(Protocol):
    """Circular correlation with one template, and its averages; safe to share among threads."""

    samples: int

    def average(self, iq: Captures) -> Averages:
        """Average one direction: mean correlation, complex64 (sample,), and mean power, float64 (sample,)."""

    def average_directions(self, iq: Captures, correlation: Captures, power: Captures) -> None:
        """Average captures (direction, snapshot, ...) into the two given arrays (direction, sample)."""

    def correlate(self, iq: Captures) -> npt.NDArray[np.complex64]:
        """Correlate every capture by itself: complex64 (snapshot, sample)."""

    def correlate_mean(self, x: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Correlate one vector (sample,), such as an averaged capture, in float64: complex128 (sample,)."""

    def accumulator(self) -> Accumulator:
        """Return empty sums that are fed in blocks."""


def flat_captures(iq: Captures, samples: int, dims: int) -> Captures:
    """View captures as flat I/Q numbers, int16 or float32, of the one array type that kernels are compiled
    for.

    Copies only what is not C-contiguous, aligned and of the machine's byte order already.
    """
    iq = np.asarray(iq)
    is_complex = iq.dtype.kind == "c" and iq.dtype.itemsize == 8
    if not is_complex and not (iq.dtype.kind == "i" and iq.dtype.itemsize == 2 and iq.shape[-1:] == (2,)):
        raise DataError(
            f"captures: {iq.dtype} of shape {iq.shape}, expected int16 (..., sample, 2) or complex64 "
            "(..., sample); convert them"
        )
    shape = iq.shape if is_complex else iq.shape[:-1]
    if len(shape) != dims or shape[-1] != samples:
        raise DataError(
            f"captures: shape {shape} before I and Q, expected {samples} samples in {dims} dimensions; "
            "check order and samples a chip"
        )
    iq = np.require(iq, iq.dtype.newbyteorder("="), ["C", "A"])
    flat = iq.view(np.float32) if is_complex else iq.reshape(*shape[:-1], 2 * samples)
    flat.flags.writeable = False
    return flat
