"""Compile kernels before they are needed by many."""

import numpy as np

from sounder.kernels.correlation.captures import Correlator


def warm(correlator: Correlator, *, complex_captures: bool = False) -> None:
    """Compile what a correlator needs for averaging, and keep it in the cache (`compile`).

    Call it in one process before others start: they load the machine code instead of compiling it each.

    Parameters
    ----------
    correlator : Correlator
    complex_captures : bool
        Compile for complex64 captures instead of int16.
    """
    shape = (1, correlator.samples)
    captures = np.zeros(shape, np.complex64) if complex_captures else np.zeros((*shape, 2), np.int16)
    sums = correlator.accumulator()
    sums.add(captures)
    sums.result()
