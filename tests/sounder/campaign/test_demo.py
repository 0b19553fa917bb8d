"""The whole chain on a part of the letter's campaign: captures to a map that is scored."""

import re
from pathlib import Path

import pytest

from sounder import shipped
from sounder.campaign.demo import run_demo

# All along route 1: over a shorter stretch double bounces can pass for a wall that nothing contradicts.
KEPT = ("RX2_L", "RX4_L", "RX6_L", "RX7_L", "RX8_L", "RX9_L")


@pytest.fixture(scope="module")
def part(tmp_path_factory) -> Path:
    """The shipped scene with six of its receivers and two snapshots."""
    text = shipped.scene("uma.toml").read_text(encoding="utf-8")
    head, *blocks = re.split(r"(?m)^(?=\[)", text.replace("snapshots = 8", "snapshots = 2"))
    kept = [b for b in blocks if not b.startswith("[[receivers]]") or re.search(r'name = "([^"]+)"', b)[1] in KEPT]
    path = tmp_path_factory.mktemp("scene") / "part.toml"
    path.write_text(head + "".join(kept), encoding="utf-8")
    return path


@pytest.mark.slow
def test_captures_become_a_map(part, tmp_path, capsys):
    score = run_demo(tmp_path, scene=part)
    assert score.keys() >= {"walls", "false", "found", "missed", "accepted", "rmse", "planar_rmse"}
    # every wall that three accepted MPCs hit must be found, the east building's face among them
    assert score["found"] >= 1
    assert score["missed"] == 0
    assert score["false"] == 0
    assert score["walls"] >= score["found"]
    assert score["rmse"] < 0.30
    # 27 m of height between the antennas, on some 60 m of way: what the planar equations make of it is metres off
    assert score["planar_rmse"] > 3 * score["rmse"]

    assert sorted(path.stem for path in (tmp_path / "raw").iterdir()) == sorted(KEPT)
    assert sorted(path.stem for path in (tmp_path / "products").iterdir()) == sorted(KEPT)
    figures = {path.name for path in (tmp_path / "figures").iterdir()}
    first = min(KEPT)
    kinds = {f"{first}_{kind}.png" for kind in ("daps", "daps_polar", "pdp")}
    assert figures == {"map.png", "error_cdf.png", "RX2_L_RX9_L_daps_polar.png"} | kinds
    for name in ("map.geojson", "truth/environment.geojson", "truth/paths.h5", "back-to-back.h5", "report.html"):
        assert (tmp_path / name).is_file()

    printed = capsys.readouterr()
    assert printed.err == ""
    shown = dict(line.split("\t") for line in printed.out.splitlines() if "\t" in line)
    assert shown["positions"] == "6"
    assert shown["RP perpendicular error, RMSE"] == f"{score['rmse']:.3f} m"
    assert shown["the same by the planar equations of the letter"] == f"{score['planar_rmse']:.3f} m"
