"""Forward model: closed forms, visibility and symmetries."""

import numpy as np
import pytest
from scipy.constants import c

from erm.common.errors import DataError
from erm.maps.environment import Environment, Slab
from erm.maps.materials import LIBRARY, Material
from erm.tracing.fresnel import fresnel, roughness_factor
from erm.tracing.trace import trace

FREQUENCY = 132e9
WAVELENGTH = c / FREQUENCY


def free_space(length: float, frequency: float = FREQUENCY) -> complex:
    return c / frequency / (4 * np.pi * length) * np.exp(-2j * np.pi * frequency * length / c)


def random_place(seed: int) -> Environment:
    """Walls here and there, some low, a rough one, ground, ceiling and two poles."""
    rng = np.random.default_rng(seed)
    centre, half = rng.uniform(-30, 30, (8, 2)), rng.uniform(-12, 12, (8, 2))
    return Environment.walls(
        np.stack([centre - half, centre + half], axis=1),
        top=[np.inf, 20.0, 4.0, np.inf, 12.0, 15.0, np.inf, 3.0],
        material=["concrete", "plaster", "glass", "brick", "metal", "wood", "marble", "concrete"],
        ground=Slab(0.0, "asphalt"),
        ceiling=Slab(25.0, "plasterboard"),
    ).with_poles(rng.uniform(-20, 20, (2, 2)), [0.1, 0.4], top=[10.0, np.inf])


def random_antennas(seed: int) -> np.ndarray:
    return np.random.default_rng(seed + 1000).uniform([-30, -30, 1], [30, 30, 20], (2, 3))


def test_nothing_around_leaves_the_direct_path_of_friis():
    tx, rx = np.array([3.0, -2.0, 28.4]), np.array([60.0, 31.0, 1.4])
    paths = trace(Environment.empty(), tx, rx, FREQUENCY)
    length = np.linalg.norm(rx - tx)
    assert paths.los.values.tolist() == [True]
    assert paths.delay.item() == pytest.approx(length / c, rel=1e-14)
    assert paths.path_gain.item() == pytest.approx(-20 * np.log10(4 * np.pi * length / WAVELENGTH), abs=1e-9)
    # the phase is that of 3e4 wavelengths; rounding of the length, 1e-14 m, is 1e-10 rad
    assert paths.coefficient.item() == pytest.approx(free_space(length), rel=1e-9)


def test_directions_are_counter_clockwise_from_east_and_toward_the_other_end():
    paths = trace(Environment.empty(), (0.0, 10.0, 10.0), (0.0, 0.0, 0.0), FREQUENCY)
    assert (paths.azimuth.item(), paths.elevation.item()) == pytest.approx((90.0, 45.0))
    assert (paths.departure_azimuth.item(), paths.departure_elevation.item()) == pytest.approx((270.0, -45.0))


@pytest.mark.parametrize(("polarization", "component"), [("vertical", 0), ("horizontal", 1)])
def test_a_wall_reflects_from_the_image_with_the_fresnel_coefficient(polarization, component):
    # level ray, vertical wall x = 0: the plane of incidence is horizontal, vertical polarisation is TE
    wall = Environment.walls([[[0.0, -50.0], [0.0, 50.0]]], material="glass")
    tx, rx = np.array([5.0, -8.0, 2.0]), np.array([9.0, 12.0, 2.0])
    paths = trace(wall, tx, rx, FREQUENCY, polarization=polarization)
    assert paths.order.values.tolist() == [0, 1]
    bounce = paths.isel(path=1)
    length = np.hypot(14.0, 20.0)
    assert bounce.delay.item() == pytest.approx(length / c, rel=1e-14)
    share = 5 / 14
    assert bounce.vertices.values[0] == pytest.approx([0.0, -8 + 20 * share, 2.0])
    assert bounce.reflector.values.tolist() == [0, -3, -3]
    eps = LIBRARY["glass"].relative_permittivity(FREQUENCY)
    expected = fresnel(np.array(14 / length), np.array(eps))[component]
    assert bounce.coefficient.item() / free_space(length) == pytest.approx(expected, rel=1e-8)


def test_two_rays_over_ground():
    # vertical is TM on the ground, and the antennas' vectors turn with the ray: r_TM alone is left
    tx, rx = np.array([0.0, 0.0, 10.0]), np.array([80.0, 0.0, 1.5])
    paths = trace(Environment.empty(ground=Slab(0.0, "concrete")), tx, rx, FREQUENCY)
    length = np.hypot(80.0, 11.5)
    eps = LIBRARY["concrete"].relative_permittivity(FREQUENCY)
    sine = 11.5 / length  # of the elevation
    root = np.sqrt(eps - (1 - sine**2))
    expected = (eps * sine - root) / (eps * sine + root)
    assert paths.reflector.values[:, 0].tolist() == [-3, -1]
    assert paths.coefficient.values[1] / free_space(length) == pytest.approx(expected, rel=1e-8)
    assert expected.real < 0  # nearer to grazing than Brewster's angle the phase turns


def test_a_conducting_ground_returns_the_image_of_a_vertical_antenna_with_its_sign():
    paths = trace(Environment.empty(ground=Slab(0.0, "metal")), (0, 0, 20.0), (15.0, 0, 20.0), FREQUENCY)
    length = np.hypot(15.0, 40.0)
    # |r| of 1e7 S/m is 1 - 2 Re(1/n)/cos = 1 - 0.004
    assert paths.coefficient.values[1] / free_space(length) == pytest.approx(1, abs=0.005)


def test_brewsters_angle_reflects_nothing_of_vertical_polarisation_off_the_ground():
    lossless = Material("lossless", 2.0 + 0j)
    ground = Environment.empty(ground=Slab(0.0, "lossless"), materials={"lossless": lossless})
    # tan(incidence) = n = 2: heights 5 and 5 over a distance of 20
    paths = trace(ground, (0.0, 0.0, 5.0), (20.0, 0.0, 5.0), FREQUENCY)
    assert abs(paths.coefficient.values[1]) < 1e-12 * abs(paths.coefficient.values[0])


@pytest.mark.parametrize("seed", range(5))
def test_no_surface_reflects_more_than_it_gets_and_a_lossless_one_transmits_the_rest(seed):
    rng = np.random.default_rng(seed)
    cosine = rng.uniform(0, 1, 1000)
    real, loss = rng.uniform(1, 30, 1000), 10 ** rng.uniform(-4, 5, 1000)
    te, tm = fresnel(cosine, real - 1j * loss)
    assert (np.abs(te) <= 1).all()
    assert (np.abs(tm) <= 1).all()
    te, tm = fresnel(cosine, real.astype(complex))
    root = np.sqrt(real - (1 - cosine**2))
    np.testing.assert_allclose(np.abs(te) ** 2 + root / cosine * np.abs(1 + te) ** 2, 1, rtol=1e-9)
    # TM in terms of the magnetic field, 1 + r_TM, with admittance ratio root / (eps cos)
    np.testing.assert_allclose(np.abs(tm) ** 2 + root / (real * cosine) * np.abs(1 + tm) ** 2, 1, rtol=1e-9)


def test_roughness_takes_its_share_at_each_bounce():
    smooth, rough = Material("smooth", 2 - 0.1j), Material("rough", 2 - 0.1j, height_deviation=2e-4)
    ends = [[[0.0, -50.0], [0.0, 50.0]]]
    tx, rx = (5.0, -8.0, 2.0), (9.0, 12.0, 2.0)
    gain = [
        trace(Environment.walls(ends, material=m.name, materials={m.name: m}), tx, rx, FREQUENCY).coefficient[1]
        for m in (smooth, rough)
    ]
    cosine = 14 / np.hypot(14.0, 20.0)
    expected = np.exp(-0.5 * (4 * np.pi * 2e-4 * cosine / WAVELENGTH) ** 2)
    assert (gain[1] / gain[0]).item() == pytest.approx(expected, rel=1e-9)
    assert roughness_factor(np.array(cosine), np.array(0.0), FREQUENCY) == 1


def test_a_box_shows_every_image_of_its_lattice():
    # image (i, j, k) of a shoebox is at 2 ceil(i/2) W + (-1)^i x and so on, seen after |i| + |j| + |k|
    # bounces: 4 n^2 + 2 images of order n, all visible since the box is convex
    size = np.array([7.0, 11.0, 3.0])
    corners = np.array([[0, 0], [7, 0], [7, 11], [0, 11]], dtype=float)
    box = Environment.walls(
        np.stack([corners, np.roll(corners, -1, axis=0)], axis=1),
        top=3.0,
        ground=Slab(0.0),
        ceiling=Slab(3.0),
    )
    tx, rx = np.array([1.3, 2.9, 1.1]), np.array([5.2, 9.7, 2.3])
    paths = trace(box, tx, rx, FREQUENCY)
    expected = []
    for cell in np.ndindex(7, 7, 7):
        index = np.array(cell) - 3
        if np.abs(index).sum() <= 3:
            image = 2 * np.ceil(index / 2) * size + (-1.0) ** index * tx
            expected.append((np.linalg.norm(image - rx) / c, np.abs(index).sum()))
    delay, order = np.array(sorted(expected)).T
    assert [int((paths.order == n).sum()) for n in range(4)] == [1, 6, 18, 38]
    np.testing.assert_allclose(paths.delay, delay, rtol=1e-13)
    assert paths.order.values.tolist() == order.astype(int).tolist()


def test_a_screen_hides_what_passes_through_it_and_nothing_above_it():
    tx, rx = (0.0, 0.0, 10.0), (40.0, 0.0, 2.0)
    screen = [[[20.0, -5.0], [20.0, 5.0]]]  # the direct path is 6 m high here
    for base, top, seen in ((0, np.inf, 0), (0, 5.9, 1), (0, 6.1, 0), (6.1, np.inf, 1), (-np.inf, np.inf, 0)):
        paths = trace(Environment.walls(screen, base=base, top=top), tx, rx, FREQUENCY)
        assert paths.sizes["path"] == seen


def test_a_screen_hides_either_leg_of_a_reflection():
    mirror = [[0.0, -50.0], [0.0, 50.0]]
    tx, rx = (5.0, -10.0, 2.0), (5.0, 10.0, 2.0)
    assert trace(Environment.walls([mirror]), tx, rx, FREQUENCY).order.values.tolist() == [0, 1]
    for north in (-5.0, 5.0):
        screen = [[1.0, north], [4.0, north]]
        assert trace(Environment.walls([mirror, screen]), tx, rx, FREQUENCY).order.values.tolist() == [0]


def test_a_wall_reflects_only_where_it_stands():
    tx, rx = (5.0, -10.0, 6.0), (5.0, 10.0, 2.0)  # bounce at north 0, height 4
    for north, base, top, count in ((1, 0, 9, 2), (-0.1, 0, 9, 1), (1, 0, 3.9, 1), (1, 4.1, 9, 1)):
        wall = Environment.walls([[[0.0, -50.0], [0.0, north]]], base=base, top=top)
        assert trace(wall, tx, rx, FREQUENCY).sizes["path"] == count


def test_a_closed_cell_lets_nothing_in():
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    cell = Environment.walls(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
    paths = trace(cell, (0.0, 0.0, 1.0), (10.0, 3.0, 1.0), FREQUENCY)
    assert paths.sizes["path"] == 0
    assert paths.vertices.shape == (0, 3, 3)
    assert paths.coefficient.dtype == complex


@pytest.mark.parametrize("seed", range(4))
def test_every_bounce_obeys_the_law_of_reflection_on_its_face(seed):
    place, (tx, rx) = random_place(seed), random_antennas(seed)
    paths = trace(place, tx, rx, FREQUENCY)
    assert (np.diff(paths.delay) >= 0).all()
    for path in paths.transpose("path", ...).vertices.values:
        corners = np.concatenate([tx[None], path[~np.isnan(path[:, 0])], rx[None]])
        ray = np.diff(corners, axis=0)
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        turn = np.diff(ray, axis=0)
        # the change of direction is along the normal of a vertical or level face
        level = np.abs(turn[:, 2]) < 1e-9
        assert (level | (np.hypot(turn[:, 0], turn[:, 1]) < 1e-9)).all()


@pytest.mark.parametrize("polarization", ["vertical", "horizontal"])
@pytest.mark.parametrize("seed", range(6))
def test_the_channel_is_reciprocal(seed, polarization):
    place, (tx, rx) = random_place(seed), random_antennas(seed)
    there = trace(place, tx, rx, FREQUENCY, polarization=polarization)
    back = trace(place, rx, tx, FREQUENCY, polarization=polarization)
    np.testing.assert_allclose(there.delay, back.delay, rtol=1e-12)
    # 1e-12 of 1e-6 s is 1e-18 s, 1e-6 rad of phase
    difference = np.abs(there.coefficient.values - back.coefficient.values)
    assert (difference <= 1e-5 * np.abs(there.coefficient.values) + 1e-15).all()
    np.testing.assert_allclose(there.azimuth, back.departure_azimuth, atol=1e-6)
    np.testing.assert_allclose(there.elevation, back.departure_elevation, atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_turning_and_shifting_the_scene_turns_and_shifts_the_paths(seed):
    rng = np.random.default_rng(seed)
    place, (tx, rx) = random_place(seed), random_antennas(seed)
    angle, shift = rng.uniform(0, 360), rng.uniform(-500, 500, 3)
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    still = trace(place, tx, rx, FREQUENCY)
    moved = trace(place.moved(angle, shift), turn @ tx + shift, turn @ rx + shift, FREQUENCY)
    # coordinates of 1e3 m round to 1e-13 m
    np.testing.assert_allclose(moved.delay * c, still.delay * c, atol=1e-10)
    np.testing.assert_allclose(moved.path_gain, still.path_gain, atol=1e-6)
    np.testing.assert_allclose(moved.elevation, still.elevation, atol=1e-7)
    difference = (moved.azimuth - still.azimuth - angle + 180) % 360 - 180
    np.testing.assert_allclose(difference, 0, atol=1e-7)
    np.testing.assert_allclose(moved.vertices, still.vertices.values @ turn.T + shift, atol=1e-8)
    np.testing.assert_array_equal(moved.reflector, still.reflector)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"rx": (1.0, 2.0, 3.0)}, "both at"),
        ({"rx": (1.0, np.nan, 3.0)}, "rx is"),
        ({"rx": (1.0, 1e200, 3.0)}, "rx is .* expected three numbers of a place on earth"),
        ({"tx": (1.0, 2.0)}, "tx is"),
        ({"frequency": 0.0}, "frequency"),
        ({"polarization": "circular"}, "polarization"),
        ({"max_order": -1}, "max_order"),
    ],
)
def test_impossible_questions_are_refused(change, complaint):
    arguments = {"tx": (1.0, 2.0, 3.0), "rx": (4.0, 5.0, 6.0), "frequency": FREQUENCY} | change
    with pytest.raises(DataError, match=complaint):
        trace(Environment.empty(), **arguments)
