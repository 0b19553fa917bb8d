"""Claim: positions cost at most 1.5 times the larger of hashing their files and correlating their captures.

Twenty positions of 108 directions of 200 snapshots, 1.8 GB, from files to products: read, hashed, correlated, MPCs
extracted, written. Processor time, which other work on the machine changes little.
"""

from harness import conclude  # isort: skip

import hashlib
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import campaign
import h5py

from sounder.cir.impulse_response import calibrate, impulse_responses
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process


def spent(run: Callable[[], object]) -> float:
    """Processor seconds."""
    before = time.process_time()
    run()
    return time.process_time() - before


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    with tempfile.TemporaryDirectory(dir=sys.argv[2] if len(sys.argv) > 2 else None) as temporary:
        folder = Path(temporary)
        paths = [campaign.write_recording(folder, "RX0", snapshots=200)]
        for k in range(1, count):
            paths.append(Path(shutil.copy(paths[0], folder / f"RX{k}.h5")))
            with h5py.File(paths[-1], "r+") as file:
                file.attrs["position"] = f"RX{k}"
        calibration = campaign.write_calibration(folder)
        jobs, _ = gather(paths, calibration=calibration)
        filter_ = calibrate(jobs[0].b2b, jobs[0].recording)
        process(jobs[:1], folder / "first")  # compiles
        hashing = correlating = 0.0
        for job in jobs:
            hashing += spent(lambda job=job: hashlib.sha256(job.recording.source.read_bytes()).digest())
            correlating += spent(lambda job=job: impulse_responses(job.recording, filter_))
        kept: list[object] = []
        whole = spent(lambda: kept.append(process(*gather(paths, calibration=calibration)[:1], folder / "out")))
        if len(kept[0].products) != count:  # type: ignore[attr-defined]
            raise SystemExit("positions failed")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{count} positions: hashing {hashing:.2f} s, correlating {correlating:.2f} s, all {whole:.2f} s of processors"
    )
    print(f"{memory:.2f} GiB resident at most, with a file as a whole in memory for its hash")
    ratio = 1.5 * max(hashing, correlating) / whole
    conclude("positions within 1.5 times of hashing or correlating (ratio: 1.5 times the larger over all)", ratio, None)


if __name__ == "__main__":
    main()
