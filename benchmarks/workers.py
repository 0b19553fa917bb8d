"""Claim: two dask workers are at least 1.6 times as fast as one on a campaign of compute-bound positions."""

from harness import conclude  # isort: skip

import filecmp
import shutil
import tempfile
import time
from pathlib import Path

import campaign
import h5py
import numpy as np
from distributed import LocalCluster

from sounder.options import Options
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process

POSITIONS, SNAPSHOTS, ROUNDS = 12, 200, 3


def main() -> None:
    options = Options(averaging="phase-aligned")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        recordings = [campaign.write_recording(out, "P0", SNAPSHOTS)]
        for k in range(1, POSITIONS):
            recordings.append(out / f"P{k}.h5")
            shutil.copy(recordings[0], recordings[-1])
            with h5py.File(recordings[-1], "r+") as file:
                file.attrs["position"] = f"P{k}"
        b2b = campaign.write_calibration(out)
        jobs, _ = gather(recordings, calibration=b2b)
        spent: dict[int, list[float]] = {1: [], 2: []}
        with (
            LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as one,
            LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as two,
        ):
            for round_ in range(ROUNDS + 1):
                for count, cluster in ((1, one), (2, two)):
                    start = time.perf_counter()
                    process(jobs, out / str(count), options=options, threads=1, scheduler=cluster.scheduler_address)
                    if round_:  # the first loads the kernels
                        spent[count].append(time.perf_counter() - start)
        same = all(filecmp.cmp(out / "1" / r.name, out / "2" / r.name, shallow=False) for r in recordings)
    if not same:
        raise SystemExit("one and two workers do not give the same bytes")
    one_, two_ = np.median(spent[1]), np.median(spent[2])
    print(f"{POSITIONS} positions of {SNAPSHOTS} snapshots, one thread a worker: one {one_:.2f} s, two {two_:.2f} s")
    conclude("two dask workers at least 1.6 times as fast as one (ratio: one over two)", one_ / two_, None)


if __name__ == "__main__":
    main()
