"""A few of the attacks; `make soak` makes thousands."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sounder import shipped

from ..sounder.cli.commands import run
from .forked import Ended
from .mutations import mutated

NAMES = "recording-132ghz.h5", "back-to-back-132ghz.h5", "sounder-132ghz.toml"


def test_damaged_files_are_right_or_cost_a_line(tmp_path, capsys):
    rng, faults, codes = np.random.default_rng(3), [], set()
    shutil.copytree(shipped.calibration("recording-132ghz.h5").parent, tmp_path / "whole")
    files = [tmp_path / "whole" / name for name in NAMES]
    for number in range(30):
        file = files[number % len(files)]
        here = file.with_stem("damaged")
        here.write_bytes(mutated(file, files, rng))
        command = ("check", here) if file.suffix == ".h5" else ("info", files[0], "--sounder", here)
        code = run(*command)
        codes.add(code)
        faults += [(number, *command, fault) for fault in Ended(code, capsys.readouterr().err).faults]
    assert not faults
    assert codes == {0, 1}


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
