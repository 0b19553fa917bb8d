"""Walls from faces: exact paths give exact walls, noisy ones walls as good as their covariance says."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from erm.evaluate import evaluate_walls, face_hits, point_errors
from erm.geometry import angle_difference, azimuth_of, mirrored, unit
from erm.mpc_table import empty_table, make_table
from erm.outline import read_outline
from erm.phantom import bounced_twice
from erm.reconstruct import reconstruct
from erm.select import select
from erm.wall import Paths, fit_line, seed_line

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


def paths_of(columns, length_std=0.05, azimuth_std=0.7):
    n = len(columns["delay"])
    return Paths(
        tx=columns["tx_position"],
        rx=columns["rx_position"],
        length=columns["delay"] * c,
        azimuth=columns["azimuth"],
        length_std=np.full(n, length_std),
        azimuth_std=np.full(n, azimuth_std),
        link=np.arange(n),
        loss=np.full(n, 6.0),
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


def test_two_bounces_are_known_by_the_image_of_the_image():
    rx = route()
    tx = np.tile(TX[0], (len(rx), 1))
    lines = [
        fit_line(paths, seed_line(paths.take(np.array([0]))))
        for paths in (paths_of(bounces(tx, rx, w)) for w in WALLS[:2])
    ]
    both = paths_of(bounces(tx, rx, WALLS[1], WALLS[0]))
    with_ground = paths_of(bounces(tx, rx, WALLS[1], height=tx[:, 2] + rx[:, 2] - 2 * 0.7))
    single = paths_of(bounces(tx, rx, WALLS[2]))
    assert bounced_twice(both, lines, 0.7).all()
    assert not bounced_twice(both, lines[:1], 0.7).any()
    assert bounced_twice(with_ground, lines, 0.7).all()
    assert not bounced_twice(with_ground, lines, 3.0).any()
    assert not bounced_twice(single, lines, 0.7).any()


def test_errors_of_walls_follow_their_covariance():
    delay_std, azimuth_std, draws = 2e-10, 0.5, 40
    chi2 = []
    for seed in range(draws):
        noisy = scene(WALLS[:1], TX[:1], route(6), delay_std, azimuth_std, seed)
        noisy["delay_std"][:], noisy["azimuth_std"][:] = delay_std, azimuth_std
        environment, _ = reconstruct(select(noisy), face_depth=0.0, max_gap=np.inf)
        wall = environment.reflectors.isel(reflector=0)
        error = np.array([angle_difference(wall["normal"], WALLS[0, 0]), wall["offset"] - WALLS[0, 1]])
        chi2.append(error @ np.linalg.solve(wall["covariance"].values, error))
    # the mean of 40 chi-squared values of 2 degrees of freedom is 2 +- 0.32; covariances are scaled up where
    # the fit is strained by chance, which takes up to a quarter off it
    assert 1.0 < np.mean(chi2) < 2 + 4 * 0.32


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


def test_a_wall_with_windows_half_a_metre_deep_is_one_wall():
    rx = route(16)
    tx = np.tile(TX[0], (8, 1))
    parts = [bounces(tx, rx[:8], (90.0, -20.0)), bounces(tx, rx[8:], (90.0, -20.5))]
    environment, _ = reconstruct(select(joined(parts)), max_gap=np.inf)
    assert environment.reflectors.sizes["reflector"] == 1
    assert -20.5 < environment.reflectors["offset"].item() < -20.0


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


@pytest.mark.parametrize(("name", "false"), [("lroom", 0), ("canyon", 0), ("city", 1)])
def test_walls_of_an_independent_ray_tracer_are_found(shared_data: Path, name, false):
    # city: four double bounces off a wall that nothing else shows stand as a phantom
    table, single, bounce = ideal_mpcs(shared_data, name)
    outline = read_outline(shared_data / "raytraced" / f"{name}_outline.geojson")
    environment, merged = reconstruct(select(table))
    result = evaluate_walls(environment, outline, face_hits(bounce[single], outline))
    assert result["missed"] == 0
    assert result["false"] <= false
    assert result["offset_error"]["rmse"] < 0.1
    judged = merged["accepted"].values & single
    assert np.median(point_errors(merged["reflection_point"].values[judged], outline).perpendicular) < 0.15
