"""GeoPackage of a map: layers in the system that was asked for, read by SQLite alone and read back by `read_map`."""

import sqlite3
import struct
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from erm.common.errors import OptionError
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.maps.georeference import Georeference, remark_on_system

pytest.importorskip("pyogrio", reason="the extra gis is not installed")
pyproj = pytest.importorskip("pyproj", reason="the extra gis is not installed")

PLACE = Georeference(48.1, 11.5, 520.0, 30.0)
TX, RX = [[0.0, 0.0, 28.0], [5.0, 5.0, 20.0]], [[30.0, -10.0, 1.5], [40.0, -12.0, 1.6], [50.0, -14.0, 1.7]]


def street() -> Environment:
    """A wall between a pole and another pole, so that the layers change the order of reflectors."""
    poles = Environment.empty().with_poles([[3.0, 4.0]], 0.1)
    wall = Environment.walls([[[0.0, 12.0], [60.0, 15.0]]])
    table = xr.concat([poles.reflectors, wall.reflectors, poles.moved(0, (9, 9)).reflectors], dim="reflector")
    return Environment(table, georeference=PLACE).with_arcs([[80, 0]], -8.0, [[100, 170]])


def measured() -> xr.Dataset:
    point = np.array([[20.0, 13.0, 4.0], [np.nan] * 3, [30.0, 13.5, 3.0]])
    rows = {"position": ["RX2", "RX1", "RX10"], "wall": [1, -1, 1], "delay": [2e-7, 3e-7, 2.5e-7]}
    rows |= {"azimuth": [120.0, 3.0, 90.0], "path_gain": [-110.0, -120.0, -111.0]}
    table = xr.Dataset({name: ("mpc", values) for name, values in rows.items()})
    ends = {"tx_position": [TX[0], TX[1], TX[0]], "rx_position": RX, "reflection_point": point}
    return table.assign({name: (("mpc", "xyz"), np.array(values)) for name, values in ends.items()})


def rows_of(path: Path, layer: str, *fields: str) -> tuple[int, np.ndarray, list[tuple]]:
    """System, coordinates (point, 2) and fields of a layer, by OGC 12-128: a header, then well-known binary."""
    with closing(sqlite3.connect(path)) as database:
        query = "SELECT srs_id FROM gpkg_geometry_columns WHERE table_name = ?"
        ((system,),) = database.execute(query, (layer,)).fetchall()
        rows = database.execute(f"SELECT {', '.join(('geom', *fields))} FROM {layer} ORDER BY fid").fetchall()
    points = []
    for blob, *_ in rows:
        assert blob[:2] == b"GP"
        shape = blob[8 + {0: 0, 1: 32}[blob[3] >> 1 & 7] :]
        assert shape[0] == 1  # little-endian
        (kind,) = struct.unpack("<I", shape[1:5])
        body = shape[5:] if kind == 1 else shape[9:]
        points += np.frombuffer(body, "<f8").reshape(-1, 2).tolist()
    return system, np.array(points), [row[1:] for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize(("crs", "number"), [(None, 4326), ("ETRS89 / UTM zone 32N", 25832)])
def test_layers_of_a_gis(tmp_path, crs, number):
    path = tmp_path / "map.gpkg"
    write_map(street(), path, mpcs=measured(), crs=crs)
    system, ends, numbers = rows_of(path, "walls", "reflector")
    assert (system, numbers) == (number, [(1,)])
    geodetic = PLACE.to_geodetic([[0.0, 12.0], [60.0, 15.0]])
    if crs is None:
        np.testing.assert_allclose(ends, geodetic[:, :2], rtol=0, atol=1e-12)
    else:  # UTM in its formula's parameters, not by its name; its scale is that of the ellipsoid 520 m below
        expected = pyproj.Proj("+proj=tmerc +lon_0=9 +k=0.9996 +x_0=500000 +ellps=GRS80")(*geodetic[:, :2].T)
        np.testing.assert_allclose(ends.T, expected, rtol=0, atol=1e-6)
        assert np.hypot(*np.diff(ends, axis=0)[0]) == pytest.approx(np.hypot(60, 3), rel=6e-4)
    assert [row for _, _, rows in (rows_of(path, "poles", "reflector"),) for row in rows] == [(0,), (2,)]
    _, points, fields = rows_of(path, "reflection_points", "position", "reflector", "height")
    assert fields == [("RX2", 1, 4.0), ("RX10", 1, 3.0)]  # the MPC that was not accepted has none
    assert len(points) == 2
    assert rows_of(path, "tx", "tx", "height")[2] == [(0, 28.0), (1, 20.0)]
    assert rows_of(path, "rx", "position", "tx", "height")[2] == [("RX1", 1, 1.6), ("RX10", 0, 1.7), ("RX2", 0, 1.5)]
    back = read_map(path)
    assert back.georeference == PLACE
    assert back.reflectors["kind"].values.tolist() == ["pole", "wall", "pole", "arc"]
    for name in ("end_points", "centre", "radius"):
        np.testing.assert_allclose(back.reflectors[name], street().reflectors[name], rtol=0, atol=1e-7)


def test_receivers_are_where_the_map_has_them(tmp_path):
    names = ["RX1", "RX2", "RX10"]
    columns = {name: ("p", [0.1, 0.2, 0.3]) for name in ("heading", "heading_std", "clock", "clock_std")}
    rx = np.add([RX[1], RX[0], RX[2]], [0.5, 0.0, 0.0])
    positions = xr.Dataset({"name": ("p", names), "rx": (("p", "xyz"), rx)} | columns)
    write_map(replace(street(), georeference=None), tmp_path / "map.gpkg", mpcs=measured(), positions=positions)
    _, points, fields = rows_of(tmp_path / "map.gpkg", "rx", "position", "heading")
    assert fields == [("RX1", 0.1), ("RX10", 0.3), ("RX2", 0.2)]
    np.testing.assert_allclose(points, np.add([RX[1], RX[2], RX[0]], [0.5, 0.0, 0.0])[:, :2])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "crs", "place", "complaint"),
    [
        ("a.gpkg", "no such system", PLACE, "is not known"),
        ("a.gpkg", "EPSG:4978", PLACE, "no map of the earth"),  # geocentric
        ("a.dxf", "EPSG:4326", PLACE, "is in degrees"),
        ("a.gpkg", "EPSG:25832", None, "has no origin"),
        ("a.csv", "EPSG:25832", PLACE, "choose .gpkg or .dxf"),
    ],
)
def test_a_system_that_cannot_be_is_one_line(tmp_path, name, crs, place, complaint):
    with pytest.raises(OptionError, match=complaint):
        write_map(replace(street(), georeference=place), tmp_path / name, crs=crs)
    assert not (tmp_path / name).exists()


def test_the_wrong_zone_is_said():
    assert remark_on_system("EPSG:25832", PLACE) is None
    assert "longitudes 0 to 6" in str(remark_on_system("EPSG:32631", PLACE))
    fiji = Georeference(-17.7, -179.9)  # New Zealand's system crosses the date line
    assert remark_on_system("EPSG:3460", fiji) is None


@pytest.mark.slow
def test_a_drawing_in_a_projected_system(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="the extra cad is not installed")
    write_map(street(), tmp_path / "map.dxf", crs="EPSG:25832")
    space = ezdxf.readfile(tmp_path / "map.dxf").modelspace()
    (line,) = space.query("LINE[layer=='walls']")
    write_map(street(), tmp_path / "map.gpkg", crs="EPSG:25832")
    _, ends, _ = rows_of(tmp_path / "map.gpkg", "walls")
    np.testing.assert_allclose([line.dxf.start.vec2, line.dxf.end.vec2], ends, rtol=0, atol=1e-6)
    (arc,) = space.query("ARC")
    _, along, _ = rows_of(tmp_path / "map.gpkg", "arcs")
    np.testing.assert_allclose([arc.start_point.vec2, arc.end_point.vec2], along[[0, -1]], rtol=0, atol=1e-4)
    assert pyproj.CRS.from_wkt((tmp_path / "map.prj").read_text()).to_epsg() == 25832


def test_what_gdal_finds_odd_is_a_note_and_no_warning(tmp_path, capsys):
    path = tmp_path / "map.gpkg"
    write_map(Environment.walls([[[0, 0], [9, 0]]]), path)
    with closing(sqlite3.connect(path)) as file, file:
        file.execute("UPDATE gpkg_contents SET srs_id = 24736")
        file.execute("UPDATE gpkg_geometry_columns SET srs_id = 24736")
    assert read_map(path).reflectors.sizes["reflector"] == 1
    assert "note: " + str(path) + ": unable to read srs_id '24736'" in capsys.readouterr().err
