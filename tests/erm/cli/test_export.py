"""The command that takes a map from any format to any other, and to its place on earth."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from erm.cli import app
from erm.common.errors import DataError
from erm.maps.environment import Environment, Slab
from erm.maps.formats import read_map, write_map
from erm.maps.georeference import Georeference

ENDS = np.array([[[0.0, 0.0], [20.0, 0.0]], [[20.0, 0.0], [20.0, 10.0]]])


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    place = Environment.walls(ENDS, ground=Slab(0.0)).with_poles([[3.0, 4.0]], 0.1)
    write_map(place, tmp_path / "map.h5")
    return tmp_path / "map.h5"


def export(*arguments):
    return CliRunner().invoke(app, ["export", *map(str, arguments)])


MESHES = {".xml": "; meshes: map-*.ply"}


@pytest.mark.parametrize("suffix", [".geojson", ".gpkg", ".csv", ".ply", ".obj", ".xml"])
@pytest.mark.slow
def test_a_map_goes_to_any_format(tmp_path, map_file, suffix):
    out = tmp_path / "out" / f"map{suffix}"
    result = export(map_file, "--out", out)
    assert (result.exit_code, result.output) == (0, f"{out}: 2 walls and 1 pole{MESHES.get(suffix, '')}\n")
    assert out.stat().st_size > 100


@pytest.mark.slow
def test_an_origin_puts_a_map_on_earth_and_stays_with_it(tmp_path, map_file):
    placed, wgs, back = (tmp_path / name for name in ("placed.h5", "wgs.geojson", "back.csv"))
    origin = ("--origin", 48.1, -11.5, "--origin-height", 520, "--heading", -30)
    assert export(map_file, "--out", placed, *origin).exit_code == 0
    assert read_map(placed).georeference == Georeference(48.1, -11.5, 520.0, -30.0)
    assert export(placed, "--out", wgs).exit_code == 0
    assert export(wgs, "--out", back).exit_code == 0
    place = read_map(back)
    assert place.georeference == Georeference(48.1, -11.5, 520.0, -30.0)
    np.testing.assert_allclose(place.reflectors["end_points"][:2], ENDS, rtol=0, atol=2e-6)  # 1e-11 degree, rounded


@pytest.mark.slow
def test_options_reach_the_drawing(tmp_path, map_file):
    for height, margin in ((12.0, 50.0), (30.0, 5.0)):
        assert export(map_file, "--out", tmp_path / "a.obj", "--height", height, "--margin", margin).exit_code == 0
        rows = [line.split()[1:] for line in (tmp_path / "a.obj").read_text().splitlines() if line.startswith("v ")]
        vertices = np.array(rows, dtype=float)
        np.testing.assert_array_equal(vertices.max(axis=0), [20 + margin, 10 + margin, height])
    assert export(map_file, "--out", tmp_path / "a.xml", "--frequency", 105e9).exit_code == 0
    assert "105GHz-concrete" in (tmp_path / "a.xml").read_text()


def test_a_heading_without_an_origin_is_wrong_usage(tmp_path, map_file):
    result = export(map_file, "--out", tmp_path / "a.geojson", "--heading", 30)
    assert result.exit_code == 2
    assert "--origin" in result.output
    assert not (tmp_path / "a.geojson").exists()


def test_a_drawing_or_an_unknown_format_is_one_line(tmp_path, map_file):
    for source, out, complaint in ((map_file, "a.shp", "choose .h5"), (tmp_path / "a.ply", "b.h5", "drawing")):
        error = export(source, "--out", tmp_path / out).exception
        assert isinstance(error, DataError)
        assert complaint in str(error)
        assert "\n" not in str(error)
