"""Claim: the route for any template is not slower than MKL, padded."""

from harness import conclude, interleaved, read, recording, table  # isort: skip

import numpy as np
from routes import check, fft_routes, numpy_batch

from sounder.kernels.correlation.any_template import TemplateCorrelator

OURS, READ = "any-template route", "reading only"


def main() -> None:
    # A real chirp of the m-sequence's length, so that all routes take the same template.
    template = np.cos(np.pi * 0.4 * np.arange(1022) ** 2 / 1022)
    iq = recording(template, directions=4, snapshots=1000)
    correlator = TemplateCorrelator(template)
    expected = numpy_batch(iq[0], template)
    check(OURS, correlator.average(iq[0]), expected, 1e-6)
    runs = {
        OURS: lambda: [correlator.average(direction) for direction in iq],
        READ: lambda: read(iq.reshape(-1).view(np.int64)),
    }
    routes = fft_routes(template)
    for name, route in routes.items():
        check(name, route(iq[0]), expected, 1e-5)
        runs[name] = lambda route=route: [route(direction) for direction in iq]
    times = interleaved(runs, rounds=9)
    table(times, dict.fromkeys(runs, 4000), OURS)
    best = min((times[name].processor, name) for name in routes)
    print(f"best FFT route: {best[1]}")
    conclude(
        "any template: not slower than the best FFT route, MKL padded included",
        best[0] / times[OURS].processor,
        times[OURS].processor / times[READ].processor,
    )


if __name__ == "__main__":
    main()
