"""From components to a map: exact paths give exact walls, in any frame and order, and nothing gives nothing."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from erm.geometry.vertical import angle_difference, unit
from erm.maps.formats import read_map, write_map
from erm.mpcs.reasons import Reason
from erm.mpcs.selection import select
from erm.mpcs.table import empty_table
from erm.reconstruction.reconstruct import reconstruct

from .bounces import TX, WALLS, bounces, joined, route, scene, sorted_lines


@pytest.mark.parametrize("txs", [TX[:1], TX])
def test_exact_paths_give_exact_walls(txs):
    environment, table = reconstruct(select(scene(txs=txs)))
    found = sorted_lines(environment)
    expected = WALLS[np.argsort(WALLS[:, 0])]
    assert found.shape == expected.shape
    # a millimetre over walls of 100 m is 6e-4 degrees
    np.testing.assert_allclose(found[:, 0], expected[:, 0], atol=1e-6)
    np.testing.assert_allclose(found[:, 1], expected[:, 1], atol=1e-3)
    used = table["wall"].values >= 0
    assert used.all()
    np.testing.assert_allclose(table["wall_point"].values[used], table["reflection_point"].values[used], atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.slow
def test_turning_and_shifting_the_scene_turns_and_shifts_the_map(seed):
    rng = np.random.default_rng(seed)
    angle, shift = rng.uniform(0, 360), rng.uniform(-500, 500, 2)
    table = scene(delay_std=1e-10, azimuth_std=0.5, seed=seed)
    turn = np.stack([unit(angle), unit(angle + 90)])
    moved = table.copy(deep=True)
    for name in ("tx_position", "rx_position"):
        moved[name][:, :2] = table[name].values[:, :2] @ turn + shift
    moved["azimuth"][:] = table["azimuth"].values + angle
    here, _ = reconstruct(select(table))
    there, _ = reconstruct(select(moved))
    expected = here.moved(angle, shift).reflectors
    assert here.reflectors.sizes["reflector"] >= 4
    np.testing.assert_allclose(there.reflectors["end_points"], expected["end_points"], atol=1e-6)
    np.testing.assert_allclose(angle_difference(there.reflectors["normal"], expected["normal"]), 0, atol=1e-6)
    np.testing.assert_allclose(there.reflectors["offset"], expected["offset"], atol=1e-6)
    np.testing.assert_allclose(there.reflectors["covariance"], expected["covariance"], rtol=1e-5, atol=1e-9)
    np.testing.assert_array_equal(there.reflectors["support"], expected["support"])


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.slow
def test_a_mirrored_scene_gives_the_mirrored_map(seed):
    table = scene(delay_std=1e-10, azimuth_std=0.5, seed=seed)
    mirrored_table = table.copy(deep=True)
    for name in ("tx_position", "rx_position"):
        mirrored_table[name][:, 1] *= -1
    mirrored_table["azimuth"][:] = -table["azimuth"].values
    here, _ = reconstruct(select(table))
    there, _ = reconstruct(select(mirrored_table))
    assert here.reflectors.sizes == there.reflectors.sizes
    np.testing.assert_allclose(angle_difference(there.reflectors["normal"], -here.reflectors["normal"]), 0, atol=1e-6)
    np.testing.assert_allclose(there.reflectors["offset"], here.reflectors["offset"], atol=1e-6)
    np.testing.assert_array_equal(there.reflectors["support"], here.reflectors["support"])


def test_one_component_is_no_wall_and_says_so():
    environment, merged = reconstruct(select(scene(WALLS[:1], TX[:1], route(1))))
    assert environment.reflectors.sizes["reflector"] == 0
    assert merged["reason"].values.tolist() == [Reason.NOT_SHARED]


def test_a_position_measured_thrice_is_one_position():
    table = scene(WALLS[:1], TX[:1], np.repeat(route(1), 3, axis=0), 1e-11, 0.1)
    environment, _ = reconstruct(select(table))
    assert environment.reflectors.sizes["reflector"] == 0


def test_positions_on_a_line_through_the_transmitter_still_locate_walls():
    # ranges from collinear places leave two images open, azimuths decide
    along = np.linspace(8, 50, 10)
    rxs = np.column_stack([TX[0, 0] + along * np.cos(0.5), TX[0, 1] + along * np.sin(0.5), np.full(10, 1.4)])
    environment, _ = reconstruct(select(scene(WALLS[:2], TX[:1], rxs, 1e-10, 0.5)), max_gap=np.inf)
    expected = WALLS[:2][np.argsort(WALLS[:2, 0])]
    assert np.abs(angle_difference(sorted_lines(environment)[:, 0], expected[:, 0])).max() < 0.5


@pytest.mark.slow
def test_errors_that_a_table_does_not_state_are_found():
    rx = route(30)
    tx = np.tile(TX[0], (len(rx), 1))
    direct = bounces(tx, rx, loss=0.0)
    table = joined([direct, *(bounces(tx, rx, wall) for wall in WALLS)], 2e-10, 1.0)
    _, merged = reconstruct(select(table))
    # some 150 residuals: a median absolute deviation is right to 10 % of the standard deviation; three of these
    assert merged.attrs["delay_std"] == pytest.approx(2e-10, rel=0.3)
    assert merged.attrs["azimuth_std"] == pytest.approx(1.0, rel=0.3)


@pytest.mark.slow
def test_clocks_that_are_off_by_more_than_the_table_knows_lose_few_paths():
    # 12 ps are 4 mm, 5 of the standard errors that the table knows of, and shift all paths of a recording alike
    lost = 0
    for seed in range(6, 12):
        table = scene(WALLS, TX[:1], route(6), 2.4e-12, 0.03, seed=seed)
        table["delay_std"][:], table["azimuth_std"][:] = 2.4e-12, 0.03
        _, position = np.unique(table["rx_position"].values[:, 0], return_inverse=True)
        table["delay"][:] = table["delay"].values + np.random.default_rng(seed).normal(0, 12e-12, 6)[position]
        environment, merged = reconstruct(select(table), max_gap=np.inf)
        assert environment.reflectors.sizes["reflector"] == len(WALLS)
        lost += int((~merged["accepted"].values).sum())
    assert lost <= 0.05 * 6 * 6 * len(WALLS)  # six clocks tell their scatter to a third, and one may lie far out


@pytest.mark.parametrize(("silent", "pieces"), [(1, 1), (2, 1), (3, 2)])
def test_a_wall_ends_where_three_links_saw_none_and_not_where_one_missed_it(silent, pieces):
    # the wall east = 30; links between those at its two ends should have seen it half-way and did not
    north = np.r_[np.linspace(-24, -14, 4), np.linspace(14, 24, 4)]
    quiet = np.linspace(-2, 2, silent)
    tx = np.array([[0.0, 0.0, 10.0]])
    heard = np.column_stack([np.zeros(8), north, np.full(8, 1.4)])
    table = scene(np.array([[180.0, -30.0]]), tx, heard, 1e-11, 0.1)
    deaf = np.column_stack([np.full(silent, 5.0), quiet, np.full(silent, 1.4)])
    elsewhere = scene(np.array([[0.0, -20.0]]), tx, deaf, 1e-11, 0.1, seed=5)
    environment, _ = reconstruct(select(xr.concat([table, elsewhere], dim="mpc")))
    east = np.abs(environment.reflectors["end_points"].values[:, 0, 0] - 30) < 0.1
    assert east.sum() == pieces


@pytest.mark.parametrize(("silent", "pieces"), [([], 2), ([2, 6, 24, 28, 31], 1)])
def test_three_links_that_saw_no_wall_side_by_side_end_it_only_where_others_nearly_always_saw_it(silent, pieces):
    # a facade with relief has no specular point for five more links: B(28, 9) / B(28, 6) x 32 = 0.25 rows of three
    north = np.linspace(-60, 60, 35)
    deaf = np.isin(np.arange(35), [15, 16, 17, *silent])
    tx = np.array([[0.0, 0.0, 10.0]])
    rx = np.column_stack([np.zeros(35), north, np.full(35, 1.4)])
    heard = scene(np.array([[180.0, -30.0]]), tx, rx[~deaf], 1e-11, 0.1)
    elsewhere = scene(np.array([[0.0, -20.0]]), tx, rx[deaf], 1e-11, 0.1, seed=5)
    environment, _ = reconstruct(select(xr.concat([heard, elsewhere], dim="mpc")))
    east = np.abs(environment.reflectors["end_points"].values[:, 0, 0] - 30) < 0.1
    assert east.sum() == pieces


def test_a_wall_may_go_on_unseen_up_to_the_third_link_that_should_have_seen_it():
    # the wall east = 30 is seen up to north = 12; links 10 m in front of it expect reflections at 3/4 of their north
    tx = np.array([[0.0, 0.0, 10.0]])
    heard = np.column_stack([np.zeros(8), np.linspace(-24, 24, 8), np.full(8, 1.4)])
    deaf = np.array([[20.0, north, 1.4] for north in (24.0, 28.0, 32.0)])
    wall = scene(np.array([[180.0, -30.0]]), tx, heard, 1e-11, 0.1)
    elsewhere = scene(np.array([[0.0, -20.0]]), tx, deaf, 1e-11, 0.1, seed=5)
    for count, bound in ((3, 24.0), (2, np.nan)):
        kept = elsewhere.isel(mpc=np.isin(elsewhere["rx_position"].values[:, 1], deaf[:count, 1]))
        environment, _ = reconstruct(select(xr.concat([wall, kept], dim="mpc")))
        one = environment.reflectors.isel(reflector=int(np.argmax(environment.reflectors["support"].values)))
        north = one["end_points"].values[:, 1]
        up = int(np.argmax(north))
        # noise turns the wall by hundredths of a degree: centimetres at its ends
        np.testing.assert_allclose(north[up] + one["unseen"].values[up], bound, atol=0.05)
        assert np.isnan(one["unseen"].values[1 - up])


def test_a_direct_path_through_a_gap_ends_a_wall():
    wall = np.array([[90.0, 0.0]])
    rxs = np.array([[x, 10.0, 1.4] for x in (-24.0, -20.0, -16.0, 16.0, 20.0, 24.0)])
    txs = np.array([[0.0, 12.0, 1.8]])
    table = scene(wall, txs, rxs, 1e-11, 0.1)
    through = bounces(txs, np.array([[0.1, -15.0, 0.9]]), loss=0.0)  # passes below the reflection points
    opened = joined([through])
    whole, _ = reconstruct(select(table), max_gap=100.0)
    cut, _ = reconstruct(select(xr.concat([table, opened], dim="mpc")), max_gap=100.0)
    assert whole.reflectors.sizes["reflector"] == 1
    assert cut.reflectors.sizes["reflector"] == 2
    ends = np.sort(cut.reflectors["end_points"].values[..., 0].ravel())
    assert ends[1] < 0.1 < ends[2]


@pytest.mark.slow
def test_the_order_of_rows_does_not_matter():
    table = scene(delay_std=1e-10, azimuth_std=0.5, seed=5)
    order = np.random.default_rng(6).permutation(table.sizes["mpc"])
    environment, merged = reconstruct(select(table))
    shuffled, merged_shuffled = reconstruct(select(table.isel(mpc=order)))
    for name in ("end_points", "normal", "offset", "covariance", "support", "top"):
        np.testing.assert_allclose(shuffled.reflectors[name], environment.reflectors[name], rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(merged_shuffled["wall"], merged["wall"][order])


def test_nothing_received_is_an_empty_legal_map(tmp_path: Path):
    environment, merged = reconstruct(select(empty_table()))
    assert environment.reflectors.sizes["reflector"] == 0
    assert merged.sizes["mpc"] == 0
    write_map(environment, tmp_path / "empty.h5")
    assert read_map(tmp_path / "empty.h5").reflectors.sizes["reflector"] == 0


def test_direct_paths_alone_are_an_empty_map():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    environment, merged = reconstruct(select(joined([bounces(tx, rx, loss=0.0)])))
    assert environment.reflectors.sizes["reflector"] == 0
    assert set(merged["reason"].values) == {Reason.DIRECT_PATH}


def test_two_faces_are_no_wall_and_three_are():
    for count, walls in ((2, 0), (3, 1)):
        environment, merged = reconstruct(select(scene(WALLS[:1], TX[:1], route(count))), max_gap=np.inf)
        assert environment.reflectors.sizes["reflector"] == walls
        assert merged["accepted"].values.sum() == count * walls
