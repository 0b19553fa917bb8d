"""Reflectors as surfaces: areas, normals and volumes by their closed forms."""

import numpy as np
import pytest

from erm.geometry.vertical import unit
from erm.maps.environment import Environment, Slab
from erm.maps.formats.surfaces import Surface, extrude
from erm.maps.reflectors import make_reflectors


def surfaces_of(place: Environment, *, height: float = 30.0, margin: float = 50.0) -> list[Surface]:
    return extrude(place, height=height, margin=margin)


def vector_areas(surface: Surface) -> np.ndarray:
    """Of each triangle (face, 3): along its outward normal, as long as its area [m2]."""
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    return np.cross(b - a, c - a) / 2


def volume(surface: Surface) -> float:
    """Of a closed surface by the divergence theorem; positive if its faces look outward [m3]."""
    return float((vector_areas(surface) * surface.vertices[surface.faces].mean(axis=1)).sum() / 3)


def random_walls(seed: int, count: int = 20) -> Environment:
    """Walls with normals to either side, as reconstruction gives them, and finite heights."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-200, 200, (count, 2, 2))
    drawn = make_reflectors(ends)
    side = rng.integers(0, 2, count) * 180.0
    normal = drawn["normal"].values + side
    offset = drawn["offset"].values * np.where(side > 0, -1, 1)
    base = rng.uniform(-3, 3, count)
    return Environment(
        make_reflectors(ends, normal=normal, offset=offset, base=base, top=base + rng.uniform(1, 40, count))
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_wall_has_its_area_and_faces_the_way_of_its_normal(seed):
    place = random_walls(seed)
    table = place.reflectors
    length = np.linalg.norm(np.diff(table["end_points"].values, axis=1)[:, 0], axis=-1)
    area = length * (table["top"] - table["base"]).values
    surfaces = surfaces_of(place)
    assert [(surface.index, surface.kind) for surface in surfaces] == [(i, "wall") for i in range(20)]
    for surface, normal, size in zip(surfaces, table["normal"].values, area, strict=True):
        triangles = vector_areas(surface)
        # half of the rectangle each, on its own plane; coordinates of 200 m hold 3e-14 m
        np.testing.assert_allclose(triangles, np.tile([*(size / 2 * unit(normal)), 0], (2, 1)), rtol=0, atol=1e-9)
        along = surface.vertices[:, :2] @ unit(normal)
        np.testing.assert_allclose(along, table["offset"].values[surface.index], rtol=0, atol=1e-9)


def test_a_pole_is_a_closed_prism_inside_its_cylinder():
    place = Environment.empty().with_poles([[30.0, -40.0], [0.0, 5.0]], [0.25, 2.0], base=1.0, top=[9.0, 4.0])
    for surface, radius, height in zip(surfaces_of(place), (0.25, 2.0), (8.0, 3.0), strict=True):
        assert surface.kind == "pole"
        # a regular polygon of 16 corners on the circle
        ring = 8 * np.sin(np.pi / 8) * radius**2
        assert volume(surface) == pytest.approx(ring * height, rel=1e-9)
        np.testing.assert_allclose(vector_areas(surface).sum(axis=0), 0, rtol=0, atol=1e-12)
        edges = np.concatenate([surface.faces[:, [0, 1]], surface.faces[:, [1, 2]], surface.faces[:, [2, 0]]]).tolist()
        # watertight: every edge is walked once each way
        assert sorted(edges) == sorted([b, a] for a, b in edges)
        assert len({tuple(edge) for edge in edges}) == len(edges)
        centre = surface.vertices.mean(axis=0)
        np.testing.assert_allclose(np.linalg.norm(surface.vertices[:, :2] - centre[:2], axis=-1), radius)


def test_ground_faces_up_and_ceiling_down_as_far_as_is_said():
    walls = Environment.walls([[[0, 0], [20, 0]], [[20, 0], [20, 10]]], ground=Slab(-1.0, "asphalt"), ceiling=Slab(6.0))
    place = walls.with_poles([[-5.0, 3.0]], 0.5)
    ground, ceiling = surfaces_of(place, margin=4.0)[-2:]
    assert (ground.kind, ground.index, ground.material) == ("ground", -1, "asphalt")
    assert (ceiling.kind, ceiling.index, ceiling.material) == ("ceiling", -2, "concrete")
    # 5.5 m west of the origin to 20 m east, 0 m to 10 m north, 4 m more at every side
    area = (20 + 5.5 + 8) * (10 + 8)
    np.testing.assert_allclose(vector_areas(ground).sum(axis=0), [0, 0, area])
    np.testing.assert_allclose(vector_areas(ceiling).sum(axis=0), [0, 0, -area])
    assert ground.vertices.min(axis=0).tolist() == [-9.5, -4.0, -1.0]
    assert set(ceiling.vertices[:, 2]) == {6.0}


def test_an_empty_place_has_ground_around_the_origin():
    assert surfaces_of(Environment.empty()) == []
    (ground,) = surfaces_of(Environment.empty(ground=Slab(0.0)), margin=10.0)
    assert vector_areas(ground).sum(axis=0).tolist() == [0, 0, 400]


@pytest.mark.parametrize(
    ("base", "top", "slabs", "expected"),
    [
        (0, np.inf, {}, (0, 30)),
        (0, np.inf, {"ground": Slab(-2.0)}, (0, 28)),
        (-np.inf, np.inf, {"ground": Slab(-2.0)}, (-2, 28)),
        (-np.inf, 5, {}, (0, 5)),
        (-np.inf, -5, {}, (-35, -5)),  # ends below the ground
        (0, np.inf, {"ceiling": Slab(3.0)}, (0, 3)),
        (4, np.inf, {"ceiling": Slab(3.0)}, (4, 34)),  # begins above the ceiling
        (2, 50, {"ceiling": Slab(3.0)}, (2, 50)),  # says itself where it ends
        (100, np.inf, {}, (100, 130)),
    ],
)
def test_a_wall_without_end_is_cut(base, top, slabs, expected):
    place = Environment.walls([[[0, 0], [1, 0]]], base=base, top=top, **slabs)
    heights = surfaces_of(place, height=30.0)[0].vertices[:, 2]
    assert (heights.min(), heights.max()) == expected


@pytest.mark.parametrize("seed", range(3))
def test_surfaces_move_with_the_place(seed):
    rng = np.random.default_rng(seed)
    place = random_walls(seed).with_poles([[3.0, 4.0]], 0.3, top=5.0)
    angle, shift = rng.uniform(0, 360), rng.uniform(-100, 100, 3)
    turn = np.stack([unit(angle), unit(angle + 90)])
    for before, after in zip(surfaces_of(place), surfaces_of(place.moved(angle, shift)), strict=True):
        if before.kind == "wall":  # a prism's corners keep to the axes
            level = before.vertices[:, :2] @ turn + shift[:2]
            np.testing.assert_allclose(after.vertices, np.column_stack([level, before.vertices[:, 2] + shift[2]]))
        else:
            assert volume(after) == pytest.approx(volume(before), rel=1e-9)
