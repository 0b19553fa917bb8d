"""Memory that the fits of paths work in, allocated once for an extraction."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.extraction.records import FIT_BEAMS, TRIAL
from sounder.kernels.extraction.scan_view import ScanView

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

TRIALS = 10
"""Directions that an angle fit at the edge of the fan starts from: the beam's own, and three azimuths at each of three
elevations beyond it."""


class Workspace(NamedTuple):
    """Memory of the fits.

    Attributes
    ----------
    pulse, matched, inner : array complex (tap,)
        Samples of the pulse, of the matched filter, and of the pulse under that filter.
    near : array (2, beam)
        Beams of a fit at arrival and departure, ended with -1.
    weight : array (2, beam)
        Their patterns toward the path.
    magnitude : array (beam,)
        The path's magnitudes in those at one end.
    trials : array of `TRIAL` (trial,)
    sidelobes : array (beam, 3)
        Power before a path, at its delay and after it in the beams far from it, -1 in the others [noise power].
    """

    pulse: Complex
    matched: Complex
    inner: Complex
    near: npt.NDArray[np.int64]
    weight: Real
    magnitude: Real
    trials: npt.NDArray[np.record]
    sidelobes: Real


def workspace(view: ScanView) -> Workspace:
    """Allocate what fits in a scan need."""
    pulse, matched = (2 * (table.size // (2 * view.oversampling) - 1) + 1 for table in (view.pulse, view.matched))
    return Workspace(
        pulse=np.empty(pulse, complex),
        matched=np.empty(matched, complex),
        inner=np.empty(matched, complex),
        near=np.empty((2, FIT_BEAMS + 1), np.int64),
        weight=np.empty((2, FIT_BEAMS)),
        magnitude=np.empty(FIT_BEAMS),
        trials=np.empty(TRIALS, TRIAL),
        sidelobes=np.empty((max(view.arrival.beams.size, view.departure.beams.size), 3)),
    )
