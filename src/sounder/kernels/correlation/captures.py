"""Captures as kernels take them, and averages as they give them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from erm.common.errors import DataError

Captures = npt.NDArray[Any]
Averages = tuple[npt.NDArray[np.complex64], npt.NDArray[np.float64]]


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
