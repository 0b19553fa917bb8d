"""Claim: help in 0.4 s; reading a product in 1.5 times the imports that it takes; compiling, once, in 20 s.

All in processor time of the processes, which other work on the machine changes little.
"""

from harness import conclude  # isort: skip

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import campaign
import numpy as np

IMPORTS = "import xarray, h5netcdf"


def median_time(*command: str, times: int, **environment: str) -> float:
    """Processor time of a Python command [s], the median of several runs."""
    spent = []
    for _ in range(times):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL, env=os.environ | environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return float(np.median(spent))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = campaign.write_recording(Path(folder), "RX", snapshots=2)
        b2b = campaign.write_calibration(Path(folder))
        process = ("-m", "sounder", "process", str(path), "--calibration", str(b2b), "--out", f"{folder}/out")
        help_ = median_time("-m", "sounder", "--help", times=7)
        first = np.median([median_time(*process, times=1, NUMBA_CACHE_DIR=f"{folder}/cache{k}") for k in range(3)])
        second = median_time(*process, times=7, NUMBA_CACHE_DIR=f"{folder}/cache0")
        imports = median_time("-c", IMPORTS, times=7)
        info = median_time("-m", "sounder", "info", f"{folder}/out/RX.h5", times=7)
    print(f"sounder --help                              {help_:6.2f} s  (0.4)")
    print(f"sounder info of a product                   {info:6.2f} s  (1.5 times {imports:.2f} s: {IMPORTS})")
    print(f"sounder process, kernels loaded             {second:6.2f} s")
    print(f"sounder process, kernels compiled: longer by{first - second:6.2f} s  (20)")
    worst = max(help_ / 0.4, info / (1.5 * imports), (first - second) / 20)
    conclude(
        "start-up: help 0.4 s, info 1.5 times its imports, compiling 20 s (ratio: 1 over the worst)", 1 / worst, None
    )


if __name__ == "__main__":
    main()
