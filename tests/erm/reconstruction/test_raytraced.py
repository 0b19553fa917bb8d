"""Walls of scenes that another ray tracer computed."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from erm.evaluation.outline import evaluate_walls, face_hits, point_errors
from erm.maps.outline import read_outline
from erm.mpcs.selection import select
from erm.mpcs.table import make_table
from erm.reconstruction.reconstruct import reconstruct


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
@pytest.mark.slow
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


@pytest.mark.parametrize("name", ["lroom", "canyon", "city"])
@pytest.mark.slow
def test_all_specular_paths_with_noise_give_walls_to_centimetres(shared_data: Path, name):
    """Every path to the third order, no truth flag used, delays to 0.1 ns and angles to 0.5 degrees."""
    outline = read_outline(shared_data / "raytraced" / f"{name}_outline.geojson")
    with h5py.File(shared_data / "raytraced" / f"{name}_specular.h5") as file:
        path = {key: file["path"][key][:] for key in ("power_db", "rx_index", "delay_geom_s", "aoa_az", "aoa_el")}
        single = file["path"]["is_single_bounce_specular_wall"][:]
        hits = face_hits(file["path"]["last_vertex"][:][single], outline)
        rx, tx, frequency = file["rx_position"][:], file["tx_position"][:], float(file.attrs["frequency_hz"])
    n = len(single)
    offset, angle = [], []
    for seed in range(5):
        noise = np.random.default_rng(seed).standard_normal((3, n))
        table = make_table(
            {
                "position": path["rx_index"].astype(str),
                "tx_position": tx,
                "rx_position": rx[path["rx_index"]],
                "frequency": frequency,
                "delay": path["delay_geom_s"] + 1e-10 * noise[0],
                "azimuth": np.rad2deg(path["aoa_az"]) + 0.5 * noise[1],
                "elevation": np.rad2deg(path["aoa_el"]) + 0.5 * noise[2],
                "path_gain": path["power_db"],
            }
            | {"delay_std": np.full(n, 1e-10)}
            | {name: np.full(n, 0.5) for name in ("azimuth_std", "elevation_std")}
        )
        environment, _ = reconstruct(select(table))
        result = evaluate_walls(environment, outline, hits)
        assert (result["missed"], result["false"]) == (0, 0)
        assert result["correctness"] >= 0.99
        offset.append(result["offset_error"]["rmse"])
        angle.append(result["angle_error"]["rmse"])
        if name == "city":  # a facade of three faces, of which the third turns by 0.69 degrees
            assert np.abs(environment.reflectors["normal"].values % 180 - 71.18).min() < 0.35
    # bounds of the single bounces and chains together: 1.5 cm in the canyon, 0.06 degrees in the city
    assert np.sqrt(np.mean(np.square(offset))) <= 0.03
    assert np.sqrt(np.mean(np.square(angle))) <= 0.1
