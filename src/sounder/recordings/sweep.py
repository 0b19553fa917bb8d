"""Frequencies of a sweep: what they say about the sounder."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError

SPACING_TOLERANCE = 1e-3
"""How far a frequency may be off its place [steps]: the phase of the longest delay is then wrong by 0.4 degree at most,
as one step turns it by a whole turn."""


def sweep_tables(frequency: NDArray[np.float64], source: Path) -> dict[str, Any]:
    """Tables ``waveform`` and ``carrier`` of the description of a sounder that measures at these frequencies.

    The carrier is the frequency in the middle, of an even number the upper of the two.

    Parameters
    ----------
    frequency : array (frequency,)
        Ascending or descending [Hz].
    source : Path
        The file, for errors.

    Raises
    ------
    DataError
        They are not evenly spaced.

    Examples
    --------
    >>> sweep_tables(np.linspace(55e9, 65e9, 1001), Path("vna.mat"))
    {'waveform': {'points': 1001, 'step': 10000000.0}, 'carrier': {'frequency': 60000000000.0}}
    """
    ascending = np.sort(frequency)
    points = ascending.size
    step = float(ascending[-1] - ascending[0]) / max(points - 1, 1)
    even = ascending[0] + step * np.arange(points)
    monotonic = np.all(np.diff(frequency) > 0) or np.all(np.diff(frequency) < 0)
    if points < 2 or not monotonic or np.abs(ascending - even).max() > SPACING_TOLERANCE * step:
        raise DataError(
            f"{source}: the frequencies of the sweep are not evenly spaced; expected one constant step [Hz]"
        )
    return {"waveform": {"points": points, "step": step}, "carrier": {"frequency": float(even[points // 2])}}
