"""A small sounder, and damaged files."""

from pathlib import Path

import h5py
import numpy as np

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
SCAN = {"azimuth": [0.0, 90.0, 200.0], "elevation": [-9.0, 9.0]}
IQ = np.zeros((3, 2, 3, 254, 2), np.int16)


def edit(path: Path, **datasets) -> None:
    with h5py.File(path, "r+") as file:
        del file.attrs["members"]  # of what was written; this file is made by hand
        for name, data in datasets.items():
            attributes = dict(file[name].attrs) if name in file else {}
            if name in file:
                del file[name]
            if data is not None:
                file[name] = data
                file[name].attrs.update(attributes)
