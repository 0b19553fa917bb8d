"""Files of measured antenna patterns: principal cuts, or a grid of azimuths and elevations."""

import re
from pathlib import Path

import numpy as np

from erm.common.errors import DataError

CUT_HEADER = "angle,azimuth,elevation"
GRID_HEADER = re.compile(r"^\W*azimuth\b.*\belevation\b", re.IGNORECASE)


def read_cut(path: Path) -> dict[str, list[float]]:
    """Read the principal cuts of an antenna [dB over degree].

    Parameters
    ----------
    path : Path
        Cuts: CSV with the header ``angle,azimuth,elevation``.

        Grid: rows of azimuth, elevation and level [dB], separated by commas or blanks, below a line that starts with
        azimuth and names elevation. Lines above it and further columns are not read, so that far-field listings can be
        used as they are. The cuts are the rows through boresight (0, 0), linear between the points of the grid. Both
        angles are in the frame of the antenna; see :func:`sounder.instrument.antenna_pattern.off_boresight`.

    Returns
    -------
    dict
        ``angle``, ``azimuth`` and ``elevation``, of one length; see `sounder.instrument.antenna_description.Cut`.

    Raises
    ------
    DataError
        The file is missing, or is neither cuts nor a full grid.

    Examples
    --------
    >>> from sounder import shipped
    >>> cut = read_cut(shipped.calibration("horn-132ghz.csv"))
    >>> cut["azimuth"][cut["angle"].index(5)]
    -3.027
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}; expected an antenna cut (CSV: {CUT_HEADER})") from None
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: {error}; expected numbers under the header {CUT_HEADER}") from None
    headers = [i for i, line in enumerate(lines) if GRID_HEADER.match(line)]
    if headers:
        return _principal_cuts(path, _numbers(path, lines[headers[0] + 1 :], "azimuth, elevation, level"))
    rows = _numbers(path, lines[1:], CUT_HEADER)
    if not lines or lines[0].strip() != CUT_HEADER or any(len(row) != 3 for row in rows):
        raise DataError(f"{path}: not an antenna cut; expected CSV with the header {CUT_HEADER}")
    return {name: [row[i] for row in rows] for i, name in enumerate(CUT_HEADER.split(","))}


def _numbers(path: Path, lines: list[str], header: str) -> list[list[float]]:
    try:
        return [[float(field) for field in line.replace(",", " ").split()] for line in lines if line.strip()]
    except ValueError as error:
        raise DataError(f"{path}: {error}; expected numbers under the header {header}") from None


def _principal_cuts(path: Path, rows: list[list[float]]) -> dict[str, list[float]]:
    if not rows or min(len(row) for row in rows) < 3:
        raise DataError(f"{path}: not an antenna grid; expected rows of azimuth, elevation and level [dB]")
    table = np.array([row[:3] for row in rows])
    azimuth, azimuth_index = np.unique(table[:, 0], return_inverse=True)
    elevation, elevation_index = np.unique(table[:, 1], return_inverse=True)
    level = np.full((azimuth.size, elevation.size), np.nan)
    level[azimuth_index, elevation_index] = table[:, 2]
    if level.size != len(rows) or np.isnan(level).any():
        raise DataError(
            f"{path}: {len(rows)} rows on {azimuth.size} azimuths and {elevation.size} elevations; expected a full "
            "grid with each direction once"
        )
    angle = np.union1d(azimuth, elevation)
    azimuth_cut = np.array([np.interp(0, elevation, row) for row in level])
    elevation_cut = np.array([np.interp(0, azimuth, row) for row in level.T])
    return {
        "angle": angle.tolist(),
        "azimuth": np.interp(angle, azimuth, azimuth_cut).tolist(),
        "elevation": np.interp(angle, elevation, elevation_cut).tolist(),
    }
