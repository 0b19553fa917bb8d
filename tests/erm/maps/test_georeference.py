"""A place on earth: the published example, an independent ellipsoid, and files in WGS 84 that give metres back."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from erm.common.errors import DataError
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.maps.georeference import Georeference
from erm.maps.outline import outline_of, read_outline
from erm.maps.reflectors import make_reflectors

SQUARE = np.array([[[0, 0], [10, 0]], [[10, 0], [10, 10]], [[10, 10], [0, 10]], [[0, 10], [0, 0]]], dtype=float)
PLACE = Georeference(48.1, 11.5, 520.0, 30.0)
MICROMETRE = 1e-6


def geocentric(longitude, latitude, height):
    """Earth-fixed coordinates [m] by the closed form and the defining constants of WGS 84."""
    a, f = 6378137.0, 1 / 298.257223563
    phi, lam = np.radians(latitude), np.radians(longitude)
    n = a / np.sqrt(1 - f * (2 - f) * np.sin(phi) ** 2)
    ring = (n + height) * np.cos(phi)
    return np.stack([ring * np.cos(lam), ring * np.sin(lam), ((1 - f) ** 2 * n + height) * np.sin(phi)], axis=-1)


def random_frame(rng: np.random.Generator) -> Georeference:
    return Georeference(rng.uniform(-89, 89), rng.uniform(-180, 180), rng.uniform(-100, 3000), rng.uniform(-360, 360))


def as_written(path: Path) -> list:
    return [feature["geometry"]["coordinates"] for feature in json.loads(path.read_text())["features"]]


def test_the_published_example_comes_out():
    # EPSG Guidance Note 7-2, geographic/topocentric conversions; printed to the millimetre
    frame = Georeference(55.0, 5.0, 200.0)
    place = [2 + 7 / 60 + 46.38 / 3600, 53 + 48 / 60 + 33.82 / 3600, 73.0]
    found = frame.to_geodetic([-189013.869, -128642.040, -4220.171])
    # half a millimetre is 5e-9 degree of latitude, and 8e-9 of longitude there
    assert (np.abs(found - place) <= [1e-8, 1e-8, 1e-3]).all()


def test_a_place_beyond_100_km_is_a_mistake():
    with pytest.raises(DataError, match=r"longitude 5\.0, latitude 56\.0 is more than 100 km"):
        Georeference(55.0, 5.0).to_local([[5.0, 55.5], [5.0, 56.0]])


@pytest.mark.parametrize("seed", range(5))
def test_distances_to_the_origin_and_between_points_are_those_in_space(seed):
    rng = np.random.default_rng(seed)
    frame = random_frame(rng)
    local = np.concatenate([np.zeros((1, 3)), rng.uniform(-1000, 1000, (20, 3))])
    fixed = geocentric(*frame.to_geodetic(local).T)
    # 6.4e6 m hold 1e-9 m; the series of the inverse in PROJ is good to less than a micrometre near the ground
    through, along = (np.linalg.norm(points[:, None] - points, axis=-1) for points in (fixed, local))
    np.testing.assert_allclose(through, along, rtol=0, atol=MICROMETRE)


@pytest.mark.parametrize(("heading", "axis"), [(0, 1), (90, 0), (-30, None), (200, None)])
def test_the_local_y_axis_points_along_the_heading(heading, axis):
    frame = Georeference(48.1, 11.5, 520.0, heading)
    longitude, latitude, _ = frame.to_geodetic([0.0, 1.0, 0.0])
    north = geocentric(11.5, 48.1 + 1e-4, 520.0) - geocentric(11.5, 48.1 - 1e-4, 520.0)
    east = geocentric(11.5 + 1e-4, 48.1, 520.0) - geocentric(11.5 - 1e-4, 48.1, 520.0)
    step = geocentric(longitude, latitude, 520.0) - geocentric(11.5, 48.1, 520.0)
    bearing = np.degrees(np.arctan2(step @ east / np.linalg.norm(east), step @ north / np.linalg.norm(north)))
    # rounding of 1e-9 m over the step of 1 m, and of 1e-9 over the 22 m chord
    assert (bearing - heading + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)
    if axis is not None:
        assert step @ (east, north)[axis] > 0


@pytest.mark.parametrize("seed", range(5))
def test_there_and_back_is_staying(seed):
    rng = np.random.default_rng(seed)
    frame = random_frame(rng)
    local = rng.uniform(-1000, 1000, (50, 3))
    np.testing.assert_allclose(frame.to_local(frame.to_geodetic(local)), local, rtol=0, atol=MICROMETRE)
    flat = frame.to_geodetic(local[:, :2])
    # without heights, too: the place on the plane z = 0, which at 1.4 km is 0.16 m above the ellipsoid
    np.testing.assert_allclose(frame.to_local(flat[:, :2])[:, :2], local[:, :2], rtol=0, atol=MICROMETRE)
    assert np.ptp(flat[:, 2]) > 0.05


@pytest.mark.parametrize("seed", range(3))
def test_geojson_in_wgs_84_gives_local_metres_back(tmp_path, seed):
    rng = np.random.default_rng(seed)
    table = make_reflectors(rng.uniform(-700, 700, (30, 2, 2)), top=9.0, support=3, covariance=np.diag([0.1, 0.01]))
    place = Environment(table, georeference=random_frame(rng)).with_poles(rng.uniform(-700, 700, (3, 2)), 0.2)
    write_map(place, tmp_path / "map.geojson")
    back = read_map(tmp_path / "map.geojson")
    # coordinates are rounded to 1e-11 degree, half of which is 0.6 micrometre
    for name in ("end_points", "centre"):
        np.testing.assert_allclose(back.reflectors[name], place.reflectors[name], rtol=0, atol=2 * MICROMETRE)
    for name in set(place.reflectors) - {"end_points", "centre"}:
        np.testing.assert_array_equal(back.reflectors[name], place.reflectors[name])
    assert back.georeference == place.georeference


def test_geojson_in_wgs_84_is_what_the_rfc_asks_for(tmp_path):
    write_map(Environment.walls(SQUARE, georeference=PLACE), tmp_path / "map.geojson")
    document = json.loads((tmp_path / "map.geojson").read_text())
    assert "crs" not in document
    assert document["georeference"] == {"latitude": 48.1, "longitude": 11.5, "height": 520.0, "heading": 30.0}
    first, second = as_written(tmp_path / "map.geojson")[0]
    assert first == [11.5, 48.1]  # longitude before latitude
    # heading 30 degrees: the local x axis points 10 m to 120 degrees
    metre = 1 / np.linalg.norm(geocentric(11.5, 48.1 + 1, 520) - geocentric(11.5, 48.1, 520))
    assert second[1] - 48.1 == pytest.approx(-5 * metre, rel=1e-3)  # a degree's chord is not its tangent
    assert second[0] > 11.5


def test_without_an_origin_geojson_is_in_local_metres(tmp_path):
    write_map(Environment.walls(SQUARE), tmp_path / "map.geojson")
    assert as_written(tmp_path / "map.geojson")[1] == SQUARE[1].tolist()


@pytest.mark.parametrize("suffix", [".h5", ".geojson", ".gpkg", ".csv"])
@pytest.mark.slow
def test_every_map_keeps_its_origin(tmp_path, suffix):
    for place in (Environment.walls(SQUARE, georeference=PLACE), Environment.empty(georeference=PLACE)):
        write_map(place, tmp_path / f"map{suffix}")
        assert read_map(tmp_path / f"map{suffix}").georeference == PLACE


def test_a_map_drawn_in_wgs_84_needs_latitude_and_longitude_of_its_origin(tmp_path):
    line = {"type": "LineString", "coordinates": [[11.5, 48.1], [11.501, 48.1]]}
    document = {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": line, "properties": None}]}
    path = tmp_path / "map.geojson"
    path.write_text(json.dumps(document | {"georeference": {"latitude": 48.1, "longitude": 11.5}}))
    along = np.diff(read_map(path).reflectors.end_points.values[0], axis=0)[0]
    parallel = np.linalg.norm(geocentric(11.501, 48.1, 0) - geocentric(11.5, 48.1, 0))
    assert along[0] == pytest.approx(parallel, abs=1e-6)
    path.write_text(json.dumps(document | {"crs": {"type": "name", "properties": {"name": "EPSG:4326"}}}))
    with pytest.raises(DataError, match="EPSG:4326 and no origin is known") as error:
        read_map(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("place", "complaint"),
    [
        ({}, "malformed"),
        ([48.1, 11.5], "malformed"),
        ({"latitude": 48.1, "longitude": "east"}, "malformed"),
        ({"latitude": 91.0, "longitude": 11.5}, "latitude 91"),
        ({"latitude": 48.1, "longitude": 181.0}, "longitude 181"),
        ({"latitude": 11.5, "longitude": 48.1}, "more than 100 km"),  # the wrong way round
    ],
)
def test_an_origin_that_is_none_is_refused_in_one_line(tmp_path, place, complaint):
    path = tmp_path / "map.geojson"
    write_map(Environment.walls(SQUARE, georeference=PLACE), path)
    path.write_text(json.dumps(json.loads(path.read_text()) | {"georeference": place}))
    with pytest.raises(DataError, match=complaint) as error:
        read_map(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


def test_wgs_84_without_its_library_names_the_extra(tmp_path, monkeypatch):
    place = Environment.walls(SQUARE, georeference=Georeference(1.0, 2.0))
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(DataError, match=r"map.geojson: .*sounder-to-map\[gis\]"):
        write_map(place, tmp_path / "map.geojson")
    write_map(place, tmp_path / "map.h5")  # local metres, which need none
    assert read_map(tmp_path / "map.h5").georeference == Georeference(1.0, 2.0)
    assert [path.name for path in tmp_path.iterdir()] == ["map.h5"]


@pytest.mark.parametrize("declared", ["georeference", "crs", "nothing"])
def test_an_outline_in_wgs_84_is_read_in_the_frame_of_the_map(tmp_path, declared):
    path = tmp_path / "outline.geojson"
    write_map(Environment.walls(SQUARE, georeference=Georeference(48.1, 11.5, 520.0)), path)
    document = json.loads(path.read_text())
    if declared != "georeference":
        del document["georeference"]
    if declared == "crs":
        document["crs"] = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    path.write_text(json.dumps(document))
    turned = SQUARE @ [[np.sqrt(0.75), 0.5], [-0.5, np.sqrt(0.75)]]  # the map's axes stand 30 degrees clockwise
    np.testing.assert_allclose(read_outline(path, georeference=PLACE), turned, rtol=0, atol=2 * MICROMETRE)
    if declared == "georeference":
        np.testing.assert_allclose(read_outline(path), SQUARE, rtol=0, atol=2 * MICROMETRE)
    else:
        with pytest.raises(DataError, match="no origin is known") as error:
            read_outline(path)
        assert str(error.value).startswith(str(path))
        assert "\n" not in str(error.value)


def test_an_outline_in_metres_stays_so_whatever_the_map_is(tmp_path):
    path = tmp_path / "outline.geojson"
    write_map(Environment.walls(SQUARE), path)
    np.testing.assert_array_equal(read_outline(path, georeference=PLACE), SQUARE)


def test_a_true_map_with_another_origin_is_judged_in_the_frame_of_the_map():
    truth = Environment.walls(SQUARE, georeference=PLACE)
    np.testing.assert_array_equal(outline_of(truth, PLACE), SQUARE)
    np.testing.assert_array_equal(outline_of(truth), SQUARE)
    other = replace(PLACE, heading=PLACE.heading + 180)
    np.testing.assert_allclose(outline_of(truth, other), -SQUARE, rtol=0, atol=MICROMETRE)
