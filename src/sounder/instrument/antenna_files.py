"""Files of measured or simulated antenna patterns: principal cuts, or a grid of directions."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.text_files import read_text, split_table
from sounder.instrument.antenna_cut import between_rows

CUTS = ("angle", "azimuth", "elevation")
MAX_SIZE = 2**26
"""Largest file of a pattern [byte]; chosen: a grid of tenths of a degree has 6 million points."""
EXPECTED = f"an antenna cut (CSV: {','.join(CUTS)}), a grid of directions, or a Planet file (MSI)"
DIRECTIONS = (("azimuth", "elevation"), ("theta", "phi"), ("phi", "theta"))
"""First two columns of a grid."""
NAME = re.compile(r"[a-z.|_]+(?:\s*(?:\([^)]*\)|\[[^\]]*\]))*")
"""Name of a column, with its units in brackets."""
LOSS = re.compile(r"loss|attenuation")
PLANET = re.compile(r"(horizontal|vertical)\s+(\d+)", re.IGNORECASE)
PLANET_GAIN = re.compile(r"gain\s+([-+.\d]+)\s*(dbi|dbd)", re.IGNORECASE)
DIPOLE_GAIN = 2.15
"""Gain of a half-wave dipole, the reference of dBd [dBi]."""

Real = NDArray[np.float64]


def read_cut(path: Path) -> dict[str, Any]:
    """Read the principal cuts of an antenna [dB over degree].

    Angles may go from -180 to 180 or from 0 to 360. The separator may be a comma, semicolon or tab, that of a grid also
    blanks. Lines that start with ``#`` are not read.

    Parameters
    ----------
    path : Path
        One of these; what a column is stands in its header:

        Cuts: a table with the columns ``angle``, ``azimuth`` and ``elevation``.

        Grid of azimuth and elevation (NSI and similar): rows of azimuth, elevation and level [dB], below a line that
        starts with azimuth and names elevation. Lines above it are not read. Both angles are in the frame of the
        antenna; see :func:`sounder.instrument.antenna_pattern.off_boresight`.

        Grid of theta and phi (CST, HFSS): the same with these two. Boresight is theta 0. Theta at phi 0 is the angle to
        the left in the horizontal cut, theta at phi 90 the angle up in the vertical cut.

        Planet file (MSI): loss [dB] below ``HORIZONTAL`` over the angle clockwise from boresight, and below
        ``VERTICAL`` over the angle down from it.

    Returns
    -------
    dict
        ``angle``, ``azimuth`` and ``elevation``, of one length, and ``gain`` where the file states it in dBi or dBd;
        see `sounder.instrument.antenna_description.Cut`. Cuts of a grid are linear between its points.

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
    lines = [line for line in read_text(path, EXPECTED, limit=MAX_SIZE).splitlines() if not line.startswith("#")]
    for number, line in enumerate(lines):
        if PLANET.match(line):
            return _planet(path, lines)
        names = [re.sub(r"[\s(\[].*", "", name) for name in NAME.findall(line.lower().replace('"', ""))]
        if tuple(names[:2]) in DIRECTIONS:
            return _grid_cuts(path, lines[number:])
        if number == 0 and set(CUTS) <= set(names):
            break
    return _cuts(path, lines)


def _cuts(path: Path, lines: list[str]) -> dict[str, list[float]]:
    """Cuts of a table with a column for each."""
    wrong = DataError(f"{path}: not an antenna cut; expected {EXPECTED}")
    if not lines:
        raise wrong
    table = split_table("\n".join(lines), path, EXPECTED)
    if not set(CUTS) <= set(table.header) or any(len(row) != len(table.header) for row in table.rows):
        raise wrong
    angle, *levels = np.array([_numbers(path, table.column(name)) for name in CUTS])
    kept, places = np.unique(_signed(angle), return_index=True)
    return dict(zip(CUTS, [kept.tolist(), *(level[places].tolist() for level in levels)], strict=True))


def _planet(path: Path, lines: list[str]) -> dict[str, Any]:
    """Cuts of a Planet file. Its angles are clockwise, and down; its levels are losses."""
    cuts: dict[str, tuple[Real, Real]] = {}
    gain = None
    for number, line in enumerate(lines):
        if stated := PLANET_GAIN.match(line):
            gain = float(stated[1]) + (DIPOLE_GAIN if stated[2].lower() == "dbd" else 0.0)
        if head := PLANET.match(line):
            rows = [_numbers(path, row.split()) for row in lines[number + 1 : number + 1 + int(head[2])]]
            if len(rows) != int(head[2]) or any(len(row) != 2 for row in rows):
                raise DataError(f"{path}: {line.strip()}: expected as many lines of angle and loss [dB]")
            angle, loss = np.array(rows).T
            angle, places = np.unique(_signed(-angle), return_index=True)
            cuts[head[1].lower()] = angle, -loss[places]
    if len(cuts) != 2:
        raise DataError(f"{path}: has only the cut {next(iter(cuts))}; expected HORIZONTAL and VERTICAL")
    return _common_angles(cuts["horizontal"], cuts["vertical"]) | {"gain": gain}


def _grid_cuts(path: Path, lines: list[str]) -> dict[str, Any]:
    """Cuts through boresight of the grid below a header line."""
    names = NAME.findall(lines[0].lower().replace('"', ""))
    first, second, level = _rows(path, lines)
    if LOSS.search(names[2] if len(names) > 2 else ""):
        level = -level
    if names[0].startswith("azimuth"):
        azimuth, elevation, table = _full(path, _signed(first), second, level)
        horizontal = azimuth, np.array([np.interp(0, elevation, row) for row in table])
        vertical = elevation, np.array([np.interp(0, azimuth, row) for row in table.T])
    else:
        theta, phi = (first, second) if names[0].startswith("theta") else (second, first)
        if theta.min() < 0:  # boresight belongs to both halves of each cut
            both = np.flatnonzero(theta == 0)
            theta, phi = np.append(theta, theta[both]), np.append(phi + 180 * (theta < 0), phi[both] + 180)
            level = np.append(level, level[both])
        theta, phi, table = _full(path, np.abs(theta), phi % 360, level)
        left, up, right, down = (
            np.array([np.interp(side, phi, row, period=360) for row in table]) for side in (0, 90, 180, 270)
        )
        signed = np.concatenate([-theta[:0:-1], theta])
        horizontal = signed, np.concatenate([right[:0:-1], left])
        vertical = signed, np.concatenate([down[:0:-1], up])
    in_dbi = len(names) > 2 and "dbi" in names[2]
    return _common_angles(horizontal, vertical) | {"gain": float(level.max()) if in_dbi else None}


def _rows(path: Path, lines: list[str]) -> Real:
    """First three numbers (3, row) of each line below a header line."""
    separator = r"[;\t]" if re.search(r"[;\t]", lines[0]) else r"[,\s]+"
    rows = []
    for line in lines[1:]:
        cells = [cell for cell in re.split(separator, line.strip().replace('"', "")) if cell.strip()]
        if cells and set(cells[0]) - {"-", "="}:  # not a line under the header
            rows.append(_numbers(path, [cell.replace(",", ".") for cell in cells[:3]]))
    if not rows or min(map(len, rows)) < 3:
        raise DataError(f"{path}: not an antenna grid; expected rows of two angles and the level [dB]")
    return np.array(rows).T


def _full(path: Path, first: Real, second: Real, level: Real) -> tuple[Real, Real, Real]:
    """Values of the first (m,) and of the second angle (n,), and the level (m, n) of a full grid."""
    rows = np.unique(np.column_stack([first, second, level]), axis=0)  # a circle may close with its first direction
    first_values, first_index = np.unique(rows[:, 0], return_inverse=True)
    second_values, second_index = np.unique(rows[:, 1], return_inverse=True)
    table = np.full((first_values.size, second_values.size), np.nan)
    table[first_index, second_index] = rows[:, 2]
    if table.size != len(rows) or np.isnan(table).any():
        raise DataError(
            f"{path}: {len(rows)} directions of {first_values.size} and {second_values.size} angles; "
            "expected a full grid with each direction once"
        )
    return first_values, second_values, table


def _common_angles(horizontal: tuple[Real, Real], vertical: tuple[Real, Real]) -> dict[str, list[float]]:
    """Cuts over all angles of both; outside of its own angles a cut has its first or last level."""
    angle = np.union1d(horizontal[0], vertical[0])
    levels = [between_rows(angle, *cut).tolist() for cut in (horizontal, vertical)]
    return dict(zip(CUTS, [angle.tolist(), *levels], strict=True))


def _numbers(path: Path, cells: list[str]) -> list[float]:
    try:
        return [float(cell) for cell in cells]
    except ValueError as error:
        raise DataError(f"{path}: {error}; expected numbers of {EXPECTED}") from None


def _signed(angle: Real) -> Real:
    """Angle from -180 to 180 [degree]; both ends are kept as they are."""
    with np.errstate(invalid="ignore"):  # the description refuses an angle that is not finite, by its name
        return np.where(np.abs(angle) > 180, angle - 360 * np.round(angle / 360), angle)
