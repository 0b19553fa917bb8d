"""Axes of a foreign file: their lengths, the grid of directions, and values for each direction."""

from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.plain import Rows
from sounder.recordings.foreign_file import ForeignFile
from sounder.recordings.layout import Layout, Samples

SCAN_AXES = ("position", "azimuth", "elevation", "direction")
"""Axes along which captures were made at different places or in different directions."""


def grid(
    file: ForeignFile, layout: Layout
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Azimuths and elevations in ascending order [degree], and the index of each in the file."""
    azimuth = file.angles(layout.grid.azimuth, "grid.azimuth")
    elevation = file.angles(layout.grid.elevation, "grid.elevation")
    if layout.grid.azimuth_convention == "compass":
        azimuth = 90.0 - azimuth
    if layout.grid.elevation_convention == "zenith":
        elevation = 90.0 - elevation
    azimuth = azimuth % 360
    if np.abs(elevation).max() > 90:
        raise DataError(
            f"{file.path}: grid.elevation is outside -90 to 90 degrees above the horizon; for zenith angles set "
            'elevation_convention = "zenith"'
        )
    by_azimuth, by_elevation = np.argsort(azimuth), np.argsort(elevation)
    if np.unique(azimuth).size < azimuth.size or np.unique(elevation).size < elevation.size:
        raise DataError(f"{file.path}: the grid lists a direction twice; list each azimuth and elevation once")
    order = (by_azimuth[:, None], by_elevation[None, :])
    return azimuth[by_azimuth], elevation[by_elevation], order


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
    elif node.ndim != len(block.axes):
        raise DataError(
            f"{file.path}: {block.dataset} has {node.ndim} axes {node.shape}, but the layout names {len(block.axes)}: "
            f"{', '.join(block.axes)}"
        )
    else:
        found = dict(zip(map(str, block.axes), node.shape, strict=True))
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


def _lengths_of_row(
    file: ForeignFile, block: Samples, shape: tuple[int, ...], known: Mapping[str, int]
) -> dict[str, int]:
    """Lengths of the axes of samples in one row: those known, and one that follows from the number of samples."""
    who = f"{file.path}: {block.dataset}"
    shape = shape if len(shape) == 1 or 1 not in shape[:2] else shape[1:] if shape[0] == 1 else (shape[0], *shape[2:])
    if len(shape) != 1 + ("iq" in block.axes):
        raise DataError(f"{who} has shape {shape}; with flat = true expected one row of samples")
    axes = [axis for axis in block.axes if axis != "iq"]
    found = {str(axis): known[axis] for axis in axes if axis in known}
    if "sample" not in found:
        raise DataError(f"{who}: flat = true needs the number of samples of a capture; describe the waveform")
    each = prod(found.values()) // found["sample"] * (block.stride or found["sample"])
    total = shape[0] - block.start
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
    """Dataset of a block with the axes of the layout, those of a row of samples included."""
    node = file.node(name)
    if not block.flat:
        return node
    row = np.asarray(node[()]).squeeze() if node.ndim > 1 + ("iq" in block.axes) else node
    full = [length for axis, length in shape.items() if axis != "iq"]
    return Rows(row, tuple(full), block.start, block.stride or full[-1])


def require_lengths(
    path: Path, block: Samples, shape: Mapping[str, int], directions: tuple[int, int], samples: int
) -> None:
    """Check the lengths of the axes against the grid, and against the capture if another axis has its length."""
    order = (
        f"{block.dataset} is {tuple(shape.values())}, read as {', '.join(shape)}; "
        "list captures.axes in the order in which the file stores them"
    )
    for axis, length in zip(("azimuth", "elevation"), directions, strict=True):
        have = shape.get(axis, length if "direction" in shape else 1)
        if have != length:
            raise DataError(f"{path}: {have} captures along {axis}, but the grid has {length} values; {order}")
    if "direction" in shape and shape["direction"] != directions[0] * directions[1]:
        wanted = f"{directions[0]} x {directions[1]}"
        raise DataError(f"{path}: {shape['direction']} directions, but the grid has {wanted} values; {order}")
    if shape["sample"] != samples and samples in shape.values():
        raise DataError(f"{path}: {shape['sample']} samples per capture, but the sequence has {samples}; {order}")


def each_direction(
    file: ForeignFile,
    value: Any,
    block: Samples,
    shape: Mapping[str, int],
    directions: tuple[int, int],
    label: str,
) -> NDArray[np.float64]:
    """Expand one number, one for each position, or one for each direction (along the axes of the captures) to the grid.

    Returns
    -------
    array (position, azimuth, elevation)
    """
    found = file.numbers(value, label).astype(float)
    axes = [axis for axis in block.axes if axis in SCAN_AXES]
    full = [shape[axis] for axis in axes]
    if found.shape == tuple(length for length in full if length > 1):
        found = found.reshape(full)
    elif found.shape == (shape.get("position", 1),) and "position" in axes:
        found = found.reshape([shape[axis] if axis == "position" else 1 for axis in axes])
    elif found.ndim:
        raise DataError(
            f"{file.path}: {label} has shape {found.shape}; expected one number, one for each position, or "
            f"{tuple(full)} along the axes of the captures, {', '.join(axes)}"
        )
    if not np.isfinite(found).all():
        raise DataError(f"{file.path}: {label} holds NaN or infinite values")
    found = np.broadcast_to(found, full)
    if "direction" in axes:
        at = axes.index("direction")
        split = ["elevation", "azimuth"] if block.slowest == "elevation" else ["azimuth", "elevation"]
        lengths = [directions[0] if axis == "azimuth" else directions[1] for axis in split]
        found = found.reshape([*full[:at], *lengths, *full[at + 1 :]])
        # `axes` is a list of literals, and `split` holds two of these, which the type checker sees as any text.
        axes[at : at + 1] = split  # type: ignore[assignment]
    wanted = ("position", "azimuth", "elevation")
    found = found.transpose([axes.index(axis) for axis in wanted if axis in axes])
    absent = tuple(i for i, axis in enumerate(wanted) if axis not in axes)
    return np.expand_dims(found, absent)
