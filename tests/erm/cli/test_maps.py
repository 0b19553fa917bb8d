"""The command line: MPCs to a map, a map to its score and its paths."""

import hashlib
import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.mpcs.files import read_csv

from .commands import run


@pytest.mark.slow
def test_positions_are_added_to_a_map_file(tmp_path: Path, mpcs: Path, capsys):
    header, *rows = mpcs.read_text().splitlines()
    for name, part in (("first", rows[:4]), ("second", rows[4:])):
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *part]) + "\n")
    assert run("reconstruct", tmp_path / "first.csv", "--out", tmp_path / "map.h5") == 0
    assert (
        run("reconstruct", tmp_path / "second.csv", "--add-to", tmp_path / "map.h5", "--out", tmp_path / "all.h5") == 0
    )
    assert "1 wall and 0 poles from 6 of 6 MPCs" in capsys.readouterr().out
    assert (
        run("reconstruct", tmp_path / "second.csv", "--add-to", tmp_path / "map.h5", "--out", tmp_path / "map.h5") == 2
    )
    assert "is an input, which would be replaced" in capsys.readouterr().err


@pytest.mark.slow
def test_mpcs_become_a_map_that_predicts_them(tmp_path: Path, mpcs: Path, capsys):
    out, rps, figure = tmp_path / "map.geojson", tmp_path / "rps.csv", tmp_path / "map.png"
    assert run("reconstruct", mpcs, "--out", out, "--rps", rps, "--figure", figure) == 0
    printed = capsys.readouterr()
    assert "1 wall and 0 poles from 6 of 6 MPCs" in printed.out
    assert printed.err == ""
    wall = read_map(out).reflectors.isel(reflector=0)
    assert wall["offset"].item() == pytest.approx(-9, abs=1e-3)
    assert figure.stat().st_size > 1000
    header, *rows = rps.read_text().splitlines()
    assert header.startswith("position,wall,rp_x,rp_y,rp_z")
    assert len(rows) == 6

    assert run("predict", out, "--tx", -40, 3, 12, "--rx", -10, -0.8, 1.5, "--out", tmp_path / "p.csv") == 0
    table, complaints = read_csv(tmp_path / "p.csv")
    assert complaints == []
    measured, _ = read_csv(mpcs)
    reflected = table["delay"].values[1]
    assert table["los"].values.tolist() == [1, 1]
    assert reflected == pytest.approx(measured["delay"].values[1], abs=1e-12)
    assert capsys.readouterr().out.splitlines()[0].split("\t")[0] == "delay [ns]"


@pytest.mark.parametrize("suffix", ["h5", "geojson", "gpkg", "csv"])
@pytest.mark.slow
def test_a_map_tells_where_it_came_from(tmp_path: Path, mpcs: Path, suffix):
    other, out = tmp_path / "other" / "mpcs.csv", tmp_path / f"map.{suffix}"
    other.parent.mkdir()
    other.write_text(mpcs.read_text().splitlines()[0] + "\n")
    assert run("reconstruct", mpcs, other, "--out", out, "--max-loss", 9, "--min-support", 2, "--ground", -1) == 0
    told = read_map(out).reflectors.attrs
    assert told["history"] == "erm reconstruct"
    assert json.loads(told["input_sha256"]) == {
        f"{path.parent.name}/mpcs.csv": hashlib.sha256(path.read_bytes()).hexdigest() for path in (mpcs, other)
    }
    assert json.loads(told["processing_options"]) == {
        "threshold": "consistency",
        "max_reflection_loss": 9,
        "min_support": 2,
        "ground_height": -1,
        "rx_std": None,
        "heading_std": None,
        "clock_std": None,
        "as_given": False,
    }


@pytest.mark.slow
def test_a_map_is_judged_with_and_without_its_points(tmp_path: Path, mpcs: Path, capsys):
    out, outline = tmp_path / "map.h5", tmp_path / "outline.geojson"
    write_map(Environment.walls([[[-60, -9.1], [60, -9.1]]]), outline)
    assert run("reconstruct", mpcs, "--out", out) == 0
    capsys.readouterr()
    assert run("evaluate", out, mpcs, "--outline", outline, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert result["walls"]["found"] == 1
    assert result["walls"]["offset_error"]["rmse"] == pytest.approx(0.1, abs=1e-3)
    assert result["points"]["single"]["perpendicular"]["mean"] == pytest.approx(0.1, abs=1e-3)
    assert result["points"]["planar"]["perpendicular"]["mean"] > 0.3
    # exact paths off a wall 0.1 m off the outline's, which reflects them some centimetres along it from there
    assert 0.1 < result["points"]["merged"]["full"]["mean"] < 0.2
    assert result["points"]["planar"]["full"]["mean"] > result["points"]["planar"]["perpendicular"]["mean"]
    assert result["visible"][0]["length"] == pytest.approx(120)  # every receiver sees the one wall
    assert 0 < result["visible"][0]["share"] < 0.5  # of which only the middle reflected
    assert run("evaluate", out, "--outline", outline) == 0
    assert "1 wall, 0 false; 1 of 1 face of the outline found" in capsys.readouterr().out


@pytest.mark.slow
def test_a_map_is_drawn_over_the_outline_that_judges_it(tmp_path: Path, mpcs: Path, capsys):
    out, outline, figure = tmp_path / "map.h5", tmp_path / "outline.geojson", tmp_path / "map.svg"
    write_map(Environment.walls([[[-60, -9.1], [60, -9.1]]]), outline)
    assert run("reconstruct", mpcs, "--out", out) == 0
    assert run("evaluate", out, mpcs, "--outline", outline, "--figure", figure) == 0
    drawn = figure.read_text()
    for label in ("merged wall", "reflection point", "RX", "known outline"):
        assert f"<!-- {label} -->" in drawn  # matplotlib says beside a text's outlines what it reads
    assert run("evaluate", out, "--outline", outline, "--figure", outline) == 2  # which would be replaced
    assert run("evaluate", out, mpcs, "--leave-one-out", "--figure", figure) == 2


def test_errors_of_millimetres_are_told(tmp_path: Path, capsys):
    write_map(Environment.walls([[[-60, 0], [60, 0]]]), tmp_path / "map.h5")
    write_map(Environment.walls([[[-60, 0.00312], [60, 0.00312]], [[-60, 20], [60, 20]]]), tmp_path / "outline.geojson")
    assert run("evaluate", tmp_path / "map.h5", "--outline", tmp_path / "outline.geojson") == 0
    walls, shares, header, offset, _ = capsys.readouterr().out.splitlines()
    assert walls == "1 wall, 0 false; 1 of 2 faces of the outline found, receivers see them or not"
    assert shares == "100 % of the length of the walls lies on a face; 50 % of the outline has a wall"
    told = dict(zip(header.split("\t"), offset.split("\t"), strict=True))
    assert (told["error"], told["count"], told["rmse"]) == ("walls: offset [m]", "1", "0.00312")


def test_no_path_is_said(tmp_path: Path, capsys):
    write_map(Environment.walls([[[-9, 5], [9, 5]]]), tmp_path / "map.h5")
    assert run("predict", tmp_path / "map.h5", "--tx", 0, 0, 9, "--rx", 0, 9, 2) == 0
    assert capsys.readouterr().err == "no path with at most 2 reflections from TX to RX\n"


def test_no_components_are_an_empty_map(tmp_path: Path, mpcs: Path):
    mpcs.write_text(mpcs.read_text().splitlines()[0] + "\n")
    assert run("reconstruct", mpcs, "--out", tmp_path / "map.csv") == 0
    assert read_map(tmp_path / "map.csv").reflectors.sizes["reflector"] == 0


def test_version_and_a_line_for_each_command(monkeypatch, capsys):
    assert run("--version") == 0
    assert capsys.readouterr().out == f"sounder-to-map {version('sounder-to-map')}\n"
    monkeypatch.setenv("COLUMNS", "80")
    assert run("--help") == 0
    told = capsys.readouterr().out
    assert "Reconstruct the environment from multipath components" in told
    assert "..." not in told.partition("Commands:")[2]


def test_help_imports_nothing_that_takes_time():
    heavy = "import erm.cli, sys; sys.exit(any(name in sys.modules for name in ('numpy', 'xarray', 'matplotlib')))"
    assert subprocess.run([sys.executable, "-c", heavy], check=False).returncode == 0
