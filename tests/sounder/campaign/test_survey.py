"""What all positions of a campaign have wrong together is told in one line."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import erm
from erm.common.storage import write_product
from erm.mpcs.files import read_mpcs
from sounder.campaign.survey import remarks_on_survey

STREET = erm.Environment.walls([[[-60, 10], [60, 10]], [[-60, -14], [60, -14]]], top=40.0)
PLACES = [(float(x), x / 3 - 9, 2.0) for x in range(8, 40, 4)]
TX = (0.0, 0.0, 9.0)


def products(folder: Path, *, places=PLACES, tx=TX, doubts="", **off: float) -> list[Path]:
    """Products whose MPCs are off the truth, or whose places are stated as others."""
    rng = np.random.default_rng(1)
    made = []
    for k, (true, stated) in enumerate(zip(PLACES, places, strict=True)):
        mpc = erm.predict(STREET, TX, true, 132e9)
        std = {"delay": 1e-11, "azimuth": 0.1, "elevation": 0.2, "path_gain": 0.3}
        columns = {}
        for name, one in std.items():
            noise = one * rng.normal(size=mpc.sizes["mpc"])
            columns[name] = ("mpc", mpc[name].values + noise + off.get(name, 0.0))
            columns[f"{name}_std"] = ("mpc", np.full(mpc.sizes["mpc"], one))
        ends = {"tx_position": ("xyz", list(tx)), "rx_position": ("xyz", list(stated))}
        root = xr.Dataset(ends, attrs={"frequency": 132e9, "los": 1, "doubts": doubts})
        made.append(folder / f"P{k}.h5")
        write_product({"/": root, "/mpc": xr.Dataset(columns)}, made[-1])
    return made


@pytest.mark.slow
def test_clean_positions_are_not_remarked(tmp_path: Path) -> None:
    assert remarks_on_survey(products(tmp_path)) == []


@pytest.mark.parametrize(
    ("off", "what"),
    [
        ({"azimuth": 10.0}, "error of heading of \\+(10.0|9.9)"),
        ({"delay": -1 / 1.2e9}, "error of clock of -0.83 ns"),
        ({"path_gain": 20.0}, "error of gain of \\+(20|19)"),
        ({"places": [(y, x, z) for x, y, z in PLACES]}, "east and north exchanged"),
    ],
)
@pytest.mark.slow
def test_common_errors_are_named_though_every_position_is_doubtful(tmp_path: Path, off, what) -> None:
    [line] = remarks_on_survey(products(tmp_path, doubts="azimuth", **off))

    assert re.search(what, line)


@pytest.mark.slow
def test_a_doubt_that_most_positions_share_is_left_to_the_calibration(tmp_path: Path) -> None:
    every = products(tmp_path, doubts="azimuth")
    assert read_mpcs(every)[0].sizes["mpc"] > 0
    assert read_mpcs(every[:2])[0].sizes["mpc"] == 0
    (tmp_path / "hard").mkdir()
    assert read_mpcs(products(tmp_path / "hard", doubts="position"))[0].sizes["mpc"] == 0
