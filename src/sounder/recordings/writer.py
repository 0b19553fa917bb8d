"""Writer of native recordings, which `sounder.recordings.native` reads."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.hdf5_output import new_hdf5
from erm.common.integrity import checksummed, list_members
from erm.common.storage import provenance
from sounder.recordings.native import BACK_TO_BACK, RECORDING
from sounder.recordings.recording import BackToBack, Recording


def write_recording(recording: Recording, target: Path, *, history: str) -> None:
    """Write a native recording, direction by direction.

    Parameters
    ----------
    recording : Recording
        From any reader or from the twin.
    target : Path
        The file. It is written completely or not at all.
    history : str
        The command that makes it, stored in the file.

    Raises
    ------
    DataError
        The captures are not IQ samples in int16; a native recording holds nothing else.
    """
    if recording.kind != "iq":
        raise DataError(
            f"{recording.source}: captures are {recording.kind}; a native recording holds IQ samples; process the file "
            "with its layout instead"
        )
    if recording.of_departure is not None:
        raise DataError(
            f"{recording.source}: the transmit antenna has {len(recording.departures)} beams; a native recording holds "
            "one; process the file with its layout instead"
        )
    inputs = [recording.source] if recording.source.is_file() else []
    with atomic_path(target) as temporary, new_hdf5(temporary) as file:
        file.attrs.update(provenance(f"Raw captures of {recording.name}", history, inputs=inputs))
        file.attrs["kind"] = RECORDING
        file.attrs["position"] = recording.name
        file.attrs["sounder"] = recording.sounder.model_dump_json()
        file.attrs["frequency"] = recording.sounder.carrier.frequency
        file.attrs["los"] = recording.los
        grid = ("azimuth", "elevation")
        _dataset(
            file, "azimuth", ("azimuth",), recording.azimuth, "degree", "horn azimuth, counter-clockwise from east"
        )
        _dataset(file, "elevation", ("elevation",), recording.elevation, "degree", "horn elevation, above the horizon")
        for end in ("tx", "rx"):
            position = getattr(recording, f"{end}_position")[None]
            _dataset(file, f"{end}_position", ("position", "xyz"), position, "m", f"{end.upper()} east, north, up")
        _dataset(file, "agc_gain", grid, recording.agc_gain, "dB", "receiver gain over the back-to-back setting")
        _dataset(file, "valid", grid, recording.valid.astype(np.int8), "1", "1 where the direction was recorded")
        if recording.time is not None:
            units = "seconds since 1970-01-01 00:00:00"
            _dataset(file, "time", grid, recording.time, units, "time of the first snapshot")
        samples = recording.sounder.waveform.samples
        shape = (recording.azimuth.size, recording.elevation.size, recording.snapshots, samples, 2)
        chunk = checksummed(shape[2:], np.dtype(np.int16).itemsize)["chunks"]  # of one direction: what is read at once
        iq = file.create_dataset("iq", shape, np.int16, chunks=(1, 1, *chunk), fletcher32=True)
        _describe(iq, (*grid, "snapshot", "sample", "iq"), "mW0.5", "raw samples")
        iq.attrs["scale_factor"] = recording.scale_factor
        for a, e in np.argwhere(recording.valid):
            captures = recording.captures(int(a), int(e))
            if captures.dtype != np.int16:
                raise DataError(
                    f"{recording.source}: samples are {captures.dtype}; a native recording holds int16; "
                    "process the file with its layout instead"
                )
            iq[int(a), int(e)] = captures
        iq.flush()
        list_members(file)


def write_back_to_back(b2b: BackToBack, target: Path, *, history: str, inputs: Iterable[Path] = ()) -> None:
    """Write a native back-to-back recording, completely or not at all."""
    with atomic_path(target) as temporary, new_hdf5(temporary) as file:
        file.attrs.update(provenance(b2b.title, history, inputs=inputs))
        file.attrs["kind"] = BACK_TO_BACK
        file.attrs["sounder"] = b2b.sounder.model_dump_json()
        file.attrs["attenuation"] = b2b.attenuation
        file.attrs["includes_tx_antenna"] = int(b2b.includes_tx_antenna)
        _dataset(file, "iq", ("snapshot", "sample", "iq"), b2b.captures, "mW0.5", "raw samples")
        file["iq"].attrs["scale_factor"] = b2b.scale_factor
        if b2b.s21 is not None:
            frequency, s21 = b2b.s21
            parts = np.stack([s21.real, s21.imag], axis=-1)
            _dataset(file, "attenuator_frequency", ("frequency",), frequency, "Hz", "frequency")
            _dataset(file, "attenuator_s21", ("frequency", "part"), parts, "1", "attenuator S21, real and imaginary")
        list_members(file)


def _dataset(file: h5py.File, name: str, dims: tuple[str, ...], data: NDArray[Any], units: str, long_name: str) -> None:
    options = checksummed(data.shape, data.dtype.itemsize)
    dataset = file.create_dataset(name, data=data, **options)
    dataset.flush()  # chunks get their place now, not when Python releases the dataset
    _describe(dataset, dims, units, long_name)


def _describe(dataset: h5py.Dataset, dims: tuple[str, ...], units: str, long_name: str) -> None:
    # Labels, not netCDF dimensions: netCDF has no variable that shares its name with one of several axes, as iq does.
    for axis, label in enumerate(dims):
        dataset.dims[axis].label = label
    dataset.attrs.update({"units": units, "long_name": long_name})
