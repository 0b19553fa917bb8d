"""Drawings of a map: they hold the surfaces, an empty map is legal, and a scene of several files is written whole."""

import os
import sys
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.constants import epsilon_0

from erm.common.errors import DataError
from erm.maps.environment import Environment, Slab
from erm.maps.formats import ply, read_map, write_map
from erm.maps.formats.ply import joined_mesh
from erm.maps.formats.surfaces import Surface, extrude
from erm.maps.materials import LIBRARY, Material
from erm.maps.reflectors import make_reflectors

MICROMETRE = 1e-6  # half of which drawings are rounded to


def surfaces_of(place: Environment, *, height: float = 30.0, margin: float = 50.0) -> list[Surface]:
    return extrude(place, height=height, margin=margin)


def place_of(seed: int = 0) -> Environment:
    """Walls of three materials, one of them of its own and oddly called, poles and slabs."""
    rng = np.random.default_rng(seed)
    own = Material("wet paint/é", permittivity=(3.1, -0.1), conductivity=(0.01, 1.2))
    table = make_reflectors(
        rng.uniform(-200, 200, (6, 2, 2)), top=[np.inf, 5, 6, 7, 8, 9], material=["glass", own.name, "brick"] * 2
    )
    place = Environment(table, Slab(-0.3, "asphalt"), Slab(12.5), {own.name: own})
    return place.with_poles(rng.uniform(-50, 50, (2, 2)), [0.1, 0.25], top=[8.0, np.inf])


def read_ply(path: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Vertices, faces with what follows their corners, and the properties of faces."""
    head, body = path.read_text().split("end_header\n")
    lines = head.splitlines()
    assert lines[:2] == ["ply", "format ascii 1.0"]
    (vertices,) = (int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    (faces,) = (int(line.split()[2]) for line in lines if line.startswith("element face"))
    rows = [line.split() for line in body.splitlines()]
    assert len(rows) == vertices + faces
    properties = [line.split()[-1] for line in lines[lines.index(f"element face {faces}") + 1 :]]
    corners = np.array(rows[vertices:], dtype=int).reshape(faces, 3 + len(properties))
    assert (corners[:, :1] == 3).all()
    return np.array(rows[:vertices], dtype=float).reshape(-1, 3), corners[:, 1:], properties


def test_names_of_meshes_are_plain_and_no_two_the_same(tmp_path):
    names = ["index 1.6", "index-1.6", "INDEX/1.6"]
    own = {name: Material(name, permittivity=(3.0, 0.0), conductivity=(0.01, 1.0)) for name in names}
    walls = [[[0, 0], [1, 0]], [[0, 1], [1, 1]], [[0, 2], [1, 2]]]
    write_map(Environment(make_reflectors(walls, material=names), materials=own), tmp_path / "a.xml")
    meshes = {path.name for path in tmp_path.glob("*.ply")}
    assert meshes == {"a-INDEX-1.6.ply", "a-index-1.6-1.ply", "a-index-1.6-2.ply"}
    named = {node.get("value") for node in ElementTree.parse(tmp_path / "a.xml").iter("string")}
    assert meshes <= named


def test_a_ply_holds_every_surface_and_says_which_reflector_it_is(tmp_path):
    write_map(place_of(), tmp_path / "map.ply", height=25.0, margin=7.0)
    vertices, faces, properties = read_ply(tmp_path / "map.ply")
    surfaces = surfaces_of(place_of(), height=25.0, margin=7.0)
    expected, corners = joined_mesh(surfaces)
    np.testing.assert_allclose(vertices, expected, rtol=0, atol=MICROMETRE)
    np.testing.assert_array_equal(faces[:, :3], corners)
    assert properties == ["vertex_indices", "reflector"]
    assert faces[:, 3].tolist() == [surface.index for surface in surfaces for _ in surface.faces]


def test_an_obj_holds_every_surface_as_an_object_of_its_material(tmp_path):
    write_map(place_of(), tmp_path / "map.obj")
    rows = [line.split() for line in (tmp_path / "map.obj").read_text().splitlines()]
    surfaces = surfaces_of(place_of())
    expected, corners = joined_mesh(surfaces)
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    faces = np.array([row[1:] for row in rows if row[0] == "f"], dtype=int)
    np.testing.assert_allclose(vertices, expected, rtol=0, atol=MICROMETRE)
    np.testing.assert_array_equal(faces, corners + 1)
    names = [row[1] for row in rows if row[0] == "o"]
    assert names == [*(f"wall_{i}" for i in range(6)), "pole_6", "pole_7", "ground", "ceiling"]
    assert [unquote(row[1]) for row in rows if row[0] == "usemtl"] == [surface.material for surface in surfaces]


def scene_of(path: Path) -> dict[str, tuple[ElementTree.Element, str]]:
    """Material and mesh file of each shape, by the shape's name."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "scene"
    bsdfs = {bsdf.attrib["id"]: bsdf for bsdf in root.findall("bsdf")}
    shapes = {}
    for shape in root.findall("shape"):
        (reference,) = shape.findall("ref")
        mesh = {value.attrib["name"]: value.attrib["value"] for value in shape.findall("string")}["filename"]
        shapes[shape.attrib["id"]] = (bsdfs[reference.attrib["id"]], mesh)
    assert len(bsdfs) == len(shapes)
    return shapes


def test_a_scene_has_one_mesh_a_material(tmp_path):
    write_map(place_of(), tmp_path / "map.xml")
    shapes = scene_of(tmp_path / "map.xml")
    surfaces = surfaces_of(place_of())
    assert len(shapes) == len({surface.material for surface in surfaces}) == 6
    assert {path.name for path in tmp_path.iterdir()} == {"map.xml", *(mesh for _, mesh in shapes.values())}
    for name, (_, mesh) in shapes.items():
        vertices, faces, properties = read_ply(tmp_path / mesh)
        own, corners = joined_mesh([s for s in surfaces if s.material == name.removeprefix("mesh-faces-")])
        np.testing.assert_allclose(vertices, own, rtol=0, atol=MICROMETRE)
        np.testing.assert_array_equal(faces, corners)
        assert properties == ["vertex_indices"]


@pytest.mark.parametrize(
    ("material", "frequency", "expected"),
    [
        ("concrete", 132e9, "mat-itu_concrete"),
        ("concrete", 28e9, "mat-itu_concrete"),
        ("concrete", 105e9, "mat-105GHz-concrete"),  # between two rows of the Recommendation
        ("metal", 28e9, "mat-itu_metal"),
        ("metal", 132e9, "mat-132GHz-metal"),  # the Recommendation ends at 100 GHz
        ("plaster", 300e9, "mat-300GHz-plaster"),  # the letter's, not the Recommendation's
    ],
)
def test_materials_go_by_the_name_of_the_recommendation_where_it_has_them(tmp_path, material, frequency, expected):
    path = tmp_path / "map.xml"
    write_map(Environment.walls([[[0, 0], [1, 0]]], material=material), path, frequency=frequency)
    ((bsdf, _),) = scene_of(path).values()
    assert bsdf.attrib["id"] == expected
    if "itu_" in expected:
        assert bsdf.attrib["type"] == "twosided"
        return
    assert bsdf.attrib["type"] == "radio-material"
    constants = {value.attrib["name"]: float(value.attrib["value"]) for value in bsdf.findall("float")}
    loss = constants["conductivity"] / (2 * np.pi * frequency * epsilon_0)
    permittivity = LIBRARY[material].relative_permittivity(frequency)
    # six digits are written
    assert complex(constants["relative_permittivity"], -loss) == pytest.approx(permittivity, rel=1e-5)


def test_a_material_of_the_map_that_takes_a_known_name_keeps_its_own_constants(tmp_path):
    own = Material("concrete", permittivity=(6.0, 0.0), conductivity=(0.5, 0.0))
    write_map(Environment.walls([[[0, 0], [1, 0]]], materials={"concrete": own}), tmp_path / "map.xml")
    ((bsdf, _),) = scene_of(tmp_path / "map.xml").values()
    assert bsdf.attrib["type"] == "radio-material"
    assert [value.attrib["value"] for value in bsdf.findall("float")][:2] == ["6", "0.5"]


def test_a_known_material_is_known_after_a_file(tmp_path):
    write_map(Environment.walls([[[0, 0], [1, 0]]]), tmp_path / "map.h5")
    write_map(read_map(tmp_path / "map.h5"), tmp_path / "map.xml")
    ((bsdf, _),) = scene_of(tmp_path / "map.xml").values()
    assert bsdf.attrib["id"] == "mat-itu_concrete"


def test_the_scene_takes_its_place_after_its_meshes(tmp_path, monkeypatch):
    moved = []
    real = os.replace
    monkeypatch.setattr(os, "replace", lambda source, target: (moved.append(Path(target).name), real(source, target)))
    write_map(place_of(), tmp_path / "map.xml")
    assert moved[-1] == "map.xml"
    assert len(moved) == 1 + 6


def test_a_scene_that_fails_leaves_the_old_one(tmp_path, monkeypatch):
    write_map(place_of(0), tmp_path / "map.xml")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    real = ply.mesh_text

    def third_fails(surfaces, *, tagged):
        if surfaces[0].material == "glass":
            raise MemoryError
        return real(surfaces, tagged=tagged)

    monkeypatch.setattr(ply, "mesh_text", third_fails)
    with pytest.raises(MemoryError):
        write_map(place_of(1), tmp_path / "map.xml")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".xml", ".dxf"])
@pytest.mark.slow
def test_the_same_map_is_drawn_the_same(tmp_path, suffix):
    if suffix == ".dxf":
        pytest.importorskip("ezdxf", reason="the extra cad is not installed")
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write_map(place_of(), tmp_path / name / f"map{suffix}")
    first, second = ({path.name: path.read_bytes() for path in (tmp_path / n).iterdir()} for n in ("first", "second"))
    assert first == second


def test_an_empty_map_is_a_legal_drawing(tmp_path):
    write_map(Environment.empty(), tmp_path / "map.ply")
    vertices, faces, _ = read_ply(tmp_path / "map.ply")
    assert (len(vertices), len(faces)) == (0, 0)
    write_map(Environment.empty(), tmp_path / "map.obj")
    (line,) = (tmp_path / "map.obj").read_text().splitlines()
    assert line.startswith("#")
    write_map(Environment.empty(), tmp_path / "map.xml")
    assert scene_of(tmp_path / "map.xml") == {}
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
def test_a_dxf_has_lines_circles_and_faces_on_layers_in_metres(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="the extra cad is not installed")
    place = place_of()
    write_map(place, tmp_path / "map.dxf", height=25.0, margin=7.0)
    drawing = ezdxf.readfile(tmp_path / "map.dxf")
    assert drawing.header["$INSUNITS"] == 6  # metres
    assert drawing.audit().errors == []
    space = drawing.modelspace()
    table = place.reflectors
    walls, poles = table.isel(reflector=slice(6)), table.isel(reflector=slice(6, 8))
    lines = np.array([[entity.dxf.start, entity.dxf.end] for entity in space.query("LINE[layer=='walls']")])
    np.testing.assert_array_equal(lines[..., :2], walls["end_points"])
    np.testing.assert_array_equal(lines[..., 2], 0.0)  # their base
    circles = list(space.query("CIRCLE[layer=='poles']"))
    np.testing.assert_array_equal([circle.dxf.center.vec2 for circle in circles], poles["end_points"][:, 0])
    np.testing.assert_array_equal([circle.dxf.radius for circle in circles], poles["radius"])
    np.testing.assert_array_equal([circle.dxf.thickness for circle in circles], [8.0, 12.5])  # up to the ceiling
    for layer, kind in (("wall_faces", "wall"), ("ground", "ground"), ("ceiling", "ceiling")):
        faces = [face.wcs_vertices() for face in space.query(f"3DFACE[layer=='{layer}']")]
        surfaces = [s.vertices for s in surfaces_of(place, height=25.0, margin=7.0) if s.kind == kind]
        np.testing.assert_array_equal(np.array(faces), surfaces)
    write_map(Environment.empty(), tmp_path / "empty.dxf")
    assert len(ezdxf.readfile(tmp_path / "empty.dxf").modelspace()) == 0


def test_dxf_without_its_library_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(DataError, match=r"map.dxf: DXF needs ezdxf.*sounder-to-map\[cad\]") as error:
        write_map(place_of(), tmp_path / "map.dxf")
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".xml", ".dxf"])
def test_a_drawing_is_not_read_again(tmp_path, suffix):
    with pytest.raises(DataError, match="drawing"):
        read_map(tmp_path / f"map{suffix}")


@pytest.mark.parametrize("option", ["height", "margin", "frequency"])
@pytest.mark.parametrize("value", [0.0, np.inf, np.nan])
def test_drawings_have_an_extent(tmp_path, option, value):
    with pytest.raises(DataError, match=f"{option} {value:g}"):
        write_map(place_of(), tmp_path / "map.xml", **{option: value})
