"""Claim: on two threads the averages take at most twice as long as reading the same bytes on two threads.

The captures are 523 MB, more than any cache holds: a recording comes from memory, and so does what is read. Of captures
that a large third-level cache holds (100 MB and more on servers) reading takes half as long, and the averages, which
compute most of the time, little less; that is not the case of a recording, and the ratio is then beyond two.
"""

from harness import conclude, interleaved, read, recording, sequence, table  # isort: skip

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from sounder.kernels.correlation.captures import Averages
from sounder.kernels.correlation.m_sequence import MSequenceCorrelator
from sounder.kernels.correlation.reference import chip_template

OURS, READ = "averages of directions, two threads", "reading only, two threads"


def main() -> None:
    chips = sequence(9)
    iq = recording(chip_template(chips, 2), directions=128, snapshots=1000)  # 523 MB: more than caches hold
    correlator = MSequenceCorrelator(chips, 2)
    pieces = np.split(iq.reshape(-1).view(np.int64), 8)
    pool = ThreadPoolExecutor(2)

    def one() -> list[Averages]:
        return [correlator.average(direction) for direction in iq]

    def two() -> list[Averages]:
        return list(pool.map(correlator.average, iq))

    runs = {
        OURS: two,
        READ: lambda: list(pool.map(read, pieces)),
        "averages of directions, one thread": one,
        "reading only, one thread": lambda: read(iq.reshape(-1).view(np.int64)),
    }
    if not np.array_equal([power for _, power in one()], [power for _, power in two()]):
        raise SystemExit("one and two threads do not give the same bits")
    threads = {name: 1 if "one thread" in name else 2 for name in runs}
    times = interleaved(runs, at_least=0.01, threads=threads)
    table(times, dict.fromkeys(runs, 128000), OURS)
    pool.shutdown()
    floor = times[OURS].wall / times[READ].wall
    conclude("averages on two threads: within 2 times of reading the bytes (wall time)", 1 / floor, floor)


if __name__ == "__main__":
    main()
