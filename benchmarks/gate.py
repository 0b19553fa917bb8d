"""What the gate and the checksums cost `sounder process`: with them, and with both patched away, in turns.

python benchmarks/gate.py [RECORDING BACK_TO_BACK]
"""

import pools  # isort: skip  # noqa: F401

import json
import shutil
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from unittest import mock

import h5py

import sounder
from sounder import shipped

ROUNDS = 9
PATCHED = {
    "erm.common.gate.hdf5": ("require_heaps", "require_filters", "require_space", "require_hard"),
    "erm.common.storage": ("require_members", "list_members"),
    "sounder.recordings.native": ("require_members",),
}


def unprotected(path: Path, target: Path) -> Path:
    """Copy of a file without checksums and list of members, each dataset in one piece."""
    shutil.copy(path, target)
    with h5py.File(target, "r+") as file:
        file.attrs.pop("members", None)
        for name in list(file):
            old = file[name]
            if old.fletcher32:
                attributes, values = dict(old.attrs), old[()]
                del file[name]
                file.create_dataset(name, data=values).attrs.update(attributes)
    return target


def seconds(recording: Path, back_to_back: Path, out: Path) -> float:
    """Processor time of one position, from the file to the product."""
    begun = time.process_time()
    jobs, _ = sounder.gather([recording], calibration=back_to_back)
    assert sounder.process(jobs, out, threads=1).products
    return time.process_time() - begun


def main() -> None:
    """Measure, and print the ratio."""
    given = [Path(name) for name in sys.argv[1:]]
    files = given or [shipped.calibration(f"{name}-132ghz.h5") for name in ("recording", "back-to-back")]
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        plain = [unprotected(path, folder / path.name) for path in files]
        times: dict[str, list[float]] = {"with": [], "without": []}
        for _ in range(ROUNDS + 1):  # the first compiles
            times["with"].append(seconds(*files, folder / "out"))
            with ExitStack() as stack:
                for module, names in PATCHED.items():
                    for name in names:
                        stack.enter_context(mock.patch(f"{module}.{name}"))
                for module in ("erm.common.netcdf", "sounder.recordings.writer"):
                    stack.enter_context(mock.patch(f"{module}.checksummed", return_value={}))
                times["without"].append(seconds(*plain, folder / "out"))
    with_, without = (statistics.median(times[name][1:]) for name in ("with", "without"))
    print(f"one position, one thread: {with_:.3f} s with gate and checksums, {without:.3f} s without")
    print(json.dumps({"claim": "gate and checksums cost at most 10 %", "ratio": with_ / without, "floor_ratio": None}))


if __name__ == "__main__":
    main()
