"""Positions in a table of their own, and the back-to-back in a file of its own."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from erm.common.storage import provenance
from sounder.instrument.waveform import held_template
from sounder.processing.jobs import gather
from sounder.processing.position import FilterCache

from .captures import AZIMUTH, B2B, ELEVATION, IQ, RX, SAMPLES, TX, WAVEFORM

LAYOUT = f"""
scale_factor = 2e-7
[captures]
dataset = "raw"
axes = ["azimuth", "elevation", "snapshot", "sample", "iq"]
[grid]
azimuth = {AZIMUTH}
elevation = {ELEVATION}
[positions]
file = "day1_{{}}"
[positions.table]
name = "Pos"
rx = ["e", "n", "u"]
tx = ["tx e", "tx n", "tx u"]
los = "los"
rx_std = "std"
tx_std = 0.04
heading_std = 0.5
[back_to_back]
dataset = "b2b"
axes = ["snapshot", "sample", "iq"]
attenuation = {{ dataset = "att" }}
[sounder.waveform]
{chr(10).join(f"{key} = {value!s}" for key, value in WAVEFORM.items())}
[sounder.carrier]
frequency = {{ attribute = "carrier" }}
"""
TABLE = """Pos;e;n;u;tx e;tx n;tx u;LoS;Std
P1;31,0;-46;1,4;0;0;28,4;1;0,03
P2;32,0;-50;1,5;0;0;28,4;;0,03
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for p in range(3):
        with h5py.File(tmp_path / f"day1_P{p + 1}.h5", "w") as file:
            file["raw"] = IQ[min(p, 1)]
            file.attrs["carrier"] = 28e9
    with h5py.File(tmp_path / "b2b.h5", "w") as file:
        file["b2b"], file["att"] = B2B, 40.0
    (tmp_path / "layout.toml").write_text(LAYOUT, encoding="utf-8")
    (tmp_path / "positions.csv").write_text(TABLE, encoding="utf-8")
    return tmp_path


def opened(folder: Path, **options):
    files = sorted(folder.glob("day1_*.h5"))
    how = {"calibration": folder / "b2b.h5", "positions": folder / "positions.csv"} | options
    return gather(files, layout=folder / "layout.toml", **how)


def test_a_folder_of_files_with_one_layout_one_table_and_one_back_to_back(folder):
    jobs, failures = opened(folder)
    assert [job.recording.name for job in jobs] == ["P1", "P2"]
    assert failures == [f"{folder / 'positions.csv'}: column Pos holds P3 0 times; expected once"]
    for job, rx, los in zip(jobs, RX, (1, -1), strict=True):
        assert job.recording.tx_position.tolist() == TX.tolist()
        assert job.recording.rx_position.tolist() == rx.tolist()
        assert job.recording.los == los
        assert np.isclose(job.recording.sounder.survey.position_std, 0.025 * np.sqrt(2))  # hypot(3, 4) / sqrt(2) cm
        assert job.recording.sounder.survey.heading_std == 0.5
        assert job.recording.missing == []  # nobody described another scan
        assert (job.b2b.attenuation, job.b2b.sounder.carrier.frequency) == (40.0, 28e9)
        assert np.array_equal(job.b2b.captures, B2B)


def test_positions_are_left_out_by_name(folder):
    jobs, failures = opened(folder, skip=["P3", "P1", "P9"])
    assert [job.recording.name for job in jobs] == ["P2"]
    assert failures == ["skip: no position is named P9"]


def test_the_table_may_stand_in_the_folder_of_the_layout_and_nowhere_else(folder):
    layout = folder / "layout.toml"
    layout.write_text(LAYOUT.replace("[positions.table]", '[positions.table]\nfile = "positions.csv"'))
    assert len(opened(folder, positions=None)[0]) == 2
    layout.write_text(LAYOUT.replace("[positions.table]", '[positions.table]\nfile = "../positions.csv"'))
    jobs, failures = opened(folder, positions=None)
    assert jobs == []
    assert "../positions.csv is not in the folder of this file" in failures[0]


def test_places_on_earth_become_metres_from_the_origin(folder):
    pyproj = pytest.importorskip("pyproj")
    origin = (48.1, 11.5, 520.0)
    geod = pyproj.Geod(ellps="WGS84")
    longitude, latitude, _ = geod.fwd(origin[1], origin[0], 30.0, 50.0)
    rows = f"P1,{latitude},{longitude},521.5,48.1,11.5,545\n"
    (folder / "positions.csv").write_text(f"pos,e,n,u,tx e,tx n,tx u\n{rows}")
    text = LAYOUT.replace('los = "los"\nrx_std = "std"', f'frame = "geodetic"\norigin = {list(origin)}')
    (folder / "layout.toml").write_text(text)
    [job], _ = opened(folder)
    assert np.allclose(job.recording.tx_position, [0, 0, 25.0], atol=1e-6)
    # 50 m at a bearing of 30 degrees, on the ellipsoid; longer by the height over the radius of the earth, which is
    # known to 0.5 %, and 0.2 mm below the tangent plane
    high = 1 + 521.5 / 6.371e6
    assert np.allclose(job.recording.rx_position, [25 * high, 50 * np.sqrt(0.75) * high, 1.5], atol=2.2e-4)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('rx = ["e", "n", "u"]', "", "positions: rx: missing"),
        ("[positions.table]", "rx = [0, 0, 1]\n[positions.table]", "rx is given twice"),
        ('los = "los"', 'los = "sight"', "no column sight; the table has pos, e, n, u"),
        ('los = "los"', 'los = "e"', "line 2: e is '31.0'; expected 1, 0 or nothing"),
        ('tx_std = 0.04', 'frame = "geodetic"', 'frame = "geodetic" and origin go together'),
        ('file = "day1_{}"', 'file = "day1"', "with {} for what differs"),
    ],
)  # fmt: skip
def test_a_table_that_does_not_fit_is_one_line(folder, old, new, expected):
    assert old in LAYOUT
    (folder / "layout.toml").write_text(LAYOUT.replace(old, new))
    try:
        _, failures = opened(folder)
    except DataError as error:
        failures = [str(error)]
    assert expected in failures[0]


def test_raw_captures_back_to_back_calibrate_impulse_responses_that_were_correlated_and_cut(folder, description):
    """A back-to-back of the sequence itself, cut to the length of the responses, is a pulse of height one."""
    cut = 200
    sent = held_template(description(waveform=WAVEFORM).sequence)
    late = 230  # cables: beyond the cut
    with h5py.File(folder / "day1_P1.h5", "r+") as file:
        del file["raw"]
        file["raw"] = np.zeros((4, 3, cut), np.complex64)
    with h5py.File(folder / "b2b.h5", "r+") as file:
        del file["b2b"]
        file["b2b"] = np.roll(sent, late)[None] * (1 + 0j)
    text = LAYOUT.replace('"snapshot", "sample", "iq"]\n[grid]', '"delay"]\nkind = "cir"\nsample_rate = 1.2e9\n[grid]')
    text = text.replace('axes = ["snapshot", "sample", "iq"]', 'kind = "iq"\naxes = ["snapshot", "sample"]')
    (folder / "layout.toml").write_text(text)
    jobs, _ = opened(folder)
    job = jobs[0]
    assert job.recording.kind == job.b2b.kind == "cir"
    assert job.b2b.captures.shape == (1, cut)
    at = int(np.argmax(np.abs(job.b2b.captures[0])))
    assert at == late % cut
    assert np.isclose(job.b2b.captures[0, at], 1.0)
    assert job.recording.sounder.bandwidth == 0.9 * 1.2e9  # of held chips, not of a sweep
    pulse = FilterCache().get(job)[0].pulse
    assert np.isclose(pulse[0], 1.0)


def test_a_row_of_samples_is_cut_into_captures(folder):
    """Plain int16 with a sidecar: 7 samples of waiting, then captures 300 samples apart."""
    row = np.zeros((7 + 36 * 300, 2), np.int16)
    apart = row[7:].reshape(4, 3, 3, 300, 2)
    apart[:, :, :, :SAMPLES] = IQ[0]
    (folder / "day1_P1.bin").write_bytes(row[: -(300 - SAMPLES)].tobytes())  # recording ends with the last capture
    (folder / "day1_P1.bin.toml").write_text('dtype = "int16"\nsamples = "complex"\n[attributes]\ncarrier = 28e9')
    text = LAYOUT.replace('"raw"', '"samples"\nflat = true\nstart = 7\nstride = 300')
    (folder / "layout.toml").write_text(text)
    how = {"calibration": folder / "b2b.h5", "positions": folder / "positions.csv", "layout": folder / "layout.toml"}
    [job], failures = gather([folder / "day1_P1.bin"], **how)
    assert failures == []
    assert job.recording.snapshots == 3
    for a, e in np.ndindex(4, 3):
        assert np.array_equal(job.recording.captures(a, e), IQ[0, a, e])
    assert [path.name for path in job.recording.inputs] == ["day1_P1.bin.toml"]
    (folder / "layout.toml").write_text(text.replace("\nstart = 7\nstride = 300", ""))
    _, failures = gather([folder / "day1_P1.bin"], **how)
    assert "has 10761 samples; expected a multiple of 3048, by the layout" in failures[0]


def test_bursts_in_longer_captures(folder):
    """Each capture of the file is 300 samples long; the sequence begins at its sample 7."""
    longer = np.zeros((4, 3, 3, 300, 2), np.int16)
    longer[:, :, :, 7 : 7 + SAMPLES] = IQ[0]
    with h5py.File(folder / "day1_P1.h5", "w") as file:
        file["raw"] = longer
        file.attrs["carrier"] = 28e9
    (folder / "layout.toml").write_text(LAYOUT.replace('"raw"', '"raw"\nflat = true\nstart = 7\nstride = 300'))
    how = {"calibration": folder / "b2b.h5", "positions": folder / "positions.csv", "layout": folder / "layout.toml"}
    [job], failures = gather([folder / "day1_P1.h5"], **how)
    assert failures == []
    for a, e in np.ndindex(4, 3):
        assert np.array_equal(job.recording.captures(a, e), IQ[0, a, e])
    with h5py.File(folder / "day1_P2.h5", "w") as file:
        file["raw"] = longer[..., 0] + 1j * longer[..., 1]
        file.attrs["carrier"] = 28e9
    _, failures = gather([folder / "day1_P2.h5"], **how)
    assert "expected I and Q along the last axis, as the layout names iq" in failures[0]


def test_a_folder_of_touchstone_files_is_a_position(folder, tmp_path):
    sweep = folder / "P1"
    sweep.mkdir()
    frequency = np.linspace(27e9, 29e9, 21)
    for a in AZIMUTH:
        lines = [f"{f:.0f} 0 0 {a} 1 0 0 0 0" for f in frequency]
        (sweep / f"{a:g}.s2p").write_text("# Hz S RI R 50\n" + "\n".join(lines))
    (folder / "vna.toml").write_text(f"""
[captures]
kind = "ctf"
files = "{{azimuth}}.s2p"
dataset = "s21"
axes = ["azimuth", "elevation", "frequency"]
frequency = {{ dataset = "frequency" }}
[grid]
azimuth = {{ dataset = "azimuth" }}
elevation = [0]
[positions]
tx = {TX.tolist()}
rx = {RX[0].tolist()}
""")
    [job], failures = gather([sweep], layout=folder / "vna.toml")
    assert failures == []
    assert job.recording.captures(2, 0).tolist() == [[AZIMUTH[2] + 1j] * 21]
    assert (job.recording.name, job.recording.sounder.carrier.frequency) == ("P1", 28e9)
    assert len(json.loads(provenance("", "", inputs=[sweep])["input_sha256"])["P1"]) == 64
