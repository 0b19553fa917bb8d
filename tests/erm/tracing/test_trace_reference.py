"""Forward model against the path tables of an independent ray tracer."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from erm.maps.environment import Environment, Slab
from erm.maps.materials import Material
from erm.tracing.propagation import path_coefficients
from erm.tracing.trace import trace


def materials_of(file: h5py.File) -> dict[str, Material]:
    table = json.loads(file.attrs["materials_json"])
    del table["_fields"]
    return {
        name: Material(name, permittivity=(values[0], 0.0), conductivity=(values[1], 0.0))
        for name, values in table.items()
    }


def lroom(file: h5py.File) -> Environment:
    corners = np.array([(0, 0), (20, 0), (20, 5), (10, 5), (10, 10), (0, 10)], dtype=float)
    return Environment.walls(
        np.stack([corners, np.roll(corners, -1, axis=0)], axis=1),
        top=5.0,
        material="plaster",
        ground=Slab(0.0, "plaster"),
        ceiling=Slab(5.0, "plaster"),
        materials=materials_of(file),
    )


def canyon(file: h5py.File) -> Environment:
    """Facades of the outline, taller than any path, and the floor at the height where its bounces lie."""
    outline = json.loads(Path(file.filename.replace("_specular.h5", "_outline.geojson")).read_text())
    facades = [
        feature
        for feature in outline["features"]
        if feature["properties"]["z_slice_m"] == 1.5 and feature["properties"]["visible_from_any_rx_frac"]
    ]
    path = file["path"]
    on_floor = (path["interaction"][:] > 0) & ~path["hit_is_wall"][:]
    return Environment.walls(
        [feature["geometry"]["coordinates"] for feature in facades],
        material=[feature["properties"]["material"] for feature in facades],
        ground=Slab(float(path["vertices"][:][on_floor][:, 2].mean()), "concrete"),
        materials=materials_of(file),
    )


def same_paths(theirs: np.ndarray, ours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of paths that bounce at the same points: theirs err by up to 2 mm, other paths are far away."""
    first, second = (np.nan_to_num(v, nan=-99).reshape(len(v), -1) for v in (theirs, ours))
    away = np.abs(first[:, None] - second).max(-1)
    nearest = away.argmin(axis=1)
    mutual = away.argmin(axis=0)[nearest] == np.arange(len(first))
    same = mutual & (away.min(axis=1) < 0.01)
    return np.flatnonzero(same), nearest[same]


def routes(tx: np.ndarray, vertices: np.ndarray, rx: np.ndarray) -> list[np.ndarray]:
    return [np.concatenate([tx[None], path[~np.isnan(path[:, 0])], rx[None]]) for path in vertices]


def broken(route, normals):
    """Largest angle [rad] by which a route (point, 3) departs from the law of reflection at its bounces."""
    legs = np.diff(route, axis=0)
    legs /= np.linalg.norm(legs, axis=1)[:, None]
    normals = normals[: len(route) - 2]
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    mirrored = legs[:-1] - 2 * np.sum(legs[:-1] * normals, axis=1)[:, None] * normals
    return np.max(np.linalg.norm(mirrored - legs[1:], axis=1), initial=0.0)


def gain_on(route: np.ndarray, normal: np.ndarray, reflector: np.ndarray, place: Environment, f: float) -> float:
    """Gain [dB] along given bounce points."""
    names = dict(enumerate(place.reflectors.material.values.tolist()))
    names |= {tag: slab.material for tag, slab in ((-1, place.ground), (-2, place.ceiling)) if slab}
    bounces = len(route) - 2
    eps = [place.materials[names[r]].relative_permittivity(f) for r in reflector[:bounces].tolist()]
    coefficient = path_coefficients(
        route[None], normal[None, :bounces], np.array([eps], dtype=complex), np.zeros((1, bounces)), f
    )
    return 20 * np.log10(abs(coefficient.item()))


def turned(ours: xr.DataArray, theirs: np.ndarray) -> np.ndarray:
    return (ours.values - np.degrees(theirs) + 180) % 360 - 180


@pytest.mark.parametrize("scene", [lroom, canyon])
@pytest.mark.slow
def test_an_independent_ray_tracer_finds_the_same_paths(shared_data, scene):
    with h5py.File(shared_data / "raytraced" / f"{scene.__name__}_specular.h5") as file:
        place, tx, f = scene(file), file["tx_position"][:], float(file.attrs["frequency_hz"])
        receivers, rows = file["rx_position"][:], file["rx_ptr"][:]
        truth = {name: file["path"][name][:] for name in file["path"]}
    missed = extra = 0
    compared = []
    on_their_points = []
    for rx, start, stop in zip(receivers, rows[:-1], rows[1:], strict=True):
        paths = trace(place, tx, rx, f)
        theirs = {name: values[start:stop] for name, values in truth.items()}
        row, column = same_paths(theirs["vertices"], paths.vertices.values)
        missed += stop - start - len(row)
        extra += paths.sizes["path"] - len(row)
        theirs = {name: values[row] for name, values in theirs.items()}
        paths = paths.isel(path=column)
        late = paths.delay.values - theirs["delay_geom_s"]  # 0.01 ps of rounded outlines, some 0.01 rad of phase
        compared.append(
            [
                late,
                paths.path_gain.values - theirs["power_db"],
                np.angle(paths.coefficient.values * np.exp(2j * np.pi * f * late) / theirs["a_baseband"]),
                turned(paths.azimuth, theirs["aoa_az"]),
                turned(paths.elevation, theirs["aoa_el"]),
                turned(paths.departure_azimuth, theirs["aod_az"]),
                turned(paths.departure_elevation, theirs["aod_el"]),
                [
                    broken(route, normal.astype(float))
                    for route, normal in zip(routes(tx, theirs["vertices"], rx), theirs["normal"], strict=True)
                ],
            ]
        )
        on_their_points += [
            gain_on(route, normal.astype(float), reflector, place, f) - power
            for route, normal, reflector, power in zip(
                routes(tx, theirs["vertices"], rx),
                theirs["normal"],
                paths.reflector.values,
                theirs["power_db"],
                strict=True,
            )
        ]
    delay, gain, phase, *angles, law = np.concatenate(compared, axis=1)
    assert missed + extra <= 0.01 * len(truth["order"])
    assert np.abs(delay).max() < 1e-12
    # Their bounce points stand off the exact ones by 0.1 mm as a rule, so that their legs break the law of reflection
    # by up to 4 mrad, most where two bounces are centimetres apart. Near Brewster's angle half a milliradian already
    # changes the gain by 0.1 dB. Along their own legs we agree everywhere, along ours where theirs keep the law.
    assert np.abs(on_their_points).max() < 0.1
    assert np.abs(gain[law < 1e-4]).max() < 0.1
    assert (law < 1e-4).mean() > 0.8
    assert (np.abs(gain) < 0.1).mean() > 0.997
    # a wrong sign or time convention would be an angle of pi, or any
    assert np.median(np.abs(phase)) < 1e-3
    assert all(np.median(np.abs(angle)) < 1e-3 for angle in angles)
