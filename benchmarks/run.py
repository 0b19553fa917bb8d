"""Run every benchmark, or those that are named, and write RESULTS.md beside them: of those that were run alone."""

import datetime
import json
import os
import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

HERE = Path(__file__).parent
SUPPORT = ("campaign.py", "harness.py", "machine.py", "pools.py", "routes.py", "run.py")


def processor() -> str:
    """Name the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def versions() -> str:
    """Name the libraries and their versions."""
    found = []
    for name in ("numpy", "scipy", "numba", "mkl_fft", "pyfftw"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} not installed")
    return ", ".join(found)


def main() -> int:
    names = sys.argv[1:] or sorted(path.name for path in HERE.glob("*.py") if path.name not in SUPPORT)
    rows, outputs, failed = [], [], 0
    for name in names:
        print(f"== {name}", flush=True)
        done = subprocess.run([sys.executable, str(HERE / name)], capture_output=True, text=True, check=False)
        print(done.stdout + done.stderr, flush=True)
        if done.returncode:
            failed += 1
            continue
        *text, last = done.stdout.rstrip().splitlines()
        said = json.loads(last)
        floor = "" if said["floor_ratio"] is None else f"{said['floor_ratio']:.2f}"
        rows.append(f"| `{name}` | {said['claim']} | {said['ratio']:.2f} | {floor} |")
        outputs.append(f"## {name}\n\n```\n" + "\n".join(text) + "\n```\n")
    if failed:
        return failed
    where = f"{processor()}, {os.cpu_count()} processors, {platform.system()}, Python {platform.python_version()}"
    HERE.joinpath("RESULTS.md").write_text(
        "# Results\n\n"
        f"{datetime.date.today().isoformat()}; {where}; {versions()}.\n\n"
        "Medians of interleaved runs. The ratio is the competitor's time over ours; the last column is our time over\n"
        "that of plainly reading the same bytes.\n\n"
        "| benchmark | claim | ratio | over reading |\n|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n\n"
        + "\n".join(outputs)
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
