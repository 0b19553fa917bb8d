"""Claim: mean correlation and mean power agree with a float64 FFT to 1e-6 of the peak."""

from harness import conclude, sequence  # isort: skip

import numpy as np

from sounder.kernels.correlation import reference
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator

CLAIMED = 1e-6


def main() -> None:
    rng = np.random.default_rng(1)
    shape = (200, 1022, 2)
    data = {
        "random, full scale": rng.integers(-32768, 32768, shape),
        "1 LSB": rng.integers(-1, 2, shape),
        "both rails": rng.choice([-32768, 32767], shape),
        "negative rail": np.full(shape, -32768),
        "equal captures": np.repeat(rng.integers(-9000, 9000, (1, 1022, 2)), 200, axis=0),
    }
    sequences = {f"taps {taps}": sequence(9, taps) for taps in ((0, 4), (0, 5), (0, 3, 4, 6), (0, 4, 5, 8))}
    sequences |= {"reversed": sequence(9)[::-1], "rolled": np.roll(sequence(9), 123), "complement": 1 - sequence(9)}
    print(f"{'of the peak':24s} {'':24s} {'correlation':>12s} {'power':>12s}")
    worst = 0.0
    for sequence_name, chips in sequences.items():
        correlator, template = MSequenceCorrelator(chips, 2), reference.chip_template(chips, 2)
        for name, values in data.items():
            iq = values.astype(np.int16)
            pairs = zip(correlator.average(iq), reference.average(iq, template), strict=True)
            errors = [float(np.abs(got - true).max() / np.abs(true).max()) for got, true in pairs]
            print(f"{sequence_name:24s} {name:24s} {errors[0]:12.1e} {errors[1]:12.1e}")
            worst = max(worst, *errors)
    conclude("agreement with float64 to 1e-6 of the peak (ratio: 1e-6 over the worst error)", CLAIMED / worst, None)


if __name__ == "__main__":
    main()
