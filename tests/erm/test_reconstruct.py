"""Walls from faces: exact paths give exact walls, noisy ones walls as good as their covariance says."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.evaluate import evaluate_walls, face_hits, point_errors
from erm.geometry import angle_difference, azimuth_of, mirrored, unit
from erm.mpc_table import empty_table, make_table
from erm.outline import read_outline
from erm.reconstruct import reconstruct
from erm.select import select
from erm.walls.fit import fit_line
from erm.walls.line import seed_line
from erm.walls.paths import Paths
from erm.walls.phantom import composed_of, mirror_of
from erm.walls.wall import Wall

FREQUENCY = 132e9
TX = np.array([[5.0, 12.0, 28.4], [62.0, 40.0, 20.0]])
WALLS = np.array([[88.0, -2.0], [172.0, -75.0], [271.0, -70.0], [3.0, -3.0]])  # normal [degree], offset [m]


def route(n=12, seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(12, 60, n), rng.uniform(8, 50, n), np.full(n, 1.4)])


def bounces(tx, rx, *chain, loss=6.0, height=None):
    """Exact paths off successive walls, as columns of a table."""
    image = tx[:, :2]
    for normal, offset in chain:
        image = mirrored(image, normal, offset)
    seen = image - rx[:, :2]
    climb = tx[:, 2] - rx[:, 2] if height is None else height
    length = np.hypot(np.linalg.norm(seen, axis=-1), climb)
    gain = 20 * np.log10(c / FREQUENCY / (4 * np.pi * length)) - loss
    return {
        "position": np.array([f"RX{x:.6f}" for x in rx[:, 0]]),
        "tx_position": tx,
        "rx_position": rx,
        "delay": length / c,
        "azimuth": azimuth_of(seen),
        "path_gain": gain,
    }


def scene(walls=WALLS, txs=TX, rxs=None, delay_std=0.0, azimuth_std=0.0, seed=1):
    """Table of the single bounces of every antenna pair off every wall, with errors drawn."""
    rxs = route() if rxs is None else rxs
    tx, rx = np.repeat(txs, len(rxs), axis=0), np.tile(rxs, (len(txs), 1))
    return joined([bounces(tx, rx, wall) for wall in walls], delay_std, azimuth_std, seed)


def joined(parts, delay_std=0.0, azimuth_std=0.0, seed=1):
    rng = np.random.default_rng(seed)
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    n = len(columns["delay"])
    columns["delay"] = columns["delay"] + delay_std * rng.standard_normal(n)
    columns["azimuth"] = columns["azimuth"] + azimuth_std * rng.standard_normal(n)
    return make_table(columns | {"frequency": FREQUENCY})


def sorted_lines(environment):
    table = environment.reflectors
    lines = np.unique(np.column_stack([table["normal"].values, table["offset"].values]), axis=0)
    return lines[np.argsort(lines[:, 0])]


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
    assert merged["reason"].values.tolist() == ["no wall shared with other positions"]


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


def test_errors_that_a_table_does_not_state_are_found():
    rx = route(30)
    tx = np.tile(TX[0], (len(rx), 1))
    direct = bounces(tx, rx, loss=0.0)
    table = joined([direct, *(bounces(tx, rx, wall) for wall in WALLS)], 2e-10, 1.0)
    _, merged = reconstruct(select(table))
    # some 150 residuals: a median absolute deviation is right to 10 % of the standard deviation; three of these
    assert merged.attrs["delay_std"] == pytest.approx(2e-10, rel=0.3)
    assert merged.attrs["azimuth_std"] == pytest.approx(1.0, rel=0.3)


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
    environment.write(tmp_path / "empty.h5")
    assert environment.read(tmp_path / "empty.h5").reflectors.sizes["reflector"] == 0


def test_direct_paths_alone_are_an_empty_map():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    environment, merged = reconstruct(select(joined([bounces(tx, rx, loss=0.0)])))
    assert environment.reflectors.sizes["reflector"] == 0
    assert set(merged["reason"].values) == {"direct path"}


def paths_of(columns, length_std=0.05, azimuth_std=0.7, loss=6.0):
    n = len(columns["delay"])
    return Paths(
        tx=columns["tx_position"],
        rx=columns["rx_position"],
        length=columns["delay"] * c,
        azimuth=columns["azimuth"],
        length_std=np.full(n, length_std),
        azimuth_std=np.full(n, azimuth_std),
        link=np.arange(n),
        transmitter=np.zeros(n, dtype=np.int64),
        loss=np.full(n, loss),
        loss_std=np.zeros(n),
        wavelength=np.full(n, c / FREQUENCY),
        rise=np.full(n, np.nan),
        rise_std=np.full(n, np.nan),
        row=np.arange(n),
    )


def test_the_wall_of_one_path_is_its_face_with_the_same_covariance():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    for row in range(len(rx)):
        path = paths_of(bounces(tx, rx, WALLS[1])).take(np.array([row]))
        face = seed_line(path)
        fitted = fit_line(path, face).about(face.pivot)
        assert float(angle_difference(fitted.normal, face.normal)) == pytest.approx(0, abs=1e-9)
        assert fitted.offset == pytest.approx(face.offset, abs=1e-9)
        np.testing.assert_allclose(fitted.covariance, face.covariance, rtol=1e-6)


def wall_of(columns, loss=6.0):
    paths = paths_of(columns, loss=loss)
    everything = np.arange(len(paths))
    return Wall(paths, fit_line(paths, seed_line(paths.take(everything[:1]))), everything)


def test_two_bounces_are_known_by_the_image_of_the_image():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    south, north = WALLS[0], WALLS[2]
    mirrors = [mirror_of(wall_of(bounces(tx, rx, wall)), 60.0) for wall in (south, north)]
    both = bounces(tx, rx, south, north)
    assert composed_of(wall_of(both, loss=12.0), mirrors)
    assert not composed_of(wall_of(both, loss=12.0), mirrors[:1])
    assert not composed_of(wall_of(both, loss=1.0), mirrors)  # two bounces lose what both walls lose
    assert not composed_of(wall_of(bounces(tx, rx, WALLS[1]), loss=12.0), mirrors)


def test_errors_of_walls_follow_their_covariance():
    delay_std, azimuth_std, draws = 2e-10, 0.5, 40
    chi2 = []
    for seed in range(draws):
        noisy = scene(WALLS[:1], TX[:1], route(6), delay_std, azimuth_std, seed)
        noisy["delay_std"][:], noisy["azimuth_std"][:] = delay_std, azimuth_std
        environment, _ = reconstruct(select(noisy), max_gap=np.inf)
        wall = environment.reflectors.isel(reflector=0)
        error = np.array([angle_difference(wall["normal"], WALLS[0, 0]), wall["offset"] - WALLS[0, 1]])
        chi2.append(error @ np.linalg.solve(wall["covariance"].values, error))
    # the mean of 40 chi-squared values of 2 degrees of freedom is 2 +- 0.32
    assert abs(np.mean(chi2) - 2) < 3 * 0.32


def test_parallel_walls_three_metres_apart_stay_two():
    rx = route(24)
    tx = np.tile(TX[0], (len(rx), 1))
    near = rx[:, 0] < 35  # the further wall stands beside the nearer one, not behind it
    parts = [bounces(tx[near], rx[near], (90.0, -50.38)), bounces(tx[~near], rx[~near], (90.0, -53.38))]
    environment, _ = reconstruct(select(joined(parts, 1e-10, 1.0)), max_gap=np.inf)
    found = sorted_lines(environment)
    assert len(found) == 2
    np.testing.assert_allclose(np.sort(found[:, 1]), [-53.38, -50.38], atol=0.5)


def test_a_wall_hidden_behind_another_is_not_believed():
    walls = np.array([[90.0, -50.38], [90.0, -53.38]])
    environment, merged = reconstruct(select(scene(walls, TX[:1], route(24))), max_gap=np.inf)
    np.testing.assert_allclose(environment.reflectors["offset"], [-50.38], atol=1e-3)
    assert "wall would stand in the way of other paths" in merged["reason"].values


def test_faces_half_a_metre_apart_are_told_apart():
    rx = route(16)
    tx = np.tile(TX[0], (8, 1))
    parts = [bounces(tx, rx[:8], (90.0, -20.0)), bounces(tx, rx[8:], (90.0, -20.5))]
    environment, _ = reconstruct(select(joined(parts, 1e-10, 0.5)), max_gap=np.inf)
    offsets = np.unique(environment.reflectors["offset"].values)
    # 3 cm of path are 2 cm of offset, less by the averaging
    np.testing.assert_allclose(offsets, [-20.5, -20.0], atol=0.1)


def test_two_faces_are_no_wall_and_three_are():
    for count, walls in ((2, 0), (3, 1)):
        environment, merged = reconstruct(select(scene(WALLS[:1], TX[:1], route(count))), max_gap=np.inf)
        assert environment.reflectors.sizes["reflector"] == walls
        assert merged["accepted"].values.sum() == count * walls


@pytest.mark.parametrize("chain", [(0, 3), (3, 0), (0, 2), (1, 0)])
def test_double_bounces_agree_on_a_wall_that_is_not_there_and_are_struck_out(chain):
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    singles = [bounces(tx, rx, wall, loss=5.0) for wall in WALLS]
    doubles = bounces(tx, rx, *(WALLS[i] for i in chain), loss=10.0)
    table = joined([*singles, doubles], 1e-10, 0.5)
    environment, merged = reconstruct(select(table), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == len(WALLS)
    assert not merged["accepted"].values[-len(rx) :].any()


def test_both_orders_of_a_double_bounce_give_a_hidden_wall_away():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    known, hidden = WALLS[0], WALLS[1]
    parts = [bounces(tx, rx, known, loss=5.0), bounces(tx[:5], rx[:5], known, hidden, loss=10.0)]
    parts.append(bounces(tx[5:10], rx[5:10], hidden, known, loss=10.0))
    environment, merged = reconstruct(select(joined(parts, 1e-10, 0.5)), max_gap=np.inf)
    assert sorted_lines(environment)[:, 0] == pytest.approx([known[0]], abs=1)
    assert not merged["accepted"].values[len(rx) :].any()


def test_a_bounce_off_wall_and_ground_makes_no_second_wall():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    echo = bounces(tx, rx, WALLS[1], loss=11.0, height=tx[:, 2] + rx[:, 2])
    table = joined([bounces(tx, rx, WALLS[1], loss=5.0), echo], 1e-10, 0.5)
    environment, _ = reconstruct(select(table, delay_window=1e-9), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == 1


def test_azimuths_left_on_a_ten_degree_grid_still_give_the_walls():
    table = scene(txs=TX[:1], rxs=route(24))
    table["azimuth"][:] = np.round(table["azimuth"].values / 10) * 10
    environment, _ = reconstruct(select(table), max_gap=np.inf)
    found = sorted_lines(environment)
    expected = WALLS[np.argsort(WALLS[:, 0])]
    assert found.shape == expected.shape
    # delays are exact and stand for 0.3 ns; the line near the bounces follows these, not the azimuths
    table = environment.reflectors
    nearest = [np.argmin(np.abs(angle_difference(WALLS[:, 0], normal))) for normal in table["normal"].values]
    middle = table["end_points"].values.mean(axis=1)
    off = np.sum(unit(WALLS[nearest, 0]) * middle, axis=-1) - WALLS[nearest, 1]
    assert np.abs(off).max() < 0.3


def ideal_mpcs(folder: Path, name: str, seed: int = 0):
    """Paths within 25 dB of the strongest of each receiver, delays to 0.1 ns and azimuths to 0.5 degrees."""
    rng = np.random.default_rng(seed)
    with h5py.File(folder / "raytraced" / f"{name}_diffuse.h5") as file:
        path = {key: file["path"][key][:] for key in ("power_db", "rx_index", "delay_geom_s", "aoa_az")}
        single = file["path"]["is_single_bounce_specular_wall"][:]
        bounce = file["path"]["last_vertex"][:]
        rx, tx, frequency = file["rx_position"][:], file["tx_position"][:], float(file.attrs["frequency_hz"])
    index = path["rx_index"]
    strongest = np.full(len(rx), -np.inf)
    np.maximum.at(strongest, index, path["power_db"])
    kept = path["power_db"] > strongest[index] - 25
    n = kept.sum()
    table = make_table(
        {
            "position": index[kept].astype(str),
            "tx_position": tx,
            "rx_position": rx[index[kept]],
            "frequency": frequency,
            "delay": path["delay_geom_s"][kept] + 1e-10 * rng.standard_normal(n),
            "azimuth": np.rad2deg(path["aoa_az"][kept]) + 0.5 * rng.standard_normal(n),
            "path_gain": path["power_db"][kept],
            "delay_std": np.full(n, 1e-10),
            "azimuth_std": np.full(n, 0.5),
        }
    )
    return table, single[kept], bounce[kept]


@pytest.mark.parametrize("name", ["lroom", "canyon", "city"])
def test_walls_of_an_independent_ray_tracer_are_found(shared_data: Path, name):
    table, single, bounce = ideal_mpcs(shared_data, name)
    outline = read_outline(shared_data / "raytraced" / f"{name}_outline.geojson")
    environment, merged = reconstruct(select(table))
    is_wall = environment.reflectors["kind"].values == "wall"
    assert is_wall.all()
    result = evaluate_walls(environment, outline, face_hits(bounce[single], outline))
    assert result["missed"] == 0
    assert result["correctness"] >= 0.9
    # 3 cm and half a degree at 100 m, some walls from three receivers only
    assert result["offset_error"]["rmse"] < 0.1
    judged = merged["accepted"].values & single
    assert np.median(point_errors(merged["reflection_point"].values[judged], outline).perpendicular) < 0.15
