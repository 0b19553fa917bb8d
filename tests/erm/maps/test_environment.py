"""Environments: what they accept, how they move, and that files keep them whole."""

import json
import sys
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings

from erm.common.errors import DataError
from erm.geometry.vertical import unit
from erm.maps.environment import Environment, Slab
from erm.maps.formats import read_map, write_map
from erm.maps.formats.geopackage import LOCAL_METRES
from erm.maps.materials import Material
from erm.maps.outline import read_outline
from erm.maps.reflectors import make_reflectors

from ..strategies import maps

SUFFIXES = (".h5", ".geojson", ".gpkg", ".csv")


def random_place(seed: int) -> Environment:
    """Walls with every column set, infinite and finite heights, a pole, slabs, a material of its own."""
    rng = np.random.default_rng(seed)
    count = 6
    ends = rng.uniform(-200, 200, (count, 2, 2))
    root = rng.normal(size=(count, 2, 2))
    covariance = root @ root.swapaxes(1, 2)
    covariance[0] = np.nan
    table = make_reflectors(
        ends,
        base=[0.0, -np.inf, *rng.uniform(-2, 2, count - 2)],
        top=[np.inf, np.inf, *rng.uniform(5, 40, count - 2)],
        covariance=covariance,
        support=rng.integers(0, 50, count),
        residual=rng.uniform(0.5, 3, count),
        material=["plaster", "glass", "own", "brick", "metal", "concrete"],
    )
    own = Material("own", permittivity=(3.1, -0.1), conductivity=(0.01, 1.2), height_deviation=1e-4)
    place = Environment(table, Slab(-0.3, "asphalt"), Slab(12.5), {"own": own})
    return place.with_poles(rng.uniform(-50, 50, (2, 2)), [0.1, 0.25], top=[8.0, np.inf], covariance=covariance[1:3])


def assert_same(first: Environment, second: Environment) -> None:
    xr.testing.assert_equal(first.reflectors, second.reflectors)  # bit for bit
    assert (first.ground, first.ceiling) == (second.ground, second.ceiling)
    assert repr(first.materials) == repr(second.materials)  # an unknown correlation length is NaN != NaN


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=5, deadline=None)
@given(place=maps())
def test_a_file_gives_back_any_place_bit_for_bit(suffix, place):
    with TemporaryDirectory() as folder:
        write_map(place, Path(folder) / f"place{suffix}")
        assert_same(read_map(Path(folder) / f"place{suffix}"), place)
        assert [path.name for path in Path(folder).iterdir()] == [f"place{suffix}"]


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("ground", [None, Slab(1.5)])
def test_an_empty_place_is_legal_on_disk(tmp_path, suffix, ground):
    place = Environment.empty(ground=ground)
    write_map(place, tmp_path / f"empty{suffix}")
    back = read_map(tmp_path / f"empty{suffix}")
    assert back.reflectors.sizes["reflector"] == 0
    assert_same(back, place)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_where_a_map_came_from_travels_with_it(tmp_path, suffix):
    place = random_place(0)
    place.reflectors.attrs["input_sha256"] = '{"mpc.csv": "00ff"}'
    write_map(place, tmp_path / f"place{suffix}")
    attributes = read_map(tmp_path / f"place{suffix}").reflectors.attrs
    assert attributes["input_sha256"] == '{"mpc.csv": "00ff"}'
    assert attributes["Conventions"] == "CF-1.11"


def test_geojson_is_strict_json_and_says_wall_and_pole(tmp_path):
    write_map(random_place(1), tmp_path / "place.geojson")

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    document = json.loads((tmp_path / "place.geojson").read_text(), parse_constant=refuse)
    kinds = {(f["geometry"]["type"], f["properties"]["kind"]) for f in document["features"]}
    assert kinds == {("LineString", "wall"), ("Point", "pole")}


def test_a_hand_drawn_geojson_needs_shapes_alone(tmp_path):
    room = [[0, 0], [20, 0], [20, 5], [0, 5], [0, 0]]
    document = {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": room}},
            {
                "type": "Feature",
                "properties": {"radius": 0.2},
                "geometry": {"type": "Point", "coordinates": [3, 2]},
            },
        ],
    }
    (tmp_path / "drawn.geojson").write_text(json.dumps(document))
    place = read_map(tmp_path / "drawn.geojson")
    assert place.reflectors.kind.values.tolist() == ["wall"] * 4 + ["pole"]
    # drawn counter-clockwise: normals look into the room
    assert place.reflectors.normal.values[:4].tolist() == [90, 180, 270, 0]
    assert np.isinf(place.reflectors.top.values).all()


def test_a_csv_needs_end_points_alone(tmp_path):
    (tmp_path / "a.csv").write_text("first_east,first_north,second_east,second_north,top\n0,0,4,0,\n0,0,0,4,3\n")
    table = read_map(tmp_path / "a.csv").reflectors
    assert table.top.values.tolist() == [np.inf, 3.0]
    assert table.material.values.tolist() == ["concrete", "concrete"]


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("a.h5", "text", "not an HDF5 file"),
        ("a.geojson", "{", "not JSON"),
        ("a.geojson", "[]", "no GeoJSON type"),
        ("a.geojson", '{"type": "FeatureCollection", "features": [{"geometry": null}]}', "feature 0"),
        ("a.gpkg", "text", "not a GeoPackage"),
        ("a.geojson", '{"type": "FeatureCollection", "features": 3}', "features"),
        ("a.geojson", '{"type": "FeatureCollection", "features": [], "ground": 3}', "malformed"),
        ("a.geojson", '{"type": "FeatureCollection", "features": [], "materials": ["x"]}', "malformed"),
        ("a.csv", "", "empty"),
        ("a.csv", "first_east,first_north,second_east,second_north,normal\n0,0,1,0,inf\n", "column normal"),
        ("a.csv", "first_east,first_north,second_east,second_north,support\n0,0,1,0,1e308\n", "a number of paths"),
        ("a.csv", "kind\nwall\n", "no column first_east"),
        ("a.csv", "first_east,first_north,second_east,second_north\n0,0,1\n", "line 2 has 3 cells"),
        ("a.csv", "first_east,first_north,second_east,second_north\n0,0,1,x\n", "column second_north"),
        ("a.csv", "first_east,first_north,second_east,second_north\n1,1,1,1\n", "length 0"),
        ("a.shp", "text", "unknown format"),
    ],
)
def test_a_bad_file_is_one_line_naming_it(tmp_path, name, content, complaint):
    (tmp_path / name).write_text(content)
    with pytest.raises(DataError, match=complaint) as caught:
        read_map(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("member", "message"),
    [
        ({"materials": [{"name": "mud", "permittivity": [-1, 0]}]}, "material mud: permittivity must be positive"),
        ({"georeference": {"latitude": 91, "longitude": 0}}, "origin at latitude 91.0 longitude 0.0"),
        ({"ground": {"height": 5}, "ceiling": {"height": 1}}, "ceiling at 1.0 m is not above the ground at 5.0 m"),
    ],
)
def test_an_error_of_a_part_is_told_once_and_in_its_own_words(tmp_path, member, message):
    # a DataError is a ValueError: what reads the part must not take it for malformed
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [], **member}))
    with pytest.raises(DataError) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}: {message}")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match="no such file"):
        read_map(tmp_path / "none.csv")


def test_geopackage_without_its_library_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyogrio", None)
    with pytest.raises(DataError, match=r"sounder-to-map\[gis\]"):
        write_map(random_place(0), tmp_path / "a.gpkg")


def test_numbers_among_the_attributes_of_a_map_are_no_fault_of_other_formats(tmp_path):
    table = make_reflectors([[[0, 0], [1, 0]]])
    table.attrs |= {"one": np.int64(3), "two": np.arange(2), "three": np.nan}
    write_map(Environment(table), tmp_path / "m.h5")
    write_map(read_map(tmp_path / "m.h5"), tmp_path / "m.geojson")
    assert json.loads((tmp_path / "m.geojson").read_text())["attributes"]["two"] == [0, 1]


def test_an_outline_beyond_the_earth_is_refused(tmp_path):
    feature = {
        "type": "Feature",
        "properties": {},
        "geometry": {"type": "LineString", "coordinates": [[0, 1e308], [0, -1e308]]},
    }
    (tmp_path / "o.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    with pytest.raises(DataError, match=r"o\.geojson: a position is 1e\+308 m away, no place on earth"):
        read_outline(tmp_path / "o.geojson")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    target = tmp_path / "place.geojson"
    write_map(Environment.empty(), target)
    before = target.read_bytes()
    place = random_place(0)
    place.reflectors.attrs["not JSON"] = object()
    with pytest.raises(TypeError):
        write_map(place, target)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("seed", range(5))
def test_points_of_a_wall_fulfil_its_equation_wherever_it_is_moved(seed):
    rng = np.random.default_rng(seed)
    moved = random_place(seed).moved(rng.uniform(-400, 400), rng.uniform(-1e3, 1e3, 3))
    walls = moved.reflectors.isel(reflector=moved.reflectors.kind.values == "wall")
    along = np.einsum("wx,wex->we", unit(walls.normal.values), walls.end_points.values)
    np.testing.assert_allclose(along, np.stack([walls.offset.values] * 2, axis=1), atol=1e-9)
    assert moved.ground is not None
    assert moved.ground.height < moved.ceiling.height


@pytest.mark.parametrize("seed", range(5))
def test_moving_there_and_back_is_staying(seed):
    rng = np.random.default_rng(seed)
    angle, shift = rng.uniform(0, 360), rng.uniform(-100, 100, 3)
    place = random_place(seed)
    back = place.moved(angle, (0, 0, 0)).moved(0, shift).moved(0, -shift).moved(-angle, (0, 0))
    for name in ("end_points", "offset", "covariance", "centre_covariance", "base", "top"):
        np.testing.assert_allclose(back.reflectors[name], place.reflectors[name], atol=1e-8)
    turn = (back.reflectors.normal - place.reflectors.normal + 180) % 360 - 180
    np.testing.assert_allclose(turn.dropna("reflector"), 0, atol=1e-9)


def test_covariance_moves_as_a_cloud_of_walls_does():
    spread = np.array([[0.04, 0.01], [0.01, 0.09]])  # degree, metre
    wall = make_reflectors([[[10.0, -5.0], [10.0, 5.0]]], covariance=spread[None])
    moved = Environment(wall).moved(30, (40.0, -25.0)).reflectors
    rng = np.random.default_rng(5)
    normal, offset = rng.multivariate_normal([180.0, -10.0], spread, 20000).T
    cloud = np.stack([normal + 30, offset + unit(normal + 30) @ [40.0, -25.0]])
    # a variance of n draws scatters by sqrt(2/n) = 1 %; five of these
    np.testing.assert_allclose(np.cov(cloud), moved.covariance.values[0], rtol=0.05)


def test_a_pole_that_is_known_better_in_one_direction_is_so_in_the_turned_one():
    pole = Environment.empty().with_poles([[3.0, 4.0]], 0.1, covariance=np.diag([0.04, 0.01])[None])
    moved = pole.moved(30, (7.0, -2.0)).reflectors["centre_covariance"].values[0]
    long, short = unit(30.0), unit(120.0)
    assert long @ moved @ long == pytest.approx(0.04)
    assert short @ moved @ short == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"kind": "fence"}, "no wall, pole or arc"),
        ({"kind": "pole"}, "positive radius"),
        ({"base": 3.0, "top": 2.0}, "top that is not above"),
        ({"top": 1e200}, "has a base or top that is neither infinite nor a place on earth"),
        ({"kind": "pole", "radius": 1e200}, "has a radius beyond"),
        ({"material": "cheese"}, "unknown material 'cheese'"),
    ],
)
def test_impossible_reflectors_are_refused(change, complaint):
    with pytest.raises(DataError, match=complaint):
        Environment(make_reflectors([[[0, 0], [1, 0]]], **change))


def test_impossible_places_are_refused():
    with pytest.raises(DataError, match="end points"):
        Environment.walls([[[0, np.nan], [1, 0]]])
    for place in (1e308, -1e308, np.inf):
        with pytest.raises(DataError, match="end points"):
            Environment.walls([[[0, place], [1, -place]]])
    with pytest.raises(DataError, match=r"ground or ceiling at 1e\+200 m; expected a height on earth"):
        Environment.empty(ground=Slab(1e200))
    with pytest.raises(DataError, match="not above the ground"):
        Environment.empty(ground=Slab(3.0), ceiling=Slab(2.0))
    with pytest.raises(DataError, match="shape"):
        Environment.walls([[0, 1, 2]])


@pytest.mark.parametrize("suffix", [".geojson", ".gpkg"])
def test_every_segment_of_lines_and_rings_is_a_wall(tmp_path, suffix):
    square = [[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [0.0, 5.0], [0.0, 0.0]]
    shapes = [
        {"type": "MultiLineString", "coordinates": [[[0.0, 9.0], [4.0, 9.0]], [[5.0, 9.0], [6.0, 9.0], [6.0, 8.0]]]},
        {"type": "Polygon", "coordinates": [square]},
        None,
    ]
    path = tmp_path / f"map{suffix}"
    if suffix == ".geojson":
        features = [{"type": "Feature", "properties": None, "geometry": shape} for shape in shapes]
        path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    else:
        pyogrio, shapely = pytest.importorskip("pyogrio"), pytest.importorskip("shapely")
        geometry = np.array([shape and shapely.from_geojson(json.dumps(shape)).wkb for shape in shapes], dtype=object)
        pyogrio.raw.write(path, geometry, [], [], driver="GPKG", geometry_type="Unknown", crs=LOCAL_METRES)
    table = read_map(path).reflectors
    assert table["kind"].values.tolist() == 7 * ["wall"]
    np.testing.assert_array_equal(table["end_points"].values[3:7], list(pairwise(square)))
