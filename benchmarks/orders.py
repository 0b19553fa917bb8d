"""Claim: for every order 9 to 15 the kernel is at least 4 times as fast as the best FFT route."""

from harness import conclude, interleaved, read, recording, sequence, table  # isort: skip

import numpy as np
from routes import check, fft_routes, numpy_batch

from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.kernels.correlation.reference import chip_template

OURS, READ = "Walsh-Hadamard kernel", "reading only"


def main() -> None:
    ratios, floors = [], []
    for order in range(9, 16):
        chips = sequence(order)
        template = chip_template(chips, 2)
        snapshots = max(16, (1 << 22) // template.size)  # 16 MB
        iq = recording(template, directions=1, snapshots=snapshots)
        correlator = MSequenceCorrelator(chips, 2)
        expected = numpy_batch(iq[0, :8], template)
        runs = {
            OURS: lambda c=correlator, iq=iq: c.average(iq[0]),
            READ: lambda iq=iq: read(iq.reshape(-1).view(np.int64)),
        }
        check(OURS, correlator.average(iq[0, :8]), expected, 1e-6)
        routes = fft_routes(template)
        for name, route in routes.items():
            check(name, route(iq[0, :8]), expected, 1e-5)
            runs[name] = lambda route=route, iq=iq: route(iq[0])
        times = interleaved(runs, rounds=9)
        print(f"\norder {order}, {template.size} samples")
        table(times, dict.fromkeys(runs, snapshots), OURS)
        best = min(times[name].processor for name in routes)
        ratios.append(best / times[OURS].processor)
        floors.append(times[OURS].processor / times[READ].processor)
    print("\nbest FFT route over ours, orders 9 to 15: " + ", ".join(f"{ratio:.1f}" for ratio in ratios))
    conclude("orders 9 to 15, 2 samples per chip: each at least 4 times the best FFT route", min(ratios), max(floors))


if __name__ == "__main__":
    main()
