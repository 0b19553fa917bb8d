"""What is kept of a path that was found, and the scratch that its fit needs."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sounder.kernels.extraction.beam_fit import RESULTS, SUMS
from sounder.kernels.extraction.scan_view import OVER, View

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Beams = npt.NDArray[np.complex64]

DELAY = 0
AZIMUTH, ELEVATION, AMPLITUDE, VAR_AZIMUTH, VAR_ELEVATION, VAR_AMPLITUDE = range(1, 7)
AZIMUTH_ELEVATION, AZIMUTH_AMPLITUDE, ELEVATION_AMPLITUDE, MISFIT = range(7, 11)
LEFT_OVER, BEAM, OFF_BORESIGHT, ENERGY, LOWER, UPPER, ELEVATION_SPREAD, AMPLITUDE_SPREAD = range(11, 19)
ANEW = 19
"""Columns of the result: delay; what `beam_fit` tells, in its order; the power that the fit left around the peak, the
beam it was found in, the pattern's amplitude from that beam toward it, its squares summed over the beams of the fit,
the elevations between which it was fitted, and how far other directions lie that the beams do not exclude. The last
tells a fit whether to search the angles anew. It is no argument since a literal argument has numba compile a function,
and all that it calls, once more."""
COLUMNS = 20
STARTS = 10
"""Directions that an angle fit at the edge of the fan starts from."""
NEAR = 9
"""Beams of a fit: the one it was found in and those around it."""


class Work(NamedTuple):
    """Scratch of a fit: taps of the pulse and of the matched filter, beams, their weights, angles, bounds, sums."""

    pulse: Complex
    matched: Complex
    inner: Complex
    near: npt.NDArray[np.int64]
    weight: Real
    magnitude: Real
    free: Real
    bounds: Real
    fit: Real
    direction: Real
    slopes: Real
    sums: Real
    tried: Real
    far: Real


def work_of(view: View) -> Work:
    """Allocate what fits with this view need."""
    pulse, matched = (2 * (table.size // (2 * int(view.grid[OVER])) - 1) + 1 for table in (view.pulse, view.matched))
    return Work(
        np.empty(pulse, complex),
        np.empty(matched, complex),
        np.empty(matched, complex),
        np.empty(NEAR + 1, np.int64),
        *(np.empty(size) for size in (NEAR, NEAR, 2, 4, RESULTS, 4, 2, SUMS, (STARTS, 5), (view.beam.shape[0], 3))),
    )
