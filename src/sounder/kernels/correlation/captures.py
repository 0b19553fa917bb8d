"""Captures as kernels take them, and averages as they give them."""

from typing import Any

import numpy as np
import numpy.typing as npt

Captures = npt.NDArray[Any]
Averages = tuple[npt.NDArray[np.complex64], npt.NDArray[np.float64]]


def flat_captures(iq: Captures, samples: int) -> Captures:
    """View captures as flat I/Q numbers, int16 or float32 (snapshot, number), of the one type that kernels take.

    Copies only what is not C-contiguous, aligned and of the machine's byte order already.

    Parameters
    ----------
    iq : array
        int16 (snapshot, sample, 2) or complex64 (snapshot, sample).
    samples : int
        Samples of a capture.

    Raises
    ------
    ValueError
        Other types or shapes.

    Examples
    --------
    >>> flat_captures(np.array([[1 + 2j, 3 + 4j]], np.complex64), samples=2)
    array([[1., 2., 3., 4.]], dtype=float32)
    """
    iq = np.asarray(iq)
    is_complex = iq.dtype.kind == "c" and iq.dtype.itemsize == 8
    if not is_complex and not (iq.dtype.kind == "i" and iq.dtype.itemsize == 2 and iq.shape[-1:] == (2,)):
        raise ValueError(
            f"captures: {iq.dtype} of shape {iq.shape}; expected int16 (snapshot, sample, 2) or complex64 "
            "(snapshot, sample)"
        )
    shape = iq.shape if is_complex else iq.shape[:-1]
    if len(shape) != 2 or shape[1] != samples:
        raise ValueError(
            f"captures: shape {shape} before I and Q; expected (snapshot, {samples}); check order and samples per chip"
        )
    iq = np.require(iq, iq.dtype.newbyteorder("="), ["C", "A"])
    flat = iq.view(np.float32) if is_complex else iq.reshape(shape[0], 2 * samples)
    flat.flags.writeable = False
    return flat
