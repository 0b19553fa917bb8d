"""Claim: I and Q exchanged or a sample apart are told over a campaign of ten positions, never in a clean one.

Random streets and instruments of the twin, half of the streets with diffuse scattering. The log-likelihood ratios of
each position, clean and with each change made to its CIRs, are summed over random campaigns. With the number of
positions as an argument: ``python benchmarks/quadrature.py 120``. A position takes half a second.
"""

from harness import conclude  # isort: skip

import sys
from collections.abc import Callable

import numpy as np
from damage import drawn

from erm.common.significance import CERTAIN
from sounder import impulse_responses
from sounder.quality import quadrature

POSITIONS, CAMPAIGNS = 60, 4000
UNCHANGED = "none"
MADE: dict[str, Callable[[quadrature.Complex], quadrature.Complex]] = {
    UNCHANGED: lambda correlation: correlation,
    "exchanged": quadrature.exchanged,
    "Q late": quadrature.q_later,
    "I late": quadrature.q_earlier,
}


def evidence(seed: int) -> dict[str, list[float]]:
    """Log-likelihood ratios of one position for each change that was made."""
    made = drawn(seed)
    cir, _ = impulse_responses(made.with_captures(made.captures), made.filter_, threads=1)
    responses, transfer = cir["cir"].values, made.filter_.transfer
    correlation = quadrature._correlation(responses, made.filter_)
    return {
        name: quadrature.quadrature_evidence(np.fft.ifft(np.fft.fft(change(correlation)) * transfer), made.filter_)
        for name, change in MADE.items()
    }


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else POSITIONS
    found = [evidence(seed) for seed in range(count)]
    rng = np.random.default_rng(1)
    told: dict[tuple[str, int], float] = {}
    print("share of campaigns that are told, by number of positions")
    for name in MADE:
        ratios = np.array([one[name] for one in found])
        for positions in (1, 3, 5, 10):
            total = ratios[rng.integers(0, count, (CAMPAIGNS, positions))].sum(axis=1).max(axis=1)
            told[name, positions] = float(np.mean(total > CERTAIN))
        print(f"{name:10s}", "  ".join(f"{n}: {share:.4f}" for (which, n), share in told.items() if which == name))
    conclude("told in campaigns of ten", min(told[name, 10] for name in MADE if name != UNCHANGED) / 0.95, None)


if __name__ == "__main__":
    main()
