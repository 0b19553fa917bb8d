"""Claim: a process that draws takes at most half as long to start as the fewest products that it is started for.

Processor time, which other work on the machine changes little.
"""

from harness import conclude  # isort: skip

import tempfile
import time
from pathlib import Path

import campaign
from startup import median_time

from sounder.figures.files import draw_product, product_axes
from sounder.figures.processes import PRODUCTS_PER_PROCESS
from sounder.processing.jobs import gather
from sounder.processing.pipeline import process


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = campaign.write_recording(Path(folder), "RX", snapshots=2)
        jobs, _ = gather([path], calibration=campaign.write_calibration(Path(folder)))
        (product,) = process(jobs, Path(folder) / "products").products
        axes = product_axes()
        draw_product(product, Path(folder), axes=axes)
        start = median_time("-c", "import sounder.figures.processes", times=5)
        before = time.process_time()
        for _ in range(5):
            draw_product(product, Path(folder), axes=axes)
        drawn = (time.process_time() - before) / 5
    print(f"start of a process       {start:6.2f} s")
    print(f"three figures of a product {drawn:4.2f} s, {start / drawn:.1f} of them in this time")
    ratio = PRODUCTS_PER_PROCESS * drawn / start / 2
    conclude(f"figures: {PRODUCTS_PER_PROCESS} products take twice the start of a process (ratio: over 2)", ratio, None)


if __name__ == "__main__":
    main()
