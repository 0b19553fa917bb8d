"""Attack the commands with damaged files, kills, full disks and runs at the same time; count what goes wrong.

Right is: exit code 0 with every checksum holding, or 1 or 2 with a line that says why; at most 10 s of processor time
and 2 GiB; nothing that is half written; after a kill, the same bytes as without. Exit code 1 if anything else was seen.

    python -m tests.soak [--damage 20000] [--flip 312] [--kill 500] [--fill 200] [--meet 20] [--seed 1]
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import attacks
from .forked import Trial, load, started, waited
from .samples import OUT, SAMPLES, make_campaign

USUAL = {attacks.damage: 20_000, attacks.flip: 312, attacks.kill: 500, attacks.fill: 200, attacks.meet: 20}


def main() -> int:
    """Run the attacks that the command line asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for attack, count in USUAL.items():
        parser.add_argument(f"--{attack.__name__}", type=int, default=count, help=attack.__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="damage only files that a command with this text reads")
    parser.add_argument("--keep", type=Path, help="folder for damaged files that made faults")
    chosen = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)

        def alone(words: list[str]) -> int:
            return waited(started(Trial(words), folder / "log"), folder / "log", patience=None).code  # may compile

        make_campaign(folder / "campaign", alone)
        read = [sample for sample in SAMPLES if chosen.only in sample.command]
        load(sorted({tuple(sample.words(folder / "campaign")) for sample in (*read, *attacks.WRITERS)}))
        shutil.rmtree(folder / "campaign" / OUT)
        for attack in USUAL:
            if count := getattr(chosen, attack.__name__):
                tally = attack(folder, count, np.random.default_rng(chosen.seed), chosen)
                print(f"{attack.__name__}: {count}, of which {tally}", flush=True)
                wrong += tally.wrong
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
