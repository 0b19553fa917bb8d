"""Arcs in maps: every format keeps them, drawings show them, and lines of points are read as one face."""

import json

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.evaluation.outline import evaluate_walls
from erm.maps.arcs import SAGITTA, arc_points
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.maps.formats.surfaces import extrude
from erm.maps.georeference import Georeference
from erm.maps.outline import outline_of
from erm.tracing.trace import trace


def rounded_place(**others) -> Environment:
    place = Environment.walls([[[-20.0, 8.0], [20.0, 8.0]]], top=6.0, **others)
    place = place.with_arcs(
        [[12.0, -15.0], [0.0, 30.0]], [3.0, -25.0], [[80.0, 190.0], [200.0, 340.0]], top=5.0, radius_std=0.1, support=7
    )
    return place.with_poles([[3.0, 3.0]], 0.2, top=4.0)


@pytest.mark.parametrize("suffix", [".h5", ".geojson", ".csv"])
def test_maps_keep_arcs(tmp_path, suffix):
    place = rounded_place()
    write_map(place, tmp_path / f"map{suffix}")
    back = read_map(tmp_path / f"map{suffix}")
    for name in place.reflectors:
        np.testing.assert_array_equal(back.reflectors[name], place.reflectors[name])


def test_geojson_draws_an_arc_along_its_face(tmp_path):
    write_map(rounded_place(), tmp_path / "map.geojson")
    features = json.loads((tmp_path / "map.geojson").read_text())["features"]
    convex, concave = (one for one in features if one["properties"]["kind"] == "arc")
    for feature, centre, radius in ((convex, [12.0, -15.0], 3.0), (concave, [0.0, 30.0], -25.0)):
        assert feature["properties"]["centre"] == centre
        assert feature["properties"]["radius"] == radius
        line = np.array(feature["geometry"]["coordinates"])
        middle = (line[1:] + line[:-1]) / 2
        assert np.linalg.norm(line - centre, axis=-1) == pytest.approx(abs(radius), abs=1e-9)
        assert (abs(radius) - np.linalg.norm(middle - centre, axis=-1)).max() < SAGITTA


def test_an_arc_on_earth_comes_back(tmp_path):
    place = rounded_place(georeference=Georeference(-73.98, 40.75, 20.0, 29.0))
    write_map(place, tmp_path / "map.geojson")
    back = read_map(tmp_path / "map.geojson").reflectors
    for name in ("end_points", "centre"):
        np.testing.assert_allclose(back[name], place.reflectors[name], rtol=0, atol=2e-6)


@pytest.mark.parametrize("ahead", [True, False])
def test_a_drawn_arc_needs_no_centre(tmp_path, ahead):
    points = arc_points([[14.0, 5.0], [10.0, 9.0]], [10.0, 5.0], 4.0)
    drawn = {"type": "LineString", "coordinates": (points if ahead else points[::-1]).tolist()}
    feature = {"type": "Feature", "geometry": drawn, "properties": {"kind": "arc", "radius": -1}}
    (tmp_path / "drawn.geojson").write_text(json.dumps(feature))
    arc = read_map(tmp_path / "drawn.geojson").reflectors
    assert arc.centre.values[0] == pytest.approx([10.0, 5.0], abs=1e-6)
    assert arc.radius.item() == pytest.approx(-4.0, abs=1e-6)
    assert arc.end_points.values[0] == pytest.approx(np.array([[14.0, 5.0], [10.0, 9.0]]), abs=1e-9)


def test_an_arc_off_its_circle_is_refused(tmp_path):
    drawn = {"type": "LineString", "coordinates": [[4.0, 0.0], [3.0, 3.0], [0.0, 4.0]]}
    feature = {"type": "Feature", "geometry": drawn, "properties": {"kind": "arc", "radius": 4, "centre": [1, 1]}}
    (tmp_path / "drawn.geojson").write_text(json.dumps(feature))
    with pytest.raises(DataError, match="not on the circle"):
        read_map(tmp_path / "drawn.geojson")


def test_drawings_show_arcs_toward_the_antennas():
    _, convex, concave, _ = extrude(rounded_place(), height=30.0, margin=5.0)
    for surface, centre, sign in ((convex, [12.0, -15.0], 1), (concave, [0.0, 30.0], -1)):
        a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
        outward = np.cross(b - a, c - a)[:, :2]
        assert (sign * np.sum(outward * (a[:, :2] - centre), axis=-1) > 0).all()


def test_a_turned_and_shifted_place_reflects_the_same():
    place, tx, rx = rounded_place(), np.array([0.0, 0.0, 2.0]), np.array([9.0, -2.0, 1.0])
    moved = place.moved(37.0, [5.0, -3.0])
    turn = np.deg2rad(37.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ends = [np.append(rotation @ end[:2] + [5.0, -3.0], end[2]) for end in (tx, rx)]
    before, after = trace(place, tx, rx, 60e9, max_order=1), trace(moved, *ends, 60e9, max_order=1)
    assert set(before.reflector.values.ravel().tolist()) >= {1, 2, 3}
    assert after.delay.values == pytest.approx(before.delay.values, rel=1e-12)
    assert after.path_gain.values == pytest.approx(before.path_gain.values, abs=1e-7)


def test_arcs_count_in_an_evaluation():
    place = rounded_place()
    outline = outline_of(place)
    assert evaluate_walls(place, outline)["completeness"] == pytest.approx(1.0)
    flat = Environment(place.reflectors.isel(reflector=[0]))
    share = 40.0 / np.linalg.norm(outline[:, 1] - outline[:, 0], axis=-1).sum()
    assert evaluate_walls(flat, outline)["completeness"] == pytest.approx(share, abs=0.01)
