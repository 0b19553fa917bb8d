"""Reader of foreign HDF5 and MATLAB files, by a layout."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.recordings.foreign_file import ForeignFile, foreign_file, opener
from sounder.recordings.layout import Layout, Reference, Samples
from sounder.recordings.pulses import cut_around_peak, ideal_pulse
from sounder.recordings.recording import BackToBack, Captures, Recording, check
from sounder.recordings.sweep import sweep_tables

SCAN_AXES = ("position", "azimuth", "elevation", "direction")
"""Axes along which captures were made at different places or in different directions."""


def recordings(path: Path, layout: Layout, sounder: Sounder) -> list[Recording | DataError]:
    """Open every position of a foreign file. Samples of HDF5 files are not read.

    Parameters
    ----------
    path : Path
        HDF5 file (MATLAB 7.3 included) or older MATLAB file.
    layout : Layout
        Where the file stores what a recording needs.
    sounder : Sounder
        Description of the sounder. Keys of the layout override it.

    Returns
    -------
    list of Recording or DataError
        One for each position; the error in place of a position that cannot be used.

    Raises
    ------
    DataError
        The file does not have this layout.
    """
    with foreign_file(path) as file:
        described = _sounder(file, layout, sounder)
        descending = _is_descending(file, layout)
        azimuth, elevation, order = _grid(file, layout)
        shape = _shape(file, layout.captures)
        positions = shape.get("position", 1)
        directions = (azimuth.size, elevation.size)
        _require_lengths(path, layout.captures, shape, directions, described.waveform.samples)
        tx = file.points(layout.positions.tx, positions, "positions.tx")
        rx = file.points(layout.positions.rx, positions, "positions.rx")
        los = file.lines_of_sight(layout.positions.los, positions, "positions.los")
        scale = file.scale(layout.scale_factor, "scale_factor")
        each = (layout.captures, shape, directions)
        agc = _each_direction(file, layout.agc_gain, *each, "agc_gain")
        times = None if layout.time is None else _each_direction(file, layout.time, *each, "time")
    file_of_all = opener(path)
    found: list[Recording | DataError] = []
    for p in range(positions):
        recording = Recording(
            name=_name(layout, path, p),
            source=path,
            sounder=described,
            azimuth=azimuth,
            elevation=elevation,
            snapshots=shape.get("snapshot", 1),
            tx_position=tx[p],
            rx_position=rx[p],
            scale_factor=scale,
            agc_gain=agc[p][order],
            valid=np.ones(directions, bool),
            los=los[p],
            time=None if times is None else times[p][order],
            read=_reader(file_of_all, layout.captures, p, order, directions, descending),
            kind=layout.captures.kind,
        )
        try:
            check(recording, shape["sample"])
        except DataError as error:
            found.append(error)
        else:
            found.append(recording)
    return found


def back_to_back(path: Path, layout: Layout, sounder: Sounder) -> BackToBack | None:
    """Read the back-to-back captures of a foreign file.

    If the layout names none: that of an ideal instrument for responses, which may be calibrated already; else None.
    """
    block, kind = layout.back_to_back, layout.captures.kind
    with foreign_file(path) as file:
        described = _sounder(file, layout, sounder)
        if block is None:
            return ideal_pulse(path, described, kind, layout.captures.window)
        _shape(file, block)
        captures = _captures(file, block, {}, descending=_is_descending(file, layout))
        if kind == "cir":
            captures = cut_around_peak(captures, described.waveform.samples)
        scale = layout.scale_factor if block.scale_factor is None else block.scale_factor
        return BackToBack(
            source=path,
            sounder=described,
            captures=captures,
            scale_factor=file.scale(scale, "scale_factor"),
            attenuation=file.number(block.attenuation, "back_to_back.attenuation"),
            s21=None,
            includes_tx_antenna=block.includes_tx_antenna,
            kind=kind,
        )


def _each_direction(
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


def _sounder(file: ForeignFile, layout: Layout, sounder: Sounder) -> Sounder:
    """Sounder description after the keys of the layout replaced its own."""

    def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
        result = dict(base)
        for key, value in over.items():
            if isinstance(value, dict) and value.keys() & {"dataset", "attribute", "of"}:
                reference = Reference.from_tables(value, f"{file.path}: the layout's [sounder]: {key}")
                label = f"sounder: {key}"
                named = key == "name"
                result[key] = file.text(reference, label) if named else file.numbers(reference, label).tolist()
            elif isinstance(value, dict):
                result[key] = merged(result.get(key) or {}, value)
            else:
                result[key] = value
        return result

    tables = merged(sounder.model_dump(), layout.sounder)
    if set(layout.sounder.get("carrier", {})) == {"frequency"}:  # the oscillator of another carrier does not apply
        tables["carrier"] = {"frequency": tables["carrier"]["frequency"]}
    tables |= _of_responses(file, layout, tables)
    for name in ("tx_antenna", "rx_antenna"):
        if isinstance(tables.get(name), dict) and tables[name].get("pattern") != "cut":
            tables[name]["cut"] = None
    return Sounder.from_tables(tables, f"{file.path}: the layout's [sounder]")


def _is_descending(file: ForeignFile, layout: Layout) -> bool:
    """Whether the frequencies of transfer functions are in descending order."""
    if layout.captures.frequency is None:
        return False
    frequency = np.atleast_1d(file.numbers(layout.captures.frequency, "captures.frequency"))
    return bool(frequency[0] > frequency[-1])


def _of_responses(file: ForeignFile, layout: Layout, tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of the description that follow from the frequencies or from the sample rate of responses."""
    block = layout.captures
    if block.frequency is not None:
        found = sweep_tables(
            np.atleast_1d(file.numbers(block.frequency, "captures.frequency")).astype(float), file.path
        )
    elif block.sample_rate is not None:
        points = _shape(file, block)["sample"]
        found = {"waveform": {"points": points, "step": file.scale(block.sample_rate, "captures.sample_rate") / points}}
    else:
        return {}
    bandwidth = layout.sounder.get("processing", {}).get("bandwidth")  # that of another waveform does not apply
    return found | {"processing": {**tables["processing"], "bandwidth": bandwidth}}


def _grid(
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


def _shape(file: ForeignFile, block: Samples) -> dict[str, int]:
    """Length of every named axis."""
    node = file.node(block.dataset)
    if node.ndim != len(block.axes):
        raise DataError(
            f"{file.path}: {block.dataset} has {node.ndim} axes {node.shape}, but the layout names {len(block.axes)}: "
            f"{', '.join(block.axes)}"
        )
    shape = dict(zip(map(str, block.axes), node.shape, strict=True))
    if block.imaginary is not None and (other := file.node(block.imaginary).shape) != node.shape:
        raise DataError(f"{file.path}: {block.dataset} has shape {node.shape}, but {block.imaginary} has {other}")
    if (node.dtype.kind in "biuf") != (block.imaginary is not None or "iq" in block.axes):
        raise DataError(
            f"{file.path}: {block.dataset} is {node.dtype}; real numbers need the axis iq or the key imaginary, "
            "complex numbers need neither"
        )
    if shape.get("iq", 2) != 2:
        raise DataError(f"{file.path}: axis iq of {block.dataset} has length {shape['iq']}; expected 2 (I, Q)")
    return shape


def _require_lengths(
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


def _name(layout: Layout, path: Path, position: int) -> str:
    """Name of a position. Default: the name of the file, with a number if the layout has the axis position."""
    pattern = layout.positions.name
    if pattern is None:
        pattern = "{file}-{:02d}" if "position" in layout.captures.axes else "{file}"
    return pattern.format(position, file=path.stem)


def _complex_fields(path: Path, dataset: str, names: Sequence[str]) -> tuple[str, str]:
    """Names of the real and of the imaginary part of a record."""
    parts = {name.lower()[:1]: name for name in names}
    if len(names) != 2 or set(parts) != {"r", "i"}:
        raise DataError(
            f"{path}: {dataset} is a record of {', '.join(names)}; expected real and imaginary part, r and i"
        )
    return parts["r"], parts["i"]


def _reader(
    opened: Callable[[], ForeignFile],
    block: Samples,
    position: int,
    order: tuple[NDArray[np.intp], NDArray[np.intp]],
    directions: tuple[int, int],
    descending: bool,
) -> Callable[[int, int, slice], Captures]:
    """Reader of the captures of one direction, by its index in the ascending grid."""

    def read(azimuth: int, elevation: int, snapshots: slice) -> Captures:
        a, e = int(order[0][azimuth, 0]), int(order[1][0, elevation])
        direction = e * directions[0] + a if block.slowest == "elevation" else a * directions[1] + e
        where = {"position": position, "azimuth": a, "elevation": e, "direction": direction, "snapshot": snapshots}
        return _captures(opened(), block, where, descending=descending)

    return read


def _captures(file: ForeignFile, block: Samples, where: Mapping[str, Any], *, descending: bool = False) -> Captures:
    """Captures at ``where`` as (snapshot, sample, iq) if they are int16, otherwise complex64 (snapshot, sample).

    ``descending`` reverses the samples.
    """
    index = tuple(where.get(axis, slice(None)) for axis in block.axes)
    axes = [axis for axis in block.axes if axis in ("snapshot", "sample", "iq")]
    data = np.asarray(file.node(block.dataset)[index])
    if block.imaginary is not None:
        imaginary = np.asarray(file.node(block.imaginary)[index])
        data, axes = np.stack([data, imaginary], axis=-1), [*axes, "iq"]
    if data.dtype.names is not None:  # MATLAB 7.3 stores complex numbers as records (real, imag)
        fields = _complex_fields(file.path, block.dataset, data.dtype.names)
        data = data[fields[0]] + 1j * data[fields[1]]
    if "snapshot" not in axes:
        data, axes = data[None], ["snapshot", *axes]
    wanted = [axis for axis in ("snapshot", "sample", "iq") if axis in axes]
    data = np.transpose(data, [axes.index(axis) for axis in wanted])
    if descending:
        data = np.flip(data, axis=1)
    if data.dtype == np.int16 and "iq" in axes:
        return np.ascontiguousarray(data)
    if "iq" in axes:
        data = data[..., 0] + 1j * data[..., 1]
    return np.ascontiguousarray(data, dtype=np.complex64)
