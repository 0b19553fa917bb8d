"""A batch outlives whatever happens to one of its inputs."""

import os
import threading
import time
from pathlib import Path

import pytest

import sounder
from sounder import shipped

from ..cli.commands import run


@pytest.fixture
def jobs(tmp_path: Path):
    """Two positions, of which a test spoils the first."""
    raw = shipped.calibration("recording-132ghz.h5").read_bytes()
    for name in ("a.h5", "b.h5"):
        (tmp_path / name).write_bytes(raw)
    made, failures = sounder.gather(
        [tmp_path / "a.h5", tmp_path / "b.h5"], calibration=shipped.calibration("back-to-back-132ghz.h5")
    )
    assert not failures
    return made


@pytest.mark.slow
@pytest.mark.parametrize(
    ("harm", "line"),
    [
        (Path.unlink, "a.h5: iq cannot be read (No such file or directory)"),
        (lambda path: os.truncate(path, 200_000), "a.h5: became shorter while it was read"),
        (lambda path: (path.unlink(), path.mkdir()), "a.h5: iq cannot be read (Is a directory)"),
    ],
)
def test_an_input_that_is_spoilt_after_it_was_opened_costs_its_position_one_line(jobs, harm, line, tmp_path):
    harm(tmp_path / "a.h5")
    outcome = sounder.process(jobs, tmp_path / "out")
    assert [product.name for product in outcome.products] == ["synthetic-two-paths.h5"]  # of b.h5
    (failure,) = outcome.failures
    assert line in failure
    assert "\n" not in failure


def test_positions_that_vanish_while_others_are_processed_cost_a_line_each(campaign_maker, tmp_path, capsys):
    *files, b2b = campaign_maker(35, snapshots=2)
    out = tmp_path / "out"

    def remove() -> None:
        while not list(out.glob("*.h5")):
            time.sleep(0.001)
        for file in files[-6:-1]:
            file.unlink()

    remover = threading.Thread(target=remove)
    remover.start()
    arguments = ["process", *files, "--calibration", b2b, "--out", out, "--threads", "1"]
    assert run(*arguments) == 1
    remover.join()
    assert len(list(out.iterdir())) == 30
    lines = [line for line in capsys.readouterr().err.splitlines() if "No such file" in line]
    assert [line.partition(":")[0] for line in lines] == [str(file) for file in files[-6:-1]]
