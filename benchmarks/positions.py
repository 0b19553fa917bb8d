"""Claim: a position costs the same in a campaign of one and of three hundred."""

from harness import conclude  # isort: skip

import shutil
import tempfile
import time
from pathlib import Path

import campaign
import h5py
import numpy as np

from sounder.processing.jobs import gather
from sounder.processing.pipeline import process

COUNT = 300


def one_alone(recording: Path, b2b: Path, out: Path) -> float:
    """Wall time of a campaign of one position [s]."""
    start = time.perf_counter()
    process(gather([recording], calibration=b2b)[0], out)
    return time.perf_counter() - start


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        seed = campaign.write_recording(Path(folder), "P0", snapshots=2)
        b2b = campaign.write_calibration(Path(folder))
        recordings = [seed]
        for k in range(1, COUNT):
            recordings.append(Path(folder) / f"P{k}.h5")
            shutil.copy(seed, recordings[-1])
            with h5py.File(recordings[-1], "r+") as file:
                file.attrs["position"] = f"P{k}"
        process(gather([seed], calibration=b2b)[0], Path(folder) / "warm")
        alone = [one_alone(seed, b2b, Path(folder) / f"before{k}") for k in range(15)]
        stamps = [time.perf_counter()]
        jobs, _ = gather(recordings, calibration=b2b)
        opened = time.perf_counter() - stamps[0]
        stamps = [time.perf_counter()]
        process(jobs, Path(folder) / "all", progress=lambda: stamps.append(time.perf_counter()))
        alone += [one_alone(seed, b2b, Path(folder) / f"after{k}") for k in range(15)]
    each = np.diff(stamps) + opened / COUNT
    first, last, one, mean = np.median(each[:30]), np.median(each[-30:]), np.median(alone), each.mean()
    print(f"alone {one * 1e3:.0f} ms (fifteen before, fifteen after)")
    print(f"of {COUNT}: first thirty {first * 1e3:.0f} ms, last thirty {last * 1e3:.0f} ms, mean {mean * 1e3:.0f} ms")
    conclude(f"cost of a position is flat from 1 to {COUNT} (ratio: alone over the mean)", one / mean, None)


if __name__ == "__main__":
    main()
