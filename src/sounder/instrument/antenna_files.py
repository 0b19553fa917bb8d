"""Files of measured antenna patterns: principal cuts, or a grid of azimuths and elevations."""

import re
from pathlib import Path

import numpy as np

from erm.common.errors import DataError

CUT = "angle,azimuth,elevation"
GRID = re.compile(r"^\W*azimuth\b.*\belevation\b", re.IGNORECASE)


def read_cut(path: Path) -> dict[str, list[float]]:
    """Read the principal cuts of an antenna [dB over degree].

    Parameters
    ----------
    path : Path
        CSV with the header ``angle,azimuth,elevation``; or a grid: a line that begins with azimuth and names elevation
        heads rows of azimuth, elevation, level [dB] and more that is not read, with commas or blanks between, after any
        other lines, as far-field listings have it. Both angles are in the frame of the antenna, which
        :func:`sounder.instrument.antenna_pattern.off_boresight` tilts with it. Of a grid the rows through boresight
        (0, 0) are taken, linear between its points, and the pattern is their product.

    Returns
    -------
    dict
        ``angle``, ``azimuth`` and ``elevation``, of one length.

    Raises
    ------
    DataError
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}; expected an antenna cut (CSV: {CUT})") from None
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: {error}; expected numbers under the header {CUT}") from None
    heads = [i for i, line in enumerate(lines) if GRID.match(line)]
    if heads:
        return _principal(path, _numbers(path, lines[heads[0] + 1 :], "azimuth, elevation, level"))
    rows = _numbers(path, lines[1:], CUT)
    if not lines or lines[0].strip() != CUT or any(len(row) != 3 for row in rows):
        raise DataError(f"{path}: not an antenna cut; expected CSV with the header {CUT}")
    return {name: [row[i] for row in rows] for i, name in enumerate(CUT.split(","))}


def _numbers(path: Path, lines: list[str], header: str) -> list[list[float]]:
    try:
        return [[float(field) for field in line.replace(",", " ").split()] for line in lines if line.strip()]
    except ValueError as error:
        raise DataError(f"{path}: {error}; expected numbers under the header {header}") from None


def _principal(path: Path, rows: list[list[float]]) -> dict[str, list[float]]:
    if not rows or min(len(row) for row in rows) < 3:
        raise DataError(f"{path}: not an antenna grid; expected rows of azimuth, elevation and level [dB]")
    table = np.array([row[:3] for row in rows])
    azimuth, column = np.unique(table[:, 0], return_inverse=True)
    elevation, line = np.unique(table[:, 1], return_inverse=True)
    level = np.full((azimuth.size, elevation.size), np.nan)
    level[column, line] = table[:, 2]
    if level.size != len(rows) or np.isnan(level).any():
        raise DataError(
            f"{path}: {len(rows)} rows on {azimuth.size} azimuths and {elevation.size} elevations; expected a full "
            "grid, each direction once"
        )
    angle = np.union1d(azimuth, elevation)
    level_at_0 = np.array([np.interp(0, elevation, along) for along in level])
    up_at_0 = np.array([np.interp(0, azimuth, along) for along in level.T])
    return {
        "angle": angle.tolist(),
        "azimuth": np.interp(angle, azimuth, level_at_0).tolist(),
        "elevation": np.interp(angle, elevation, up_at_0).tolist(),
    }
