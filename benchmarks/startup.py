"""Claim: help in 0.4 s; the first process compiles for at most 20 s, the second starts in at most 1 s."""

from harness import conclude  # isort: skip

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import campaign
import numpy as np

from sounder.processing.jobs import gather
from sounder.processing.pipeline import process


def timed(*command: str, **environment: str) -> float:
    """Wall time of a command [s]."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", *command], check=True, stdout=subprocess.DEVNULL, env=os.environ | environment
    )
    return time.perf_counter() - start


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = campaign.write_recording(Path(folder), "RX", snapshots=2)
        b2b = campaign.write_calibration(Path(folder))
        command = ("sounder", "process", str(path), "--calibration", str(b2b), "--out", f"{folder}/out")
        helps = [timed("sounder", "--help") for _ in range(7)]
        firsts = [timed(*command, NUMBA_CACHE_DIR=f"{folder}/cache{k}") for k in range(3)]
        seconds = [timed(*command, NUMBA_CACHE_DIR=f"{folder}/cache0") for _ in range(7)]
        jobs, _ = gather([path], calibration=b2b)
        process(jobs, Path(folder) / "warm")
        start = time.perf_counter()
        process(jobs, Path(folder) / "inside")
        inside = time.perf_counter() - start
    help_, first, second = (np.median(times) for times in (helps, firsts, seconds))
    print(f"sounder --help               {help_:6.2f} s  (0.4)")
    print(f"compilation, first process   {first - second:6.2f} s  (20)")
    print(f"start-up, second process     {second - inside:6.2f} s  (1)")
    worst = max(help_ / 0.4, (first - second) / 20, (second - inside) / 1)
    conclude("start-up: help 0.4 s, compilation 20 s, second start 1 s (ratio: 1 over the worst)", 1 / worst, None)


if __name__ == "__main__":
    main()
