"""Claim: the fused kernel, one thread, is at least 60 times as fast as the numpy batch a user would write."""

from harness import conclude, interleaved, read, recording, sequence, table  # isort: skip

import numpy as np
import routes

from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.kernels.correlation.reference import chip_template

OURS, BATCH, READ = "fused Walsh-Hadamard kernel", "numpy, complex128 batch", "reading only"


def main() -> None:
    chips = sequence(9)
    template = chip_template(chips, 2)
    iq = recording(template, directions=16, snapshots=1000)
    correlator = MSequenceCorrelator(chips, 2)
    runs = {
        OURS: lambda: [correlator.average(direction) for direction in iq],
        BATCH: lambda: routes.numpy_batch(iq[0], template),
        READ: lambda: read(iq.reshape(-1).view(np.int64)),
    }
    routes.check(OURS, correlator.average(iq[0]), routes.numpy_batch(iq[0], template), 1e-6)
    captures = {OURS: 16000, BATCH: 1000, READ: 16000}
    times = interleaved(runs)
    table(times, captures, OURS)
    each = {name: spent.processor / captures[name] for name, spent in times.items()}
    conclude(
        "fused kernel, order 9, one thread: at least 60 times a numpy batch",
        each[BATCH] / each[OURS],
        each[OURS] / each[READ],
    )


if __name__ == "__main__":
    main()
