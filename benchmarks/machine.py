"""How fast this machine is at the moment: processors that others share are up to four times slower than usual."""

import time

USUAL = 0.55  # s


def loop_time() -> float:
    """Processor seconds of ten million steps of a Python loop; `USUAL` on a usual machine."""
    start = time.process_time()
    total = 0
    for i in range(10_000_000):
        total += i
    return time.process_time() - start
