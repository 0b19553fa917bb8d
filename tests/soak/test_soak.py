"""A few of the attacks; `make soak` makes thousands."""

import re
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_damaged_files_and_flipped_bits_are_one_line():
    counts = ("--damage", "45", "--flip", "6", "--kill", "0", "--fill", "0", "--meet", "0")
    made = subprocess.run(
        [sys.executable, "-m", "tests.soak", *counts, "--seed", "5"],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    assert re.search(r"^damage: 45, of which .*exit code 0: \d+.*; 0 wrong$", made.stdout, re.MULTILINE)
    assert re.search(r"^flip: 6, of which exit code 1: 6; 0 wrong$", made.stdout, re.MULTILINE)
