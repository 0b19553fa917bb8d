"""Native recordings to run the pipeline on: as large as asked for, made fast."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from sounder import shipped
from sounder.instrument.description import Sounder, load_sounder
from sounder.recordings import writer
from sounder.twin.receiver import back_to_back, record

import xarray as xr  # isort: skip


def paths(count: int = 12, seed: int = 1) -> xr.Dataset:
    """Paths inside the fan, 60 to 600 ns, 25 dB from the strongest to the weakest."""
    rng = np.random.default_rng(seed)
    gain = 10 ** ((-112 - np.linspace(0, 25, count)) / 20) * np.exp(2j * np.pi * rng.random(count))
    return xr.Dataset(
        {
            "delay": ("path", np.sort(rng.uniform(60e-9, 600e-9, count))),
            "azimuth": ("path", rng.uniform(0, 360, count)),
            "elevation": ("path", rng.uniform(-9, 9, count)),
            "coefficient": ("path", gain),
        }
    )


def described() -> Sounder:
    """Return the shipped sounder."""
    return load_sounder(shipped.calibration("sounder-132ghz.toml"))


def write_calibration(folder: Path) -> Path:
    """Write the back-to-back of the recordings."""
    target = folder / "back-to-back.h5"
    writer.write_back_to_back(back_to_back(described(), 60.0), target, history="benchmark")
    return target


def write_recording(folder: Path, name: str, snapshots: int, distinct: int = 16, seed: int = 1) -> Path:
    """Write a recording of 108 directions; snapshots repeat after ``distinct``."""
    made = record(
        paths(seed=seed),
        described(),
        name=name,
        tx_position=(0.0, 0.0, 28.4),
        rx_position=(15.0, 0.0, 28.4),
        snapshots=min(distinct, snapshots),
        seed=seed,
    )
    blocks: dict[tuple[int, int], np.ndarray] = {}

    def read(a: int, e: int, wanted: slice) -> np.ndarray:
        if (a, e) not in blocks:
            blocks.clear()
            blocks[a, e] = np.asarray(made.captures(a, e))
        return np.take(blocks[a, e], np.arange(*wanted.indices(snapshots)) % len(blocks[a, e]), axis=0)

    target = folder / f"{name}.h5"
    writer.write_recording(replace(made, snapshots=snapshots, read=read), target, history="benchmark")
    return target


def write_sparse(folder: Path, name: str, snapshots: int) -> Path:
    """Write a recording that is a hole but for the first capture of each direction."""
    small = write_recording(folder, "seed", snapshots=1)
    target = folder / f"{name}.h5"
    with h5py.File(small) as source, h5py.File(target, "w") as file:
        file.attrs.update(source.attrs)
        file.attrs["position"] = name
        for key in source:
            if key != "iq":
                source.copy(key, file)
        shape = (*source["iq"].shape[:2], snapshots, *source["iq"].shape[3:])
        create = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        create.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        create.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        space = h5py.h5s.create_simple(shape)
        iq = h5py.Dataset(h5py.h5d.create(file.id, b"iq", h5py.h5t.NATIVE_INT16, space, create))
        iq.attrs.update(source["iq"].attrs)
        iq[:, :, 0] = source["iq"][:, :, 0]
    return target
