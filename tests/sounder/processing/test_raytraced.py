"""The chain on captures of an independent ray tracer, with another instrument and file layout."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.constants import c

from sounder.options import Options
from sounder.processing.jobs import gather
from sounder.processing.position import FilterCache, process_recording

pytestmark = pytest.mark.slow
LAYOUT = Path(__file__).parents[3] / "examples" / "layouts" / "raytraced.toml"


@pytest.fixture(scope="module", params=["lroom", "canyon", "city"])
def scene(request, shared_data):
    """Each position of a scene: TX, RX, delays [s] and azimuths [degree] of its MPCs, and the true paths."""
    raw = shared_data / "raytraced" / f"{request.param}_raw.h5"
    jobs, failures = gather([raw], layout=LAYOUT)
    assert failures == []
    filters, options = FilterCache(), Options()
    found = []
    for job in jobs:
        groups, remarks = process_recording(job.recording, filters.get(job)[0], options)
        assert not [remark for remark in remarks if remark.code.value.fails]  # no gain over free space among them
        mpc = groups["/mpc"]
        found.append((job.recording.tx_position, job.recording.rx_position, mpc["delay"].values, mpc["azimuth"].values))
    return list(zip(found, true_paths(raw, raw.with_name(f"{request.param}_diffuse.h5")), strict=True))


def true_paths(raw, diffuse):
    columns = ["delay_geom_s", "aoa_az", "power_db", "is_single_bounce_specular_wall", "last_vertex", "normal"]
    with h5py.File(raw) as captures, h5py.File(diffuse) as paths:
        rows, data = paths["rx_ptr"][:], {name: paths["path"][name][:] for name in columns}
        return [
            {name: values[rows[i] : rows[i + 1]] for name, values in data.items()}
            for i in captures["rx_index_in_paths_file"][:]
        ]


def matching(truth, delay, azimuth, late, aside):
    """Indices of true paths within ``late`` [s] and ``aside`` [degree] of an MPC."""
    turned = (np.degrees(truth["aoa_az"]) - azimuth + 180) % 360 - 180
    return np.flatnonzero((np.abs(truth["delay_geom_s"] - delay) < late) & (np.abs(turned) < aside))


def test_strongest_mpc_is_a_true_path(scene):
    """Within 0.3 ns and 3 degrees in nine of ten positions; the others may have seen nothing."""
    right = [
        delay.size > 0 and matching(truth, delay[0], azimuth[0], 0.3e-9, 3.0).size > 0
        for (_, _, delay, azimuth), truth in scene
    ]
    assert np.mean(right) >= 0.9, right


def test_single_wall_bounces_land_on_their_walls(scene):
    """Median perpendicular error under 0.15 m for the MPCs that the tracer says bounced once, on a wall."""
    errors = []
    for (tx, rx, delays, azimuths), truth in scene:
        for delay, azimuth in zip(delays, azimuths, strict=True):
            near = matching(truth, delay, azimuth, 0.5e-9, 4.0)
            if not near.size:
                continue
            path = near[np.argmax(truth["power_db"][near])]
            if truth["is_single_bounce_specular_wall"][path]:
                bounce, normal = truth["last_vertex"][path][:2], truth["normal"][path][0][:2]
                offset = reflection_point(tx, rx, delay * c, azimuth) - bounce
                errors.append(abs(offset @ normal) / np.linalg.norm(normal))
    assert len(errors) >= 20
    assert np.median(errors) < 0.15, np.median(errors)


def reflection_point(tx, rx, path_length, azimuth):
    """``r = (L_h^2 - d^2) / (2 (L_h + u.d))`` from RX along ``u``; ``d = rx - tx`` and ``L_h`` horizontal."""
    d = (rx - tx)[:2]
    horizontal = np.sqrt(path_length**2 - (rx - tx)[2] ** 2)
    toward = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))])
    return rx[:2] + toward * (horizontal**2 - d @ d) / (2 * (horizontal + toward @ d))
