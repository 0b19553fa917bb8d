"""The native recording: an HDF5 file for each position."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, Group, is_hdf5, open_hdf5
from erm.common.gate.nesting import parse_json
from erm.common.integrity import require_members
from sounder.instrument.description import Sounder
from sounder.recordings import direct
from sounder.recordings.recording import MAX_AGC_GAIN, BackToBack, Captures, Recording, check, line_of_sight

RECORDING = "sounder-to-map recording"
BACK_TO_BACK = "sounder-to-map back-to-back"


def kind_of(path: Path) -> str | None:
    """Attribute ``kind`` of a native file; None for any other HDF5 file."""
    with open_hdf5(path) as file:
        return _kind(file)


def _kind(file: Group) -> str | None:
    kind = file.attrs.get("kind")
    return kind if isinstance(kind, str) else None


def other_kind(path: Path) -> str | None:
    """Name what else of this software a file is, if it is no recording; None for files of other software."""
    if not is_hdf5(path):
        return None
    with open_hdf5(path) as file:
        if _kind(file) == BACK_TO_BACK:
            return "back-to-back recording"
        return "product of sounder process" if "mpc" in file and "daps" in file else None


def is_back_to_back(path: Path) -> bool:
    """Whether the file is a native back-to-back recording."""
    return is_hdf5(path) and kind_of(path) == BACK_TO_BACK


def is_format(path: Path) -> bool:
    """Whether the file is a native recording."""
    return is_hdf5(path) and kind_of(path) == RECORDING


def recordings(path: Path, sounder: Sounder | None = None) -> list[Recording]:
    """Open a native recording. No sample is read.

    Parameters
    ----------
    path : Path
        The file.
    sounder : Sounder, optional
        Replaces the description that the file holds.

    Returns
    -------
    list of Recording
        A single one.

    Raises
    ------
    DataError
        The file is not a native recording, or contradicts its own description.
    """
    with open_hdf5(path) as file:
        if _kind(file) != RECORDING:
            raise DataError(f"{path}: not a native recording; describe its layout with --layout FILE")
        _require(file, path, ("iq", "azimuth", "elevation", "tx_position", "rx_position"))
        iq = file.dataset("iq")
        shape = iq.shape
        azimuth, elevation = (_ascending(file, path, name) for name in ("azimuth", "elevation"))
        directions = (azimuth.size, elevation.size)
        if iq.ndim != 5 or iq.dtype != np.int16 or shape[4] != 2 or shape[:2] != directions:
            raise DataError(
                f"{path}: iq is {iq.dtype} {shape}; expected int16 "
                f"({azimuth.size} azimuths, {elevation.size} elevations, snapshot, sample, 2)"
            )
        recording = Recording(
            name=file.attrs.label("position", path.stem),
            source=path,
            sounder=sounder or _description(file, path),
            azimuth=azimuth,
            elevation=elevation,
            snapshots=shape[2],
            tx_position=_vector(file, path, "tx_position", 3),
            rx_position=_vector(file, path, "rx_position", 3),
            scale_factor=_scale(iq, path),
            agc_gain=_grid(file, path, "agc_gain", directions, 0.0),
            valid=_grid(file, path, "valid", directions, 1.0) != 0,
            los=line_of_sight(file.attrs.number("los", -1), path),
            time=_grid(file, path, "time", directions, np.nan) if "time" in file else None,
            read=_reader(path, iq),
        )
        require_members(file)  # last: what does not fit the format is described better above
    check(recording, shape[3])
    return [recording]


def _ascending(file: Group, path: Path, name: str) -> NDArray[np.float64]:
    values: NDArray[np.float64] = file.dataset(name).numbers().astype(float).reshape(-1)
    if not values.size or not np.isfinite(values).all() or (np.diff(values) <= 0).any():
        raise DataError(f"{path}: {name} is not in ascending order; expected finite ascending values")
    return values


def _vector(file: Group, path: Path, name: str, size: int) -> NDArray[np.float64]:
    values: NDArray[np.float64] = file.dataset(name).numbers().astype(float).reshape(-1)
    if values.size != size:
        raise DataError(f"{path}: {name} has {values.size} numbers; expected {size}")
    return values


def _grid(file: Group, path: Path, name: str, shape: tuple[int, int], default: float) -> NDArray[np.float64]:
    """Values of each direction (azimuth, elevation); the default if the file has none."""
    values = file.dataset(name).numbers().astype(float) if name in file else np.full(shape, default)
    if values.shape != shape:
        raise DataError(f"{path}: {name} has shape {values.shape}; expected (azimuth, elevation), {shape}")
    return values


def _scale(iq: Dataset, path: Path) -> float:
    scale = iq.attrs.number("scale_factor", np.nan)
    if not 0 < scale < np.inf:
        raise DataError(
            f"{path}: scale_factor of iq is {scale:g}; expected the amplitude of one LSB, a positive number"
        )
    return scale


def _reader(path: Path, iq: Dataset) -> Callable[[int, int, slice], Captures]:
    """Reader of captures: straight from the file if it stores ``iq`` so that this is possible, otherwise by HDF5."""
    shape = iq.shape
    if (reader := direct.reader(path, iq)) is not None:
        return reader

    def read(a: int, e: int, snapshots: slice) -> Captures:
        with open_hdf5(path) as again:
            captures: Captures = again.dataset("iq")[a, e, snapshots]
        if captures.shape[1:] != shape[3:] or captures.dtype != np.int16:
            raise DataError(f"{path}: iq changed while the file was read; copy it again")
        return captures

    return read


def back_to_back(path: Path) -> BackToBack:
    """Read a native back-to-back file.

    Raises
    ------
    DataError
        The file is missing or is not a back-to-back recording.
    """
    with open_hdf5(path, "a back-to-back recording") as file:
        if _kind(file) != BACK_TO_BACK:
            raise DataError(
                f"{path}: not a back-to-back recording; record one with an attenuator in place of the antennas"
            )
        _require(file, path, ("iq",))
        iq = file.dataset("iq")
        if (
            iq.dtype.kind not in "ifc"
            or iq.ndim != (2 if iq.dtype.kind == "c" else 3)
            or (iq.ndim == 3 and iq.shape[2] != 2)
        ):
            raise DataError(f"{path}: iq is {iq.dtype} {iq.shape}; expected int16 (snapshot, sample, 2)")
        attenuation = file.attrs.number("attenuation", np.nan)
        if not np.isfinite(attenuation):
            raise DataError(f"{path}: no attribute attenuation; expected the loss of the attenuator [dB]")
        b2b = BackToBack(
            source=path,
            sounder=_description(file, path),
            captures=iq[()],
            scale_factor=_scale(iq, path),
            attenuation=attenuation,
            s21=_attenuator(file, path) if "attenuator_s21" in file else None,
            includes_tx_antenna=bool(file.attrs.number("includes_tx_antenna", 0)),
            title=file.attrs.label("title", BackToBack.title),
        )
        require_members(file)
        return b2b


def _attenuator(file: Group, path: Path) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    _require(file, path, ("attenuator_frequency",))
    frequency, s21 = (
        _ascending(file, path, "attenuator_frequency"),
        file.dataset("attenuator_s21").numbers().astype(float),
    )
    if s21.shape != (frequency.size, 2):
        raise DataError(f"{path}: attenuator_s21 has shape {s21.shape}; expected ({frequency.size}, 2)")
    most = 10 ** (MAX_AGC_GAIN / 20)
    if not 1 / most <= np.abs(s21).max(initial=0) <= most:
        raise DataError(f"{path}: attenuator_s21 is NaN or beyond {MAX_AGC_GAIN:g} dB; measure it again")
    return frequency, s21 @ [1, 1j]


def _require(file: Group, path: Path, names: Iterable[str]) -> None:
    absent = [name for name in names if name not in file]
    if absent:
        raise DataError(
            f"{path}: the file has no {', '.join(absent)}; expected a recording as described in docs/formats.md"
        )


def _description(file: Group, path: Path) -> Sounder:
    try:
        tables = parse_json(file.attrs.text("sounder"))
    except ValueError:
        raise DataError(f"{path}: attribute sounder is missing or not JSON; expected a sounder description") from None
    return Sounder.from_tables(tables, f"{path}: attribute sounder")
