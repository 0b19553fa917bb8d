"""Claim: the fused kernel, one thread, is at least 8 times as fast as the best FFT route."""

from harness import conclude, interleaved, read, recording, sequence, table  # isort: skip

import os

import numpy as np
from routes import check, fft_routes, numpy_batch, scipy_loop

from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.kernels.correlation.reference import chip_template

OURS = "fused Walsh-Hadamard kernel"
READ = "reading only"


def main() -> None:
    chips = sequence(9)
    template = chip_template(chips, 2)
    iq = recording(template, directions=16, snapshots=1000)  # 65 MB
    correlator = MSequenceCorrelator(chips, 2)
    os.environ["SOUNDER_PORTABLE_KERNELS"] = "1"
    portable = MSequenceCorrelator(chips, 2)

    expected = numpy_batch(iq[0], template)
    runs = {
        OURS: lambda: [correlator.average(direction) for direction in iq],
        "portable Walsh-Hadamard kernel": lambda: [portable.average(direction) for direction in iq],
        READ: lambda: read(iq.reshape(-1).view(np.int64)),
    }
    captures = dict.fromkeys(runs, 16 * 1000)
    routes = fft_routes(template)
    for name, route in routes.items():
        check(name, route(iq[0]), expected, 1e-5)
        # A new direction every call, as in a recording.
        runs[name] = lambda route=route: [route(direction) for direction in iq[:4]]
        captures[name] = 4 * 1000
    runs["numpy, complex128 batch"] = lambda: numpy_batch(iq[0], template)
    runs["scipy.signal.correlate in a loop"] = lambda: scipy_loop(iq[0, :100], template)
    captures |= {"numpy, complex128 batch": 1000, "scipy.signal.correlate in a loop": 100}
    check(OURS, correlator.average(iq[0]), expected, 1e-6)
    check("portable Walsh-Hadamard kernel", portable.average(iq[0]), expected, 1e-6)

    times = interleaved(runs, rounds=11)
    table(times, captures, OURS)
    each = {name: spent.processor / captures[name] for name, spent in times.items()}
    best = min(routes, key=lambda name: each[name])
    batch = each["numpy, complex128 batch"] / each[OURS]
    print(f"best FFT route: {best}; numpy batch: {batch:.1f} times ours (at least 60 is claimed)")
    conclude(
        "fused kernel, order 9, one thread: at least 8 times the best FFT route",
        each[best] / each[OURS],
        each[OURS] / each[READ],
    )


if __name__ == "__main__":
    main()
