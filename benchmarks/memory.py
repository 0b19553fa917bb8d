"""Claim: a recording of 20 GiB is processed with less than 1 GiB resident."""

from harness import conclude  # isort: skip

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import campaign

GIBIBYTES = 20


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        snapshots = GIBIBYTES * 2**30 // (108 * 4088)
        path = campaign.write_sparse(Path(folder), "large", snapshots)
        b2b = campaign.write_calibration(Path(folder))
        command = ("process", str(path), "--calibration", str(b2b), "--out", f"{folder}/out")
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "sounder", *command], check=True, stdout=subprocess.DEVNULL)
        spent = time.perf_counter() - start
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
        size = path.stat().st_size / 2**30
    print(f"{size:.1f} GiB, a hole but for one capture per direction: {spent:.1f} s, {peak:.2f} GiB resident at most")
    conclude("20 GiB recording under 1 GiB resident (ratio: 1 GiB over the peak)", 1 / peak, None)


if __name__ == "__main__":
    main()
