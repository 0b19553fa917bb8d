"""Errors of points and walls are those a ruler would give."""

import json
from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.evaluation.outline import (
    evaluate_points,
    evaluate_walls,
    face_hits,
    point_errors,
    rounded,
    specular_points,
    summary,
)
from erm.maps.environment import Environment
from erm.maps.georeference import Georeference
from erm.maps.outline import outline_of, read_outline

SQUARE = np.array([[[0, 0], [10, 0]], [[10, 0], [10, 10]], [[10, 10], [0, 10]], [[0, 10], [0, 0]]], dtype=float)


def test_perpendicular_error_is_blind_along_the_face_and_distance_is_not():
    errors = point_errors([[5.0, 0.3], [13.0, -0.4]], SQUARE[:1], [[4.0, 0.0], [10.0, 0.0]])
    np.testing.assert_allclose(errors.perpendicular, [0.3, 0.4])
    np.testing.assert_allclose(errors.distance, [0.3, np.hypot(3, 0.4)])
    assert errors.full is not None
    np.testing.assert_allclose(errors.full, [np.hypot(1, 0.3), np.hypot(3, 0.4)])


def test_a_face_reflects_where_the_angles_are_equal_whichever_way_it_was_drawn():
    tx, rx = np.array([[2.0, 6.0, 9.0]]), np.array([[11.0, 3.0, 1.5]])
    for face in (SQUARE[:1], SQUARE[:1, ::-1]):
        # heights of 6 and 3 m above the face divide the 9 m between the antennas 2 to 1
        np.testing.assert_allclose(specular_points(tx, rx, face), [[8.0, 0.0]], atol=1e-12)
    assert np.isnan(specular_points(tx, -rx, SQUARE[:1])).all()


def test_errors_do_not_depend_on_the_frame():
    rng = np.random.default_rng(3)
    points, angle, shift = rng.uniform(-5, 15, (50, 2)), rng.uniform(0, 6), rng.uniform(-99, 99, 2)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    here, there = point_errors(points, SQUARE), point_errors(points @ turn + shift, SQUARE @ turn + shift)
    np.testing.assert_allclose(here.distance, there.distance, atol=1e-12)


def test_rmse_is_mean_and_standard_deviation_together():
    errors = np.random.default_rng(1).gamma(2, size=100)
    result = summary(errors)
    assert result["rmse"] ** 2 == pytest.approx(result["mean"] ** 2 + result["std"] ** 2)
    assert result["min"] <= result["median"] <= result["max"]


def test_nothing_to_judge_is_no_error():
    result = evaluate_points(np.empty((0, 2)), SQUARE)
    assert result["distance"]["count"] == 0
    assert json.dumps(rounded(result)).count("null") == 12


def test_a_map_judged_by_itself_is_perfect():
    result = evaluate_walls(Environment.walls(SQUARE), SQUARE)
    assert (result["found"], result["missed"], result["false"]) == (4, 0, 0)
    assert result["offset_error"]["max"] == 0


def test_a_wall_has_no_direction():
    assert evaluate_walls(Environment.walls(SQUARE[:, ::-1]), SQUARE)["matches"] == [0, 1, 2, 3]


def test_a_shifted_wall_is_found_with_its_error_and_a_far_one_is_false():
    walls = [[[2, 0.2], [8, 0.2]], [[2, 5], [8, 5]], [[2, 2], [4, 4]]]
    result = evaluate_walls(Environment.walls(walls), SQUARE)
    assert result["matches"] == [0, -1, -1]
    assert result["offset_error"]["max"] == pytest.approx(0.2)
    assert (result["found"], result["false"]) == (1, 2)


def test_a_wall_over_two_faces_in_line_finds_both():
    faces = np.array([[[0, 0], [10, 0]], [[11, 0], [20, 0]]], dtype=float)
    result = evaluate_walls(Environment.walls([[[1, 0], [19, 0]]]), faces)
    assert (result["found"], result["false"]) == (2, 0)


def test_shares_of_length_are_those_a_ruler_gives():
    # half of the first wall runs along the lower side, the other half beyond its end; the second is 0.3 m off
    walls = [[[5, 0.1], [15, 0.1]], [[0, 10.3], [10, 10.3]]]
    result = evaluate_walls(Environment.walls(walls), SQUARE)
    assert result["correctness"] == pytest.approx(5 / 20, abs=0.03)
    assert result["completeness"] == pytest.approx(5 / 40, abs=0.03)


def test_only_faces_that_were_hit_can_be_missed():
    hits = face_hits([[5, 0], [6, 0.01], [7, 0], [10, 5], [5, 5]], SQUARE)
    assert hits.tolist() == [3, 1, 0, 0]
    result = evaluate_walls(Environment.empty(), SQUARE, hits)
    assert (result["found"], result["missed"]) == (0, 1)


def feature(geometry, **properties):
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def write(path: Path, *features) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def line(*points):
    return {"type": "LineString", "coordinates": [list(point) for point in points]}


def test_outlines_are_lines_and_rings_of_one_slice_that_someone_sees(tmp_path: Path):
    ring = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 0]]]}
    path = write(
        tmp_path / "o.geojson",
        feature(line((0, 0, 7), (1, 0, 7), (1, 1, 7)), z_slice_m=1.5, visible_from_any_rx_frac=0.4),
        feature(line((0, 0), (1, 0)), z_slice_m=2.0),
        feature(line((5, 5), (6, 5)), z_slice_m=1.5, visible_from_any_rx_frac=0.0),
        feature(ring),
        feature({"type": "Point", "coordinates": [0, 0]}),
    )
    assert read_outline(path).shape == (2 + 3, 2, 2)
    assert len(read_outline(path, z_slice=2.0)) == 1 + 3
    assert len(read_outline(path, min_visible=0.5)) == 3
    assert len(read_outline(path, min_visible=-1.0)) == 2 + 1 + 3


def test_an_environment_is_an_outline_without_its_poles():
    environment = Environment.walls(SQUARE).with_poles([[5, 5]], 0.1)
    np.testing.assert_array_equal(outline_of(environment), SQUARE)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("nonsense", "not JSON"),
        ("[1, 2]", "no GeoJSON type"),
        ('{"type": "FeatureCollection", "features": []}', "no LineString or Polygon is left"),
        (
            '{"type": "Feature", "geometry": null}',
            "no LineString or Polygon is left",
        ),
        ('{"type": "FeatureCollection", "features": null}', "features is not a list"),
        ('{"type": "LineString", "coordinates": [[1], [2]]}', "two finite numbers"),
        ('{"type": "LineString", "coordinates": [[0, 0], [9, 0]], "crs": {"type": "link"}}', "crs has no name"),
    ],
)
def test_what_is_no_outline_is_refused_in_one_line(tmp_path: Path, text, complaint):
    path = tmp_path / "o.geojson"
    path.write_text(text)
    with pytest.raises(DataError, match=complaint) as error:
        read_outline(path)
    assert "\n" not in str(error.value)


def test_a_missing_outline_is_named(tmp_path: Path):
    with pytest.raises(DataError, match="no such file"):
        read_outline(tmp_path / "none.geojson")


def test_numbers_written_as_text_and_features_without_geometry_are_read(tmp_path: Path):
    def feature(line, **properties):
        return {"type": "Feature", "geometry": line and {"type": "LineString", "coordinates": line}} | properties

    features = [
        feature([[0, 0], [9, 0]], properties={"z_slice_m": "1.5", "visible_from_any_rx_frac": "0.8"}),
        feature([[0, 9], [9, 9]], properties={"z_slice_m": 1.5}),
        feature([[0, 5], [9, 5]], properties={"z_slice_m": "3"}),
        feature(None, properties=None),
    ]
    path = tmp_path / "o.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8-sig")
    assert read_outline(path, min_visible=0.5).tolist() == [[[0, 0], [9, 0]], [[0, 9], [9, 9]]]
    path.write_text(json.dumps(feature([[0, 0], [9, 0]], properties={"z_slice_m": "low"})))
    with pytest.raises(DataError, match="property z_slice_m is 'low'; expected a number"):
        read_outline(path)


@pytest.mark.parametrize("code", [25832, 3857, 4326])
def test_a_declared_coordinate_system_is_that_of_its_library(tmp_path: Path, code):
    pyproj = pytest.importorskip("pyproj")
    frame = Georeference(48.1, 11.5, height=520.0, heading=30.0)
    local = np.array([[0.0, 0.0], [100.0, 20.0]])
    geodetic = frame.to_geodetic(local)
    declared = pyproj.Transformer.from_crs(4326, code, always_xy=True).transform(*geodetic[:, :2].T)
    line = {"type": "LineString", "coordinates": np.column_stack(declared).tolist()}
    path = tmp_path / "o.geojson"
    for name in (f"EPSG:{code}", f"urn:ogc:def:crs:EPSG::{code}"):
        path.write_text(json.dumps(line | {"crs": {"type": "name", "properties": {"name": name}}}))
        np.testing.assert_allclose(read_outline(path, georeference=frame)[0], local, atol=1e-6)
    path.write_text(json.dumps(line | {"crs": {"type": "name", "properties": {"name": "EPSG:1"}}}))
    with pytest.raises(DataError, match="coordinate system EPSG:1 is not known"):
        read_outline(path, georeference=frame)


def test_an_arc_is_one_element_of_a_map_whatever_its_chords():
    place = Environment.walls([[[-30.0, 10.0], [30.0, 10.0]]])
    place = place.with_arcs([[0.0, -20.0], [40.0, 0.0]], [8.0, 5.0], [[45.0, 135.0], [170.0, 190.0]])
    outline = outline_of(place)
    result = evaluate_walls(Environment(place.reflectors.isel(reflector=[0, 1])), outline)
    assert (result["walls"], result["false"]) == (2, 0)
    assert result["correctness"] == pytest.approx(1.0)
    missing, whole = 5 * np.deg2rad(20), 60 + 8 * np.pi / 2 + 5 * np.deg2rad(20)
    assert result["completeness"] == pytest.approx(1 - missing / whole, abs=0.005)
    moved = Environment.empty().with_arcs([[0.0, -17.0]], [8.0], [[45.0, 135.0]])
    assert evaluate_walls(moved, outline)["false"] == 1
