"""Foreign HDF5 and MATLAB files, read as a layout says."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from erm.errors import DataError
from sounder.config import Sounder, parse
from sounder.layout import Layout, Reference, Samples
from sounder.readers.native import opened
from sounder.recording import BackToBack, Captures, Recording, check

CHUNK_CACHE = 64 * 2**20
"""Decompressed chunks kept by HDF5 for each position that is being read [byte]."""


def recordings(path: Path, layout: Layout, sounder: Sounder) -> list[Recording | DataError]:
    """Open every position of a foreign file; HDF5 samples are not read.

    Parameters
    ----------
    path : Path
        HDF5 (MATLAB 7.3 included) or older MATLAB file.
    layout : Layout
        Where everything is.
    sounder : Sounder
        The description that the layout's own keys override.

    Returns
    -------
    list of Recording or DataError
        One a position; what cannot be used stands as its error.

    Raises
    ------
    DataError
        The file is not as the layout says.
    """
    with _file(path) as file:
        described = _described(file, path, layout, sounder)
        azimuth, elevation, order = _grid(file, path, layout)
        shape = _shape(file, path, layout.captures)
        positions = shape.get("position", 1)
        directions = (azimuth.size, elevation.size)
        _require_grid(path, shape, directions)
        tx = _points(file, path, layout.positions.tx, positions, "positions.tx")
        rx = _points(file, path, layout.positions.rx, positions, "positions.rx")
        los = np.broadcast_to(_value(file, path, layout.positions.los, -1), positions).astype(int)
        scale = float(_value(file, path, layout.scale_factor, 1.0))
        agc = np.broadcast_to(_value(file, path, layout.agc_gain, 0.0), (positions, *directions))
        time = _value(file, path, layout.time, None)
        times = None if time is None else np.broadcast_to(time, (positions, *directions))
    found: list[Recording | DataError] = []
    for p in range(positions):
        recording = Recording(
            name=layout.positions.name.format(p),
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
            los=int(los[p]),
            time=None if times is None else times[p][order],
            read=_reader(path, layout.captures, p, order, directions),
        )
        try:
            check(recording, shape["sample"])
        except DataError as error:
            found.append(error)
        else:
            found.append(recording)
    return found


def back_to_back(path: Path, layout: Layout, sounder: Sounder) -> BackToBack | None:
    """Read the back-to-back captures a foreign file holds; None where the layout names none."""
    block = layout.back_to_back
    if block is None:
        return None
    with _file(path) as file:
        _shape(file, path, block)
        scale = layout.scale_factor if block.scale_factor is None else block.scale_factor
        return BackToBack(
            source=path,
            sounder=_described(file, path, layout, sounder),
            captures=_captures(file, path, block, {}),
            scale_factor=float(_value(file, path, scale, 1.0)),
            attenuation=float(_value(file, path, block.attenuation, 0.0)),
            s21=None,
            includes_tx_antenna=block.includes_tx_antenna,
        )


@contextmanager
def _file(path: Path) -> Iterator[Mapping[str, Any]]:
    """Open HDF5 lazily, older MATLAB files whole."""
    if path.suffix == ".mat" and path.is_file() and not h5py.is_hdf5(path):
        yield _matlab(path)
    else:
        with opened(path) as file:
            yield file


def _matlab(path: Path) -> dict[str, Any]:
    try:
        from pymatreader import read_mat
    except ImportError:
        raise DataError(f"{path}: older MATLAB files need the extra: pip install 'sounder-to-map[matlab]'") from None
    try:
        tables: dict[str, Any] = read_mat(path)
    except (ValueError, TypeError, OSError) as error:
        raise DataError(f"{path}: not a MATLAB file ({error})") from None
    return tables


def _node(file: Mapping[str, Any], path: Path, name: str) -> Any:
    node: Any = file
    for part in name.strip("/").split("/"):
        if not (isinstance(node, Mapping) and part in node):
            raise DataError(f"{path}: no dataset {name}; the layout names it")
        node = node[part]
    return node if isinstance(node, h5py.Dataset) else np.asarray(node)


def _value(file: Mapping[str, Any], path: Path, value: Any, default: Any) -> Any:
    """A layout's number or the thing it refers to, as an array."""
    if value is None:
        return default
    if not isinstance(value, Reference):
        return np.asarray(value)
    if value.dataset is not None:
        return np.asarray(_node(file, path, value.dataset)[()]).squeeze()
    node = file if value.of is None else _node(file, path, value.of)
    attributes = getattr(node, "attrs", {})
    if value.attribute not in attributes:
        raise DataError(f"{path}: no attribute {value.attribute}; the layout names it")
    return np.asarray(attributes[value.attribute]).squeeze()


def _described(file: Mapping[str, Any], path: Path, layout: Layout, sounder: Sounder) -> Sounder:
    """The sounder description with the layout's keys in place."""

    def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
        result = dict(base)
        for key, value in over.items():
            if isinstance(value, dict) and value.keys() <= {"dataset", "attribute", "of"} and value:
                result[key] = _value(file, path, Reference.model_validate(value), None).tolist()
            elif isinstance(value, dict):
                result[key] = merged(result.get(key) or {}, value)
            else:
                result[key] = value
        return result

    tables = merged(sounder.model_dump(), layout.sounder)
    for name in ("tx_antenna", "rx_antenna"):
        if isinstance(tables.get(name), dict) and tables[name].get("pattern") != "cut":
            tables[name]["cut"] = None
    return parse(tables, f"{path}: the layout's [sounder]")


def _grid(
    file: Mapping[str, Any], path: Path, layout: Layout
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Azimuth and elevation in rising order [degree], and the file's index of each."""
    azimuth = np.atleast_1d(_value(file, path, layout.grid.azimuth, None)).astype(float)
    elevation = np.atleast_1d(_value(file, path, layout.grid.elevation, None)).astype(float)
    if layout.grid.azimuth_convention == "compass":
        azimuth = 90.0 - azimuth
    if layout.grid.elevation_convention == "zenith":
        elevation = 90.0 - elevation
    azimuth = azimuth % 360
    by_azimuth, by_elevation = np.argsort(azimuth), np.argsort(elevation)
    if np.unique(azimuth).size < azimuth.size or np.unique(elevation).size < elevation.size:
        raise DataError(f"{path}: the grid names a direction twice; list each azimuth and elevation once")
    order = (by_azimuth[:, None], by_elevation[None, :])
    return azimuth[by_azimuth], elevation[by_elevation], order


def _shape(file: Mapping[str, Any], path: Path, block: Samples) -> dict[str, int]:
    """Length of every named axis."""
    node = _node(file, path, block.dataset)
    if node.ndim != len(block.axes):
        raise DataError(
            f"{path}: {block.dataset} has {node.ndim} axes {node.shape}; the layout names {len(block.axes)}"
        )
    shape = dict(zip(map(str, block.axes), node.shape, strict=True))
    if shape.get("iq", 2) != 2:
        raise DataError(f"{path}: axis iq of {block.dataset} has length {shape['iq']}; expected 2 (I, Q)")
    return shape


def _require_grid(path: Path, shape: dict[str, int], directions: tuple[int, int]) -> None:
    """Refuse a grid that is not the length of the captures' axes."""
    for axis, length in zip(("azimuth", "elevation"), directions, strict=True):
        have = shape.get(axis, length if "direction" in shape else 1)
        if have != length:
            raise DataError(f"{path}: {have} captures along {axis}, but the grid has {length} values")
    if "direction" in shape and shape["direction"] != directions[0] * directions[1]:
        raise DataError(
            f"{path}: {shape['direction']} directions, but the grid has {directions[0]} x {directions[1]} values"
        )


def _points(file: Mapping[str, Any], path: Path, value: Any, count: int, label: str) -> NDArray[np.float64]:
    points = np.asarray(_value(file, path, value, None), dtype=float)
    if points.shape not in ((3,), (count, 3)):
        raise DataError(f"{path}: {label} has shape {points.shape}; expected (3,) or ({count}, 3) metres")
    return np.broadcast_to(points, (count, 3))


def _reader(
    path: Path,
    block: Samples,
    position: int,
    order: tuple[NDArray[np.intp], NDArray[np.intp]],
    directions: tuple[int, int],
) -> Callable[[int, int, slice], Captures]:
    """Read captures of one direction, named by its place in the sorted grid."""

    @cache
    def file() -> Mapping[str, Any]:
        # Kept open while the recording lives: a chunk often holds many directions, and the next call finds it in
        # HDF5's cache.
        return h5py.File(path, "r", rdcc_nbytes=CHUNK_CACHE) if h5py.is_hdf5(path) else _matlab(path)

    def read(azimuth: int, elevation: int, snapshots: slice) -> Captures:
        a, e = int(order[0][azimuth, 0]), int(order[1][0, elevation])
        direction = e * directions[0] + a if block.slowest == "elevation" else a * directions[1] + e
        where = {"position": position, "azimuth": a, "elevation": e, "direction": direction, "snapshot": snapshots}
        return _captures(file(), path, block, where)

    return read


def _captures(file: Mapping[str, Any], path: Path, block: Samples, where: Mapping[str, Any]) -> Captures:
    """Captures at ``where``, brought to (snapshot, sample[, iq]), int16 as they are and all else as complex64."""
    index = tuple(where.get(axis, slice(None)) for axis in block.axes)
    left = [axis for axis in block.axes if axis in ("snapshot", "sample", "iq")]
    data = np.asarray(_node(file, path, block.dataset)[index])
    if block.imaginary is not None:
        imaginary = np.asarray(_node(file, path, block.imaginary)[index])
        data, left = np.stack([data, imaginary], axis=-1), [*left, "iq"]
    if data.dtype.names is not None:  # MATLAB 7.3 keeps complex numbers as (real, imag) records
        data = data[data.dtype.names[0]] + 1j * data[data.dtype.names[1]]
    if "snapshot" not in left:
        data, left = data[None], ["snapshot", *left]
    wanted = [axis for axis in ("snapshot", "sample", "iq") if axis in left]
    data = np.transpose(data, [left.index(axis) for axis in wanted])
    if data.dtype == np.int16 and "iq" in left:
        return np.ascontiguousarray(data)
    if "iq" in left:
        data = data[..., 0] + 1j * data[..., 1]
    return np.ascontiguousarray(data, dtype=np.complex64)
