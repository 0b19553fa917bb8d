"""Remarks about all positions of a campaign together: errors that their direct paths share, and conventions."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from erm.common.console import counted
from erm.common.constants import c
from erm.common.errors import DataError
from erm.mpcs.files import read_product
from erm.mpcs.reasons import Reason
from erm.survey.calibration import NAMES, UNITS, calibrate
from erm.survey.conventions import contradictions, offsets
from sounder.parameters.path_loss import free_space_path_loss
from sounder.quality.line_of_sight import SIGMAS
from sounder.remark import MAX_NAMED_DIRECTIONS

LEAST_ERRORS = {"heading": 0.5, "clock": 0.1e-9, "gain": 2.0}
"""Common errors that are told [degree], [s], [dB]: beyond those that a careful survey and calibration leave. Chosen."""
MAX_UNDER_FREE_SPACE = 20.0
"""Loss of a direct path over free space that is told [dB]: with a line of sight no antenna is so far off. Chosen."""


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
        Empty if less than three direct paths agree.

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
    return remarks_on_table(xr.concat(tables, dim="mpc")) if len(tables) > 1 else []


def remarks_on_table(table: xr.Dataset) -> list[str]:
    """Lines about errors that the direct paths of an MPC table share.

    Parameters
    ----------
    table : xarray.Dataset
        MPCs of several positions (`erm.make_table`).
    """
    lines = [f"all positions together: {cause.text}" for cause in contradictions(table)]
    if lines:
        return lines
    found = calibrate(table)
    lines = [f"all positions together: {cause.text}" for cause in offsets(table, found.ambiguous)]
    for name in NAMES:
        value, std = getattr(found, name), found.std(name)
        if name not in found.ambiguous and abs(value) > max(LEAST_ERRORS[name], SIGMAS * std):
            scale, unit = (1e9, "ns") if name == "clock" else (1.0, UNITS[name])
            lines.append(
                f"all positions together: {found.direct_paths} direct paths share an error of {name} of "
                f"{value * scale:+.2f} {unit} (standard error {std * scale:.2f}); {ADVICE[name]}"
            )
    return lines


def remarks_on_power(table: xr.Dataset, located: xr.Dataset, names: Sequence[str]) -> list[str]:
    """Lines about positions without MPCs, and about direct paths far under free space.

    Parameters
    ----------
    table, located : xarray.Dataset
        MPCs of all positions, as measured and from :func:`erm.reconstruct`, which removes a common error of the gains.
    names : sequence of str
        All positions.

    Examples
    --------
    >>> columns = {"position": ["RX1"], "reason": ["direct_path"], "los": [1], "path_gain": [-140.0]}
    >>> table = xr.Dataset({name: ("mpc", values) for name, values in columns.items()})
    >>> table["delay"], table["frequency"] = ("mpc", [1e-7]), ("mpc", [132e9])
    >>> located = table.assign(path_gain=table["path_gain"] + 30)
    >>> for line in remarks_on_power(table, located, ["RX1", "RX2"]):
    ...     print(line)
    1 of 2 positions without any MPC: RX2; check antennas, gains and the back-to-back
    1 of 1 direct path 35 dB or more under free space: RX1; check attenuator, antenna gains and the line of sight
    """
    lines = []
    empty = [name for name in names if name not in set(located["position"].values.astype(str))]
    if empty:
        lines.append(
            f"{len(empty)} of {counted(len(names), 'position')} without any MPC: {_few(empty)}; check antennas, gains "
            "and the back-to-back"
        )
    direct = table.isel(
        mpc=np.flatnonzero((located["reason"].values == Reason.DIRECT_PATH) & (located["los"].values == 1))
    )
    under = -direct["path_gain"].values - free_space_path_loss(direct["delay"].values * c, direct["frequency"].values)
    weak = np.flatnonzero(under >= MAX_UNDER_FREE_SPACE)
    if weak.size:
        least = int(np.floor(under[weak].min()))
        found = list(dict.fromkeys(direct["position"].values[weak].astype(str).tolist()))
        lines.append(
            f"{weak.size} of {counted(under.size, 'direct path')} {least} dB or more under free space: {_few(found)}; "
            "check attenuator, antenna gains and the line of sight"
        )
    return lines


def _few(names: Sequence[str]) -> str:
    """The first names, and the number of the others."""
    shown = ", ".join(names[:MAX_NAMED_DIRECTIONS])
    return shown if len(names) <= MAX_NAMED_DIRECTIONS else f"{shown} and {len(names) - MAX_NAMED_DIRECTIONS} more"


ADVICE = {
    "heading": "check the zero of the azimuths",
    "clock": "check trigger, clock and back-to-back",
    "gain": "check attenuator, scale_factor and antenna gains",
}
