"""Axes of a foreign file: their lengths, the grid of directions, and values for each direction."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.plain import Apart, Rows
from sounder.recordings.foreign_file import ForeignFile
from sounder.recordings.layout import Layout, Samples

DIRECTIONS = ("tx_azimuth", "tx_elevation", "azimuth", "elevation")
"""Axes along which captures were made in different directions."""
PLACES = ("position", "tx", "rx")
"""Axes along which captures were made at different places; the last changes first."""
SCAN_AXES = (*PLACES, *DIRECTIONS)
"""Axes along which captures were made at different places or in different directions."""


@dataclass(frozen=True)
class Grid:
    """Directions of a scan at both ends: angles in ascending order [degree], and the index of each in the file."""

    angles: dict[str, NDArray[np.float64]]
    order: dict[str, NDArray[np.intp]]

    @property
    def lengths(self) -> dict[str, int]:
        """Number of angles along each axis of `DIRECTIONS`."""
        return {axis: self.angles[axis].size for axis in DIRECTIONS}


def grid(file: ForeignFile, layout: Layout) -> Grid:
    """Directions of a scan, by the layout."""
    angles, order = {}, {}
    for prefix in ("tx_", ""):
        names = f"{prefix}azimuth", f"{prefix}elevation"
        found = _angles(file, layout, *names)
        for name, values in zip(names, found, strict=True):
            order[name] = np.argsort(values)
            angles[name] = values[order[name]]
    return Grid(angles, order)


def _angles(
    file: ForeignFile, layout: Layout, azimuth_name: str, elevation_name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuths and elevations of one end as the file orders them [degree]."""
    azimuth, elevation = (
        file.angles(getattr(layout.grid, name), f"grid.{name}") for name in (azimuth_name, elevation_name)
    )
    if layout.grid.azimuth_convention == "compass":
        azimuth = 90.0 - azimuth
    if layout.grid.elevation_convention == "zenith":
        elevation = 90.0 - elevation if elevation_name in layout.grid.model_fields_set else elevation
    azimuth = within_one_turn(azimuth)
    if np.abs(elevation).max() > 90:
        raise DataError(
            f"{file.path}: grid.{elevation_name} is outside -90 to 90 degrees above the horizon; for zenith angles set "
            'elevation_convention = "zenith"'
        )
    if np.unique(azimuth).size < azimuth.size or np.unique(elevation).size < elevation.size:
        raise DataError(f"{file.path}: the grid lists a direction twice; list each azimuth and elevation once")
    return azimuth, elevation


def within_one_turn(azimuth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Azimuths of a sector or a circle, so that neighbours are neighbours in ascending order [degree].

    They are from 0 to 360, unless the widest gap between two of them is elsewhere than at 0: those after it are then
    negative.

    Examples
    --------
    >>> within_one_turn(np.array([350.0, 0.0, 10.0, -20.0])).tolist()
    [-10.0, 0.0, 10.0, -20.0]
    """
    turned = azimuth % 360
    ascending = np.unique(turned)
    gaps = np.diff(ascending, prepend=ascending[-1] - 360)
    first = ascending[np.argmax(gaps)]
    return np.where(turned < first, turned, turned - 360) if first != ascending[0] else turned


def lengths(file: ForeignFile, block: Samples, known: Mapping[str, int] | None = None) -> dict[str, int]:
    """Length of every named axis.

    Parameters
    ----------
    file : ForeignFile
    block : Samples
    known : mapping, optional
        Lengths by the description, which a row of samples needs.
    """
    node = file.node(block.dataset)
    if block.flat:
        found = _lengths_of_row(file, block, node.shape, known or {})
    elif node.ndim != len(block.along):
        raise DataError(
            f"{file.path}: {block.dataset} has {node.ndim} axes {node.shape}, but the layout names {len(block.along)}: "
            f"{', '.join(' * '.join(group) for group in together(block))}"
        )
    else:
        found = {}
        for group, length in zip(together(block), node.shape, strict=True):
            found |= _lengths_along(file, block, group, length, known or {})
    if block.imaginary is not None and (other := file.node(block.imaginary).shape) != node.shape:
        raise DataError(f"{file.path}: {block.dataset} has shape {node.shape}, but {block.imaginary} has {other}")
    if (node.dtype.kind in "biuf") != (block.imaginary is not None or "iq" in block.axes):
        raise DataError(
            f"{file.path}: {block.dataset} is {node.dtype}; real numbers need the axis iq or the key imaginary, "
            "complex numbers need neither"
        )
    if found.get("iq", 2) != 2:
        raise DataError(f"{file.path}: axis iq of {block.dataset} has length {found['iq']}; expected 2 (I, Q)")
    return found


def together(block: Samples) -> list[list[str]]:
    """Names of the axes along each axis of the dataset."""
    axes = iter(map(str, block.axes))
    return [list(islice(axes, count)) for count in block.along]


def _lengths_along(
    file: ForeignFile, block: Samples, group: Sequence[str], length: int, known: Mapping[str, int]
) -> dict[str, int]:
    """Lengths of the axes that lie along one of the dataset: those known, and one that follows."""
    if len(group) == 1:
        return {group[0]: length}
    found = {axis: known[axis] for axis in group if axis in known}
    unknown, each = [axis for axis in group if axis not in found], prod(found.values())
    if len(unknown) > 1 or length % each or (not unknown and length != each):
        raise DataError(
            f"{file.path}: {block.dataset} has {length} captures along {' * '.join(group)}, but the grid has "
            f"{' x '.join(str(number) for number in found.values())} values; expected "
            f"{'one unknown length and a multiple of ' if unknown else ''}{each}"
        )
    found |= dict.fromkeys(unknown, length // each)
    return {axis: found[axis] for axis in group}


def _lengths_of_row(
    file: ForeignFile, block: Samples, shape: tuple[int, ...], known: Mapping[str, int]
) -> dict[str, int]:
    """Lengths of the axes of samples in one row: those known, and one that follows from the number of samples."""
    who = f"{file.path}: {block.dataset}"
    total = prod(shape) - block.start
    if "iq" in block.axes:
        if len(shape) < 2 or shape[-1] != 2:
            raise DataError(f"{who} has shape {shape}; expected I and Q along the last axis, as the layout names iq")
        total = prod(shape[:-1]) - block.start
    axes = [axis for axis in block.axes if axis != "iq"]
    found = {str(axis): known[axis] for axis in axes if axis in known}
    if "sample" not in found:
        raise DataError(f"{who}: flat = true needs the number of samples of a capture; describe the waveform")
    each = prod(found.values()) // found["sample"] * (block.stride or found["sample"])
    if len(unknown := [str(axis) for axis in axes if axis not in found]) > 1:
        raise DataError(
            f"{who}: flat = true, and the lengths of {' and '.join(unknown)} are not known; name one of them"
        )
    # the last capture may end where the row does, before a whole stride
    spare = (block.stride or found["sample"]) - found["sample"]
    count = (total + spare) // each
    exact = block.start or block.stride is not None or total == count * each
    if count < 1 or not exact or (not unknown and count != 1 and block.stride is None):
        raise DataError(
            f"{who} has {total} samples; expected {'a multiple of ' if unknown else ''}{each}, by the layout"
        )
    found |= dict.fromkeys(unknown, count)
    return {str(axis): found.get(axis, 2) for axis in block.axes}


def node_of(file: ForeignFile, block: Samples, name: str, shape: Mapping[str, int]) -> Any:
    """Dataset of a block with the axes of the layout, those that lie along one of the dataset apart."""
    node = file.node(name)
    if not block.flat:
        apart = [tuple(shape[axis] for axis in group) for group in together(block)]
        return node if len(apart) == len(shape) else Apart(node, tuple(apart))
    shape_of_iq = (2,) if "iq" in block.axes else ()
    row = np.asarray(node[()]).reshape(-1, *shape_of_iq) if node.ndim > 1 + len(shape_of_iq) else node
    full = [length for axis, length in shape.items() if axis != "iq"]
    return Rows(row, tuple(full), block.start, block.stride or full[-1])


def require_lengths(
    path: Path, block: Samples, shape: Mapping[str, int], directions: Mapping[str, int], samples: int
) -> None:
    """Check the lengths of the axes against the grid, and against the capture if another axis has its length."""
    order = (
        f"{block.dataset} is {tuple(shape.values())}, read as {', '.join(shape)}; "
        "list captures.axes in the order in which the file stores them"
    )
    for axis, length in directions.items():
        if (have := shape.get(axis, 1)) != length:
            raise DataError(f"{path}: {have} captures along {axis}, but the grid has {length} values; {order}")
    if shape["sample"] != samples and samples in shape.values():
        raise DataError(f"{path}: {shape['sample']} samples per capture, but the sequence has {samples}; {order}")


def each_direction(
    file: ForeignFile,
    value: Any,
    block: Samples,
    shape: Mapping[str, int],
    label: str,
) -> NDArray[np.float64]:
    """Expand one number, one for each position, or one for each direction (along the axes of the captures) to the grid.

    Returns
    -------
    array (position, tx_azimuth, tx_elevation, azimuth, elevation)
    """
    found = file.numbers(value, label).astype(float)
    groups = [[axis for axis in group if axis in SCAN_AXES] for group in together(block)]
    axes = [axis for group in groups for axis in group]
    full = [shape[axis] for axis in axes]
    lengths = [prod(shape[axis] for axis in group) for group in groups if group]
    if found.shape in [tuple(length for length in each if length > 1) for each in (full, lengths)]:
        found = found.reshape(full)
    elif found.shape == (shape.get("position", 1),) and "position" in axes:
        found = found.reshape([shape[axis] if axis == "position" else 1 for axis in axes])
    elif found.ndim:
        raise DataError(
            f"{file.path}: {label} has shape {found.shape}; expected one number, one for each position, or "
            f"{tuple(lengths)} along the axes of the captures, {', '.join(' * '.join(g) for g in groups if g)}"
        )
    if not np.isfinite(found).all():
        raise DataError(f"{file.path}: {label} holds NaN or infinite values")
    found = np.broadcast_to(found, full)
    found = found.transpose([axes.index(axis) for axis in SCAN_AXES if axis in axes])
    absent = tuple(i for i, axis in enumerate(SCAN_AXES) if axis not in axes)
    found = np.expand_dims(found, absent)
    return found.reshape(-1, *found.shape[len(PLACES) :])
