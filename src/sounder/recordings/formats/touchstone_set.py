"""A folder of touchstone files, one for each direction of a scan; their names hold the direction."""

import re
from itertools import product
from pathlib import Path

import numpy as np

from erm.common.errors import DataError
from sounder.instrument.touchstone import read_s21
from sounder.recordings.formats.content import Content

NUMBER = r"([+-]?\d+(?:[.p]\d+)?)"
"""A number in the name of a file; ``p`` may stand for the point."""
MAX_FILES = 100_000
"""Most files of a set; chosen: one degree in both angles."""


def content(folder: Path, pattern: str) -> Content:
    """Read S21 of all files of a set.

    Parameters
    ----------
    folder : Path
    pattern : str
        Names of the files, with ``{azimuth}`` and ``{elevation}`` for the angles [degree], as in
        ``"az{azimuth}_el{elevation}.s2p"``. Other files are left alone.

    Returns
    -------
    Content
        ``s21`` (azimuth, elevation, frequency), NaN in directions without a file, ``azimuth``, ``elevation``,
        ``frequency``.

    Raises
    ------
    DataError
        No file fits the pattern, two are of one direction, or their frequencies differ.
    """
    parts = re.split(r"\{(azimuth|elevation)\}", pattern)
    order = parts[1::2]
    expression = re.compile("".join(NUMBER if k % 2 else re.escape(part) for k, part in enumerate(parts)))
    found: dict[tuple[float, float], Path] = {}
    for _, path in zip(range(MAX_FILES), sorted(folder.iterdir()), strict=False):
        if (match := expression.fullmatch(path.name)) is None:
            continue
        angles = dict(zip(order, (float(text.replace("p", ".")) for text in match.groups()), strict=True))
        direction = angles.get("azimuth", 0.0), angles.get("elevation", 0.0)
        if direction in found:
            raise DataError(f"{path}: has the same direction as {found[direction].name}; expected one file for each")
        found[direction] = path
    if not found:
        raise DataError(f"{folder}: no file is named as {pattern}, by captures.files of the layout")
    azimuth, elevation = (sorted({direction[axis] for direction in found}) for axis in (0, 1))
    frequency, s21 = None, None
    for (a, one), (e, other) in product(enumerate(azimuth), enumerate(elevation)):
        if (one, other) not in found:
            continue
        own, values = read_s21(found[one, other])
        if frequency is None or s21 is None:
            frequency = own
            s21 = np.full((len(azimuth), len(elevation), own.size), np.nan + 0j)
        if not np.array_equal(own, frequency):
            raise DataError(
                f"{found[one, other]}: has other frequencies than the first file of the set; expected the same in all"
            )
        s21[a, e] = values
    arrays = {"s21": s21, "azimuth": np.array(azimuth), "elevation": np.array(elevation), "frequency": frequency}
    return Content("set of touchstone files", arrays, files=tuple(found.values()))
