"""Scenes: read as drawn, simulated to files, and the shipped campaign is the published one."""

from collections import Counter

import h5py
import numpy as np
import pytest
import shapely

from erm.common.errors import DataError
from erm.common.storage import open_group
from erm.maps.environment import Environment
from erm.maps.formats import read_map, write_map
from erm.tracing.trace import trace
from sounder import shipped
from sounder.instrument.antenna_pattern import Pattern
from sounder.recordings import native
from sounder.twin.faults import Faults
from sounder.twin.scene import load_scene
from sounder.twin.simulate import back_to_back_of, environment_of, record_scene, simulate, trace_scene

SMALL = """
name = "one wall"
frame = "{frame}"
snapshots = 2
seed = 3
max_order = 1
[transmitters]
TX = [0, 0, 10]
[[receivers]]
name = "A"
tx = "TX"
position = [40, {a}, 2]
los = true
[[receivers]]
name = "B"
tx = "TX"
position = [60, {b}, 2]
[[environment.walls]]
points = [[-100, {wall}], [100, {wall}], [100, {far}]]
top = 30
[[environment.poles]]
position = [20, {a}]
radius = 0.1
"""
NORTH = SMALL.format(frame="east-north", a=-5, b=-8, wall=-20, far=-40)
SOUTH = SMALL.format(frame="east-south", a=5, b=8, wall=20, far=40)


def written(tmp_path, text, name="scene.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("digits", [40, 400])
def test_more_snapshots_than_memory_holds_are_refused(tmp_path, digits):
    with pytest.raises(DataError, match=r"snapshots: one direction needs .*, more than the limit"):
        load_scene(written(tmp_path, NORTH.replace("snapshots = 2", f"snapshots = {10**digits}")))


@pytest.mark.parametrize("given", ["[60, -8, 2]", "[[-100, -20]", "position = [20, -5]", "[0, 0, 10]"])
def test_a_position_beyond_the_earth_is_refused_where_it_stands(tmp_path, given):
    """Images of such places overflow."""
    beyond = given.rpartition(",")[0] + ", -1e200]"
    with pytest.raises(DataError, match=r"\d is -1e\+200; expected more than -4.1e\+07"):
        load_scene(written(tmp_path, NORTH.replace(given, beyond)))


def test_south_is_turned_to_north_at_the_border(tmp_path):
    north, south = (load_scene(written(tmp_path, text)) for text in (NORTH, SOUTH))
    assert south == north
    assert south.environment.walls[0].segments == [((-100, -20), (100, -20)), ((100, -20), (100, -40))]


def test_files_are_looked_for_beside_the_scene(tmp_path):
    write_map(Environment.walls([[[-100.0, -20], [100, -20]]], top=30.0), tmp_path / "place.geojson")
    head = NORTH[: NORTH.index("[[environment.walls]]")]
    scene = load_scene(written(tmp_path, head + '[environment]\nfile = "place.geojson"\n'))
    assert environment_of(scene).reflectors.sizes["reflector"] == 1
    paths, _ = trace_scene(scene, environment_of(scene))
    assert paths.order.values.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (NORTH.replace("seed", "sead"), r"sead: unknown key; did you mean seed\?"),
        (NORTH.replace('tx = "TX"', 'tx = "TY"', 1), "A names the transmitter TY; known are TX"),
        (NORTH.replace('name = "B"', 'name = "A"'), "A appears twice"),
        (NORTH.replace('name = "B"', 'name = "../B"'), r"receivers\.1: name is '\.\./B'; expected a file name"),
        (NORTH.replace("[40, -5, 2]", "[0, 0, 10]"), "A and TX have the same position"),
        (NORTH.replace("[40, -5, 2]", "[40, nan, 2]"), r"receivers\.0\.position\.1 is nan"),
        (NORTH.replace("snapshots = 2", "snapshots = 0"), "snapshots is 0; expected at least 1"),
        (NORTH.replace("TX = [0, 0, 10]", "TX = [0]"), r"transmitters\.TX holds 1 of 3 values$"),
        (
            "[waveform]\norder = 9\n[scan]\nazimuth = [0]\n[carrier]\n",
            "waveform: unknown key; known are .*; scan: unknown key; carr",
        ),
        ("attenuator = -60\n" + NORTH, "attenuator: found -60; expected a loss of at least 0 dB"),
        (NORTH.replace("top = 30", "top = -5"), r"environment\.walls\.0: top is -5 m; expected more than base, 0 m"),
        (NORTH.replace("[[-100, -20], ", "[[-100, -20], [-100, -20], "), "twice in a row"),
        (
            NORTH
            + "[environment]\nground = {height = 3, material = 'wood'}\nceiling = {height = 2, material = 'wood'}\n",
            r"ceiling\.height is 2 m; expected more than ground\.height, 3 m",
        ),
        (NORTH.replace("[[environment.walls]]", '[environment]\nfile = "x"\n[[environment.walls]]'), "walls are both"),
        (NORTH.replace("[transmitters]", "[faults]\nphase_nois = false\n[transmitters]"), "faults.phase_nois: unknown"),
        ('sounder = "none.toml"\n' + NORTH, "none.toml: no such file"),
    ],
)
def test_a_scene_that_does_not_fit_is_refused_by_name(tmp_path, text, said):
    with pytest.raises(DataError, match=said) as caught:
        load_scene(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_line_of_sight_that_is_not_there_is_refused(tmp_path):
    scene = load_scene(written(tmp_path, NORTH.replace("position = [40, -5, 2]", "position = [40, -25, 2]")))
    with pytest.raises(DataError, match="A is not in line of sight of TX"):
        trace_scene(scene, environment_of(scene))
    scene = load_scene(written(tmp_path, NORTH.replace("los = true", "los = false")))
    with pytest.raises(DataError, match="A is in line of sight of TX"):
        trace_scene(scene, environment_of(scene))


def test_a_scene_that_cannot_be_leaves_nothing_behind(tmp_path):
    for text in (NORTH.replace("top = 30", 'material = "cheese"'), NORTH.replace("los = true", "los = false")):
        with pytest.raises(DataError):
            simulate(load_scene(written(tmp_path, text)), tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_unknown_material_and_unsuited_attenuator_are_refused(tmp_path):
    scene = load_scene(written(tmp_path, NORTH.replace("top = 30", 'top = 30\nmaterial = "cheese"')))
    with pytest.raises(DataError, match=r"^one wall: environment: unknown material 'cheese'"):
        environment_of(scene)
    (tmp_path / "low.s2p").write_text("# GHz S RI R 50\n1 0 0 1e-3 0 1e-3 0 0 0\n2 0 0 1e-3 0 1e-3 0 0 0\n")
    scene = load_scene(written(tmp_path, 'attenuator = "low.s2p"\n' + NORTH))
    with pytest.raises(DataError, match=r"131\.460 to 132\.540 GHz"):
        back_to_back_of(scene)
    assert back_to_back_of(load_scene(written(tmp_path, "attenuator = 50\n" + NORTH))).attenuation == 50


@pytest.mark.slow
def test_campaign_on_disk_is_the_simulated_one_and_the_truth_beside_it(tmp_path):
    scene = load_scene(written(tmp_path, NORTH))
    steps = []
    files = simulate(scene, tmp_path / "out", progress=lambda: steps.append(1))
    assert [file.name for file in files] == ["A.h5", "B.h5"]
    assert len(steps) == 2
    traced = trace_scene(scene, environment_of(scene))
    for file, recording, paths in zip(files, record_scene(scene, traced), traced, strict=True):
        (read,) = native.recordings(file)
        assert read.los == 1
        assert read.rx_position == pytest.approx(recording.rx_position)
        for direction in ((0, 0), (33, 1)):
            assert np.array_equal(read.captures(*direction), recording.captures(*direction))
        truth = open_group(tmp_path / "out" / "truth" / "paths.h5")
        here = truth.isel(path=truth["position"].values == read.name)
        assert here["coefficient"].values == pytest.approx(paths["coefficient"].values)
    assert native.back_to_back(tmp_path / "out" / "back-to-back.h5").sounder == scene.sounder
    place = read_map(tmp_path / "out" / "truth" / "environment.geojson").reflectors
    assert place.kind.values.tolist() == ["wall", "wall", "pole"]


@pytest.mark.slow
def test_same_seed_gives_the_same_samples_on_disk(tmp_path):
    written(tmp_path, NORTH)
    stored = []
    for name in ("first", "again"):
        simulate(tmp_path / "scene.toml", tmp_path / name)
        with h5py.File(tmp_path / name / "raw" / "B.h5") as file:
            stored.append({key: file[key][()].tobytes() for key in ("iq", "agc_gain")})
    assert stored[0] == stored[1]


# The published campaign. Source: the letter, Table 2 and section III.

TABLE_2 = {
    ("TX1", "L", 1): [62.2, 66.0, 70.0, 74.1, 78.3, 87.0, 95.9, 105.0, 114.3, 111.9],
    ("TX1", "N", 1): [83.4, 78.0, 80.6, 83.3, 83.6, 83.1, 87.9],
    ("TX3", "L", 11): [57.3, 65.0, 73.3, 81.9, 90.8, 99.9, 105.6, 97.0, 98.7, 92.3, 103.0],
    ("TX3", "N", 8): [98.8, 102.0, 105.4, 108.2, 105.6],
}
EAST_BUILDING = np.array([[46.78, -46.57], [41.10, -106.57]])


@pytest.fixture(scope="module")
def uma():
    return load_scene(shipped.scene("uma.toml"))


@pytest.fixture(scope="module")
def place(uma):
    return environment_of(uma)


@pytest.fixture(scope="module")
def traced(uma, place):
    return {
        r.name: trace(place, uma.transmitters[r.tx], r.position, 132e9, max_order=uma.max_order) for r in uma.receivers
    }


def test_distances_are_those_of_table_2(uma):
    at = {receiver.name: receiver for receiver in uma.receivers}
    assert len(at) == 35
    for (tx, sight, first), distances in TABLE_2.items():
        for k, distance in enumerate(distances):
            receiver = at[f"RX{first + k}_{sight}"]
            assert receiver.tx == tx
            # positions are written to 0.1 mm
            assert np.linalg.norm(np.subtract(receiver.position, uma.transmitters[tx])) == pytest.approx(
                distance, abs=1e-3
            )
    assert {at["RX22_L"].tx, at["RX23_L"].tx} == {"TX2"}
    assert {place[2] for place in uma.transmitters.values()} == {28.4}
    assert {receiver.position[2] for receiver in uma.receivers} == {1.4}


def test_published_walls_stand_where_they_were_published(place):
    walls = place.reflectors
    for y in (-53.38, -50.38, -65.30):
        assert np.any(np.all(walls.end_points.values[..., 1] == y, axis=1)), y
    along = EAST_BUILDING[1] - EAST_BUILDING[0]
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    off = (walls.end_points.values - EAST_BUILDING[0]) @ normal
    # end points are written to 0.1 mm; two ground walls and the one over the corridor
    assert np.sum(np.all(np.abs(off) < 2e-4, axis=1)) == 3


def test_line_of_sight_is_as_published(uma, traced):
    for receiver in uma.receivers:
        assert receiver.los == receiver.name.endswith("_L")
        assert bool(traced[receiver.name].los.any()) == receiver.los, receiver.name


def test_every_position_hears_a_wall_25_db_above_the_noise(uma, place, traced):
    sounder = uma.sounder
    horn = Pattern.of(sounder.rx_antenna)
    azimuth, elevation = (np.asarray(axis) for axis in (sounder.scan.azimuth, sounder.scan.elevation))
    noise = 10 * np.log10(Faults().thermal_noise.power(sounder.waveform.sample_rate))
    processing = 10 * np.log10(sounder.waveform.samples * uma.snapshots)
    upright = np.flatnonzero(place.reflectors.kind.values == "wall")
    hits = Counter()
    for name, paths in traced.items():
        toward = horn.beam_gain(
            paths.azimuth.values, paths.elevation.values, azimuth[:, None, None], elevation[:, None]
        ).max(axis=(0, 1))
        snr = sounder.transmitter.power + 49 + paths.path_gain.values + toward - noise + processing
        met = paths.reflector.values[:, 0]
        walls = (paths.order.values == 1) & np.isin(met, upright) & (snr > 25)
        assert walls.any(), name
        hits.update(met[walls].tolist())
    # a map with something on it: ten straight faces with three or more reflections each
    assert sum(count >= 3 for count in hits.values()) >= 10


def test_route_1_reflects_off_the_east_building_where_it_was_published(traced):
    along = EAST_BUILDING[1] - EAST_BUILDING[0]
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    points = []
    for k in range(1, 11):
        vertices = traced[f"RX{k}_L"].isel(path=traced[f"RX{k}_L"].order.values == 1).vertices.values[:, 0]
        points.extend(v for v in vertices if abs((v[:2] - EAST_BUILDING[0]) @ normal) < 1e-3)
    points = np.array(points)
    assert len(points) == 10
    # the ten published reflection points lie at x 40.87 to 50.53 and y 36.35 to 89.26
    assert points[:, 0].min() > 40
    assert points[:, 0].max() < 51
    assert -points[0, 1] == pytest.approx(36.35, abs=2)
    assert -points[-1, 1] == pytest.approx(89.26, abs=5)


def test_no_path_passes_through_a_building(uma, traced):
    buildings = [wall for wall in uma.environment.walls if wall.closed]
    assert len(buildings) >= 9
    at = {receiver.name: receiver for receiver in uma.receivers}
    legs = []
    for name, paths in traced.items():
        tx, rx = uma.transmitters[at[name].tx], at[name].position
        for order, vertices in zip(paths.order.values, paths.vertices.values, strict=True):
            route = np.array([tx, *vertices[:order], rx])
            legs.append(np.stack([route[:-1], route[1:]], axis=1))
    ends = np.concatenate(legs)
    step = np.linspace(0, 1, 400)[:, None, None]
    points = (ends[:, 0] + step * (ends[:, 1] - ends[:, 0])).reshape(-1, 3)
    for building in buildings:
        # corners are written to 0.1 mm, and a reflection point lies on the wall
        inside = shapely.contains_xy(shapely.Polygon(building.points).buffer(-1e-3), points[:, 0], points[:, 1])
        assert not np.any(inside & (points[:, 2] < building.top)), building
