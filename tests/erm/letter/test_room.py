"""The room from its rays: the equations are exact until an approximation is switched on."""

from itertools import product

import numpy as np
import pytest

from erm.letter import room
from erm.letter.captures import Campaign, Link
from erm.letter.truth import is_single_wall_bounce, rays_of
from erm.maps.environment import Environment, Slab

CORNERS = np.array([(0, 0), (20, 0), (20, 5), (10, 5), (10, 10), (0, 10)], dtype=float)


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    place = Environment.walls(
        np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1),
        top=5.0,
        material="plaster",
        ground=Slab(0.0, "plaster"),
        ceiling=Slab(5.0, "plaster"),
    )
    spots = [(3.5, 1.5), (8.0, 2.5), (11.0, 4.0), (14.5, 1.0), (6.0, 4.5), (12.5, 2.0)]
    links = tuple(Link(f"RX{i}", (17.0, 3.5, 4.0), (*spot, 2.0)) for i, spot in enumerate(spots))
    return Campaign("room", place, links, 300e9, 2, {}, None)


@pytest.fixture(scope="module")
def switched(campaign) -> dict[tuple[bool, bool, bool], room.Switched]:
    return {(one.resolution, one.planar, one.higher): one for one in room.switches(campaign)}


def test_every_setting_of_the_switches_is_there(switched):
    assert set(switched) == set(product((False, True), repeat=3))


def test_without_approximations_the_equations_are_exact(switched):
    # rounding of a closed form over 40 m of path: some 1e-14
    assert switched[False, False, False].error.max() < 1e-9


@pytest.mark.parametrize("setting", [(True, False, False), (False, True, False), (False, False, True)])
def test_each_approximation_alone_costs_more_than_the_letter_prints(switched, setting):
    assert switched[setting].statistics["rmse"] > 0.03


def test_the_delays_grid_moves_a_point_by_no_more_than_its_half_cell_allows(campaign, switched):
    # dr/dL = (L - r)/(L + u.d) L/L_h along u, and the point stays on its line of sight; a half cell is c/2B = 0.125 m.
    # (L - r) is TX to bounce, L + u.d = 2 (L - r) sin^2(half the angle at the bounce) + ...: largest near grazing.
    rays = rays_of(campaign.to_order(2))
    kept = is_single_wall_bounce(campaign, rays)
    rx = np.array([campaign.links[i].rx for i in rays.link[kept]])
    tx = np.array([campaign.links[i].tx for i in rays.link[kept]])
    length = rays.delay[kept] * 299792458.0
    toward = np.stack([np.cos(np.radians(rays.azimuth[kept])), np.sin(np.radians(rays.azimuth[kept]))], axis=1)
    flat = np.sqrt(length**2 - 4.0)
    reach = np.linalg.norm(rays.vertex[kept][:, :2] - rx[:, :2], axis=1)
    slope = (flat - reach) / (flat + np.sum(toward * (rx - tx)[:, :2], axis=1)) * length / flat
    half = 0.5 / room.BANDWIDTH * 299792458.0
    assert np.all(switched[True, False, False].error <= 1.2 * slope * half)  # 20 % for the second order


def test_a_plastered_wall_may_lose_what_fresnel_and_roughness_take(campaign):
    # n = 1.92 loses 20 lg(2.92/0.92) = 10.0 dB, 0.15 mm at 300 GHz 15.4 dB
    assert room.largest_loss(campaign) == pytest.approx(10.0 + 15.4 + room.MARGIN, abs=0.1)
