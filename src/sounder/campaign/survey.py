"""Remarks about all positions of a campaign together: errors that their direct paths share, and conventions."""

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from erm.common.errors import DataError
from erm.mpcs.files import read_product
from erm.survey.calibration import NAMES, UNITS, calibrate
from erm.survey.conventions import contradictions

LEAST_ERRORS = {"heading": 0.5, "clock": 0.1e-9, "gain": 2.0}
"""Common errors that are told [degree], [s], [dB]: beyond those that a careful survey and calibration leave. Chosen."""
SIGMAS = 4.0
"""Standard errors beyond which they are told: one in 16000 by chance."""


def remarks_on_survey(products: Sequence[Path]) -> list[str]:
    """Lines about errors that the direct paths of several positions share.

    Parameters
    ----------
    products : sequence of path
        Products of ``sounder process``. What they mark as doubtful is used: an error that all positions share makes all
        of them doubtful.

    Returns
    -------
    list of str
        Empty if less than five direct paths agree.

    Examples
    --------
    >>> remarks_on_survey([])
    []
    """
    tables = []
    for product in products:
        try:
            tables.append(read_product(product, trusted=("delay", "azimuth", "elevation", "path_gain", "position"))[0])
        except DataError:  # told when it was made
            continue
    if len(tables) < 2:
        return []
    table = xr.concat(tables, dim="mpc")
    lines = [f"all positions together: {cause.text}" for cause in contradictions(table)]
    if lines:
        return lines
    found = calibrate(table)
    for name in NAMES:
        value, std = getattr(found, name), found.std(name)
        if name not in found.ambiguous and abs(value) > max(LEAST_ERRORS[name], SIGMAS * std):
            scale, unit = (1e9, "ns") if name == "clock" else (1.0, UNITS[name])
            lines.append(
                f"all positions together: {found.direct_paths} direct paths share an error of {name} of "
                f"{value * scale:+.2f} {unit} (standard error {std * scale:.2f}); {ADVICE[name]}"
            )
    return lines


ADVICE = {
    "heading": "check the zero of the azimuths",
    "clock": "check trigger, clock and back-to-back",
    "gain": "check attenuator, scale_factor and antenna gains",
}
