"""However a foreign file keeps the captures, a layout makes the same recordings of it."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from erm.errors import DataError
from sounder import layout as layouts
from sounder.readers import layout as foreign
from sounder.recording import BackToBack, Recording

WAVEFORM = {"order": 7, "polynomial": [7, 1, 0], "chip_rate": 6e8, "samples_per_chip": 2, "sample_rate": 1.2e9}
AZIMUTH, ELEVATION = [10.0, 100.0, 190.0, 280.0], [-9.0, 0.0, 9.0]
POSITIONS, SNAPSHOTS, SAMPLES = 2, 3, 254
ORDER = ("position", "azimuth", "elevation", "snapshot", "sample", "iq")
RNG = np.random.default_rng(7)
IQ = RNG.integers(-(2**15), 2**15, (POSITIONS, 4, 3, SNAPSHOTS, SAMPLES, 2), dtype=np.int16)
AGC = RNG.integers(0, 30, (POSITIONS, 4, 3)).astype(float)
TIME = 1.7e9 + np.arange(24.0).reshape(POSITIONS, 4, 3)
B2B = RNG.integers(-(2**15), 2**15, (5, SAMPLES, 2), dtype=np.int16)
TX, RX = np.array([0.0, 0.0, 28.4]), np.array([[31.0, -46.0, 1.4], [32.0, -50.0, 1.5]])

PLAIN = """
scale_factor = 2e-7
[captures]
dataset = "raw"
axes = ["position", "azimuth", "elevation", "snapshot", "sample", "iq"]
[grid]
azimuth = [10, 100, 190, 280]
elevation = [-9, 0, 9]
[positions]
tx = [0, 0, 28.4]
rx = [[31, -46, 1.4], [32, -50, 1.5]]
"""


@pytest.fixture(scope="module")
def sounder(description):
    return description(waveform=WAVEFORM, scan={"azimuth": AZIMUTH, "elevation": ELEVATION})


@pytest.fixture
def opened(tmp_path: Path, sounder):
    """Write a file and its layout; returns the recordings and the back-to-back."""

    def open_(content: dict[str, Any] | Path, layout: str, attributes: dict[str, Any] | None = None):
        path = tmp_path / "foreign.h5"
        if isinstance(content, Path):
            path = content
        else:
            with h5py.File(path, "w") as file:
                for name, data in content.items():
                    file[name] = data
                for name, value in (attributes or {}).items():
                    of, _, key = name.rpartition("@")
                    (file[of] if of else file).attrs[key] = value
        (tmp_path / "layout.toml").write_text(layout, encoding="utf-8")
        plan = layouts.load(tmp_path / "layout.toml")
        return foreign.recordings(path, plan, sounder), foreign.back_to_back(path, plan, sounder)

    return open_


def toml(axes: tuple[str, ...]) -> str:
    return str(list(axes)).replace("'", '"')


def values(captures: np.ndarray) -> np.ndarray:
    """Complex samples of either form."""
    return captures if captures.dtype.kind == "c" else captures.astype(float) @ [1, 1j]


def assert_same(found: list[Recording | DataError], *, agc: bool = False, time: bool = False) -> None:
    """The recordings are those of ``IQ``, whatever file they came from."""
    assert len(found) == POSITIONS
    for p, recording in enumerate(found):
        assert isinstance(recording, Recording), recording
        assert recording.azimuth.tolist() == AZIMUTH
        assert recording.elevation.tolist() == ELEVATION
        assert recording.missing == []
        assert recording.snapshots == SNAPSHOTS
        assert np.array_equal(recording.tx_position, TX)
        assert np.array_equal(recording.rx_position, RX[p])
        for a, e in np.ndindex(4, 3):
            captures = recording.captures(a, e)
            assert captures.shape[:2] == (SNAPSHOTS, SAMPLES)
            assert captures.flags.c_contiguous
            # 16 bits fit the 24 of single precision
            assert np.array_equal(values(captures), values(IQ[p, a, e])), (p, a, e)
            assert np.array_equal(values(recording.captures(a, e, slice(1, 2))), values(IQ[p, a, e, 1:2]))
        assert np.array_equal(recording.agc_gain, AGC[p] if agc else np.zeros((4, 3)))
        if time:
            assert np.array_equal(recording.time, TIME[p])
        else:
            assert recording.time is None


def test_numbers_written_in_the_layout(opened):
    found, b2b = opened({"raw": IQ}, PLAIN)
    assert_same(found)
    assert found[0].captures(0, 0).dtype == np.int16
    assert [r.name for r in found] == ["foreign-00", "foreign-01"]
    assert {(r.los, r.scale_factor) for r in found} == {(-1, 2e-7)}
    assert b2b is None


@pytest.mark.parametrize("seed", range(6))
def test_axes_in_any_order(opened, seed):
    # gain control and clock stand along the captures' own axes, in their order
    order = np.random.default_rng(seed).permutation(6)
    grid = [axis for axis in order if axis < 3]
    content = {"raw": IQ.transpose(order), "agc": AGC.transpose(grid), "time": TIME.transpose(grid)}
    layout = PLAIN.replace(toml(ORDER), toml(tuple(ORDER[i] for i in order)))
    layout = 'agc_gain = { dataset = "agc" }\ntime = { dataset = "time" }\n' + layout
    found, _ = opened(content, layout)
    assert_same(found, agc=True, time=True)


@pytest.mark.parametrize("slowest", ["azimuth", "elevation"])
@pytest.mark.parametrize("place", [0, 1, 3])
def test_directions_one_after_the_other(opened, slowest, place):
    inner = ("azimuth", "elevation") if slowest == "azimuth" else ("elevation", "azimuth")

    def rows(data: np.ndarray) -> np.ndarray:
        swapped = data if slowest == "azimuth" else data.swapaxes(1, 2)
        return swapped.reshape(POSITIONS, 12, *data.shape[3:])

    axes = ["position", "direction", "snapshot", "sample", "iq"]
    axes.insert(place, axes.pop(1))
    content = {
        "raw": np.moveaxis(rows(IQ), 1, place),
        "agc": rows(AGC).T if place == 0 else rows(AGC),
        "time": rows(TIME).T if place == 0 else rows(TIME),
    }
    assert inner[0] == slowest
    layout = PLAIN.replace(toml(ORDER), toml(tuple(axes)) + f'\nslowest = "{slowest}"')
    found, _ = opened(content, 'agc_gain = { dataset = "agc" }\ntime = { dataset = "time" }\n' + layout)
    assert_same(found, agc=True, time=True)


def test_i_and_q_apart(opened):
    layout = PLAIN.replace('"raw"', '"i"\nimaginary = "q"').replace(', "iq"', "")
    found, _ = opened({"i": IQ[..., 0], "q": IQ[..., 1]}, layout)
    assert_same(found)
    assert found[1].captures(3, 2).dtype == np.int16  # what was int16 stays int16


@pytest.mark.parametrize("dtype", [np.complex64, np.complex128, [("re", "<i2"), ("im", "<i2")], "real"])
def test_complex_samples_in_every_dress(opened, dtype):
    if dtype == "real":  # floating-point I and Q
        found, _ = opened({"raw": IQ.astype(np.float32)}, PLAIN)
    else:
        data = IQ.astype(float) @ [1, 1j]
        if isinstance(dtype, list):
            data = np.zeros(IQ.shape[:-1], dtype)
            data["re"], data["im"] = IQ[..., 0], IQ[..., 1]
        found, _ = opened(
            {"sweep/raw": data.astype(dtype)}, PLAIN.replace(', "iq"', "").replace('"raw"', '"sweep/raw"')
        )
    assert_same(found)
    assert found[0].captures(0, 0).dtype == np.complex64


def test_compass_and_zenith_in_disorder(opened):
    # east is bearing 90, north 0; the horizon is zenith 90
    turn, tilt = np.array([2, 0, 3, 1]), np.array([1, 2, 0])
    content = {
        "raw": IQ[:, turn][:, :, tilt],
        "heading": (90 - np.array(AZIMUTH)[turn]) % 360,
        "zenith": 90 - np.array(ELEVATION)[tilt],
        "agc": AGC[:, turn][:, :, tilt],
        "time": TIME[:, turn][:, :, tilt],
    }
    layout = PLAIN.replace("azimuth = [10, 100, 190, 280]", 'azimuth = { dataset = "heading" }')
    layout = layout.replace("elevation = [-9, 0, 9]", 'elevation = { dataset = "zenith" }')
    layout = layout.replace("[grid]", '[grid]\nazimuth_convention = "compass"\nelevation_convention = "zenith"')
    found, _ = opened(content, 'agc_gain = { dataset = "agc" }\ntime = { dataset = "time" }\n' + layout)
    assert_same(found, agc=True, time=True)


def test_azimuths_counted_from_minus_180(opened):
    content = {"raw": np.roll(IQ, 2, axis=1)}
    found, _ = opened(content, PLAIN.replace("[10, 100, 190, 280]", "[-170, -80, 10, 100]"))
    assert_same(found)


def test_what_the_file_says_of_each_position(opened):
    layout = PLAIN.replace("[31, -46, 1.4], [32, -50, 1.5]", "").replace("rx = []", 'rx = { dataset = "rx" }')
    layout = layout.replace("tx = [0, 0, 28.4]", 'tx = { attribute = "tx", of = "raw" }\nname = "P{}"')
    layout = layout.replace(
        "scale_factor = 2e-7", 'scale_factor = { attribute = "lsb" }\nagc_gain = { dataset = "agc" }'
    )
    layout = layout.replace("[positions]", '[positions]\nlos = { dataset = "los" }')
    layout += """
[back_to_back]
dataset = "b2b"
axes = ["sample", "iq", "snapshot"]
attenuation = { attribute = "loss" }
scale_factor = 3e-7
includes_tx_antenna = true
[sounder.carrier]
frequency = { attribute = "carrier" }
lo_frequency = { attribute = "carrier" }
multiplier = 1
if_frequency = 0
"""
    content = {
        "raw": IQ,
        "rx": RX,
        "los": np.array([1, 0], np.int8),
        "agc": np.array([3.0, 7.0]),
        "b2b": B2B.transpose(1, 2, 0),
    }
    found, b2b = opened(content, layout, {"raw@tx": TX, "lsb": [5e-7], "loss": 61.5, "carrier": 140e9})
    assert [(r.name, r.los, r.scale_factor) for r in found] == [("P0", 1, 5e-7), ("P1", 0, 5e-7)]
    assert [np.unique(r.agc_gain).tolist() for r in found] == [[3], [7]]
    assert {r.sounder.carrier.frequency for r in found} == {140e9}
    assert np.array_equal([r.rx_position for r in found], RX)
    assert np.array_equal(found[1].tx_position, TX)
    assert isinstance(b2b, BackToBack)
    assert np.array_equal(b2b.captures, B2B)
    assert (b2b.attenuation, b2b.scale_factor, b2b.includes_tx_antenna) == (61.5, 3e-7, True)
    assert b2b.sounder.carrier.frequency == 140e9


def test_one_direction_one_position_no_snapshots(opened, sounder):
    layout = (
        PLAIN.replace(toml(ORDER), '["sample", "iq"]').replace("[10, 100, 190, 280]", "100").replace("[-9, 0, 9]", "0")
    )
    layout = layout.replace("rx = [[31, -46, 1.4], [32, -50, 1.5]]", "rx = [31, -46, 1.4]")
    with pytest.raises(DataError, match=r"grid\.azimuth"):
        opened({"raw": IQ[0, 1, 1, 0]}, layout)
    found, _ = opened({"raw": IQ[0, 1, 1, 0]}, layout.replace("= 100\n", "= [100]\n").replace("= 0\n", "= [0]\n"))
    assert np.array_equal(found[0].captures(0, 0), IQ[0, 1, 1, :1])
    assert len(found[0].missing) == 11


@pytest.mark.parametrize("version", [5, 7.3])
@pytest.mark.parametrize("positions", [1, 2])
def test_matlab(opened, tmp_path, version, positions):
    # as MATLAB shows it: size(rec.i) = [254 3 4 3 positions], tx 1 x 3, rx positions x 3, grids as rows
    shown = IQ[:positions].transpose(5, 4, 3, 1, 2, 0)  # iq, sample, snapshot, azimuth, elevation, position
    path = tmp_path / "rec.mat"
    rx, tx = RX[:positions], TX[None]
    if version == 5:
        rec = {"i": shown[0], "q": shown[1], "az": np.array([AZIMUTH]), "el": np.array([ELEVATION]), "tx": tx, "rx": rx}
        savemat(path, {"rec": rec, "lsb": 2e-7, "b2b": B2B @ np.array([1, 1j])})
        axes = ("sample", "snapshot", "azimuth", "elevation", "position")
    else:  # HDF5 shows all axes reversed, and complex numbers as records
        b2b = np.zeros((SAMPLES, 5), [("real", "<f8"), ("imag", "<f8")])
        b2b["real"], b2b["imag"] = B2B[..., 0].T, B2B[..., 1].T
        content = {"i": shown[0].T, "q": shown[1].T, "az": np.array([AZIMUTH]).T, "el": np.array([ELEVATION]).T}
        with h5py.File(path, "w") as file:
            for name, data in {**content, "tx": tx.T, "rx": rx.T}.items():
                file[f"rec/{name}"] = data
                file[f"rec/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
            file["lsb"], file["b2b"] = np.array([[2e-7]]), b2b
        axes = ("position", "elevation", "azimuth", "snapshot", "sample")
    layout = f"""
scale_factor = {{ dataset = "lsb" }}
[captures]
dataset = "rec/i"
imaginary = "rec/q"
axes = {toml(axes)}
[grid]
azimuth = {{ dataset = "rec/az" }}
elevation = {{ dataset = "rec/el" }}
[positions]
tx = {{ dataset = "rec/tx" }}
rx = {{ dataset = "rec/rx" }}
[back_to_back]
dataset = "b2b"
axes = {toml(("snapshot", "sample") if version == 5 else ("sample", "snapshot"))}
attenuation = 60
"""
    found, b2b = opened(path, layout)
    assert len(found) == positions
    for p, recording in enumerate(found):
        assert recording.scale_factor == 2e-7
        assert np.array_equal(recording.rx_position, RX[p])
        assert np.array_equal(recording.tx_position, TX)
        for a, e in np.ndindex(4, 3):
            assert np.array_equal(recording.captures(a, e), IQ[p, a, e])
    assert np.array_equal(b2b.captures, B2B @ np.array([1, 1j]))


def test_three_positions_of_matlab_are_not_transposed(opened):
    # 3 x 3 can be read both ways; MATLAB users keep a position a row
    rx = np.arange(9.0).reshape(3, 3)
    layout = PLAIN.replace("rx = [[31, -46, 1.4], [32, -50, 1.5]]", 'rx = { dataset = "rx" }')
    content = {"raw": IQ[[0, 1, 0]], "rx": rx}
    assert np.array_equal([r.rx_position for r in opened(content, layout)[0]], rx)
    found, _ = opened({**content, "rx": rx.T}, layout, {"rx@MATLAB_class": "double"})
    assert np.array_equal([r.rx_position for r in found], rx)


def test_opening_reads_no_sample_and_one_file_serves_all_positions(opened, monkeypatch):
    reads, opens = [], []
    getitem, init = h5py.Dataset.__getitem__, h5py.File.__init__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda self, at: (reads.append(self.name), getitem(self, at))[1])
    monkeypatch.setattr(h5py.File, "__init__", lambda self, *a, **k: init(self, *a, **k) or opens.append(a[0]))
    found, _ = opened({"raw": IQ}, PLAIN)
    assert reads == []
    opens.clear()
    for recording in found:
        recording.captures(0, 0)
    assert reads == ["/raw", "/raw"]
    assert sum(isinstance(name, Path) for name in opens) == 1


def test_a_position_that_cannot_be_used_leaves_the_others(opened):
    found, _ = opened({"raw": IQ}, PLAIN.replace("[32, -50, 1.5]", "[0, 0, 28.4]"))
    assert isinstance(found[0], Recording)
    assert "foreign-01: tx_position equals rx_position" in str(found[1])
    layout = PLAIN.replace("rx = [[31, -46, 1.4], [32, -50, 1.5]]", 'rx = { dataset = "rx" }')
    found, _ = opened({"raw": IQ, "rx": [[np.nan, 0, 0], [1, 2, 3]]}, layout)
    assert "foreign-00: rx_position is [nan, 0.0, 0.0]; expected three finite metres" in str(found[0])
    assert isinstance(found[1], Recording)


def test_damaged_samples_are_told_when_they_are_read(tmp_path, opened):
    path = tmp_path / "damaged.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("raw", data=IQ, chunks=(1, *IQ.shape[1:]), fletcher32=True)
        start = file["raw"].id.get_chunk_info(1).byte_offset
    with path.open("r+b") as raw:
        raw.seek(start + 8)
        raw.write(bytes(range(8)))
    found, _ = opened(path, PLAIN)
    assert np.array_equal(found[0].captures(0, 0), IQ[0, 0, 0])
    with pytest.raises(DataError, match=r"damaged\.h5: raw cannot be read"):
        found[1].captures(0, 0)


def change(old: str, new: str) -> str:
    assert old in PLAIN
    return PLAIN.replace(old, new)


@pytest.mark.parametrize(
    ("layout", "told"),
    [
        (change('"raw"', '"samples"'), "no dataset samples; the layout names it"),
        (change('"raw"', '"group"'), "no dataset group; the layout names it"),
        (change("2e-7", '{ attribute = "lsb" }'), "no attribute lsb; the layout names it"),
        (change("2e-7", '{ dataset = "text" }'), "scale_factor: text holds no real numbers"),
        (change("2e-7", '{ dataset = "wrong" }'), "scale_factor is an array (5,); expected one finite number"),
        (change("2e-7", "0.0"), "scale_factor is 0; expected a positive number"),
        (change(', "iq"', ""), "raw has 6 axes (2, 4, 3, 3, 254, 2); the layout names 5"),
        (change('"sample", "iq"', '"iq", "sample"'), "axis iq of raw has length 254; expected 2 (I, Q)"),
        (
            change("[10, 100, 190, 280]", "[10, 100, 190]"),
            "4 captures along azimuth, but the grid has 3 values",
        ),
        (change("[10, 100, 190, 280]", "[10, 100, 190, 370]"), "the grid names a direction twice"),
        (change("[10, 100, 190, 280]", '{ dataset = "nan" }'), "grid.azimuth is [0.0, nan, 0.0, 0.0]; expected"),
        (change("[-9, 0, 9]", "[81, 90, 99]"), "grid.elevation leaves -90..90 degree above the horizon"),
        (change(", [32, -50, 1.5]", ""), None),
        (
            change("[32, -50, 1.5]", "[32, -50, 1.5], [1, 2, 3]"),
            "positions.rx has shape (3, 3); expected (3,) or (2, 3)",
        ),
        (
            change("[positions]", "[positions]\nlos = 5"),
            "positions.los is 5; expected 1 (line of sight), 0 (none) or -1",
        ),
        (
            change("[positions]", '[positions]\nlos = { dataset = "wrong" }'),
            "positions.los has shape (5,); expected one number or 2",
        ),
        (
            'agc_gain = { dataset = "wrong" }' + PLAIN,
            "agc_gain has shape (5,); expected one number, one a position, or (2, 4, 3) along the captures' axes",
        ),
        (
            'time = { dataset = "agc_nan" }' + PLAIN,
            "time holds values that are not finite",
        ),
        (
            PLAIN + "[sounder.waveform]\norder = 8\n",
            "the layout's [sounder]: waveform: polynomial is [7, 1, 0]; expected falling exponents from 8",
        ),
        (PLAIN + "[sounder.waveform]\nchirp = 8\n", "the layout's [sounder]: waveform.chirp: unknown key"),
        (PLAIN + '[sounder.carrier]\nfrequency = { of = "raw" }\n', "frequency: a reference names either a dataset or"),
        (PLAIN + '[back_to_back]\ndataset = "b"\naxes = ["sample"]\nattenuation = 60\n', "no dataset b;"),
        (
            PLAIN + '[back_to_back]\ndataset = "wrong"\naxes = ["sample"]\nattenuation = 60\n',
            "wrong is float64; real numbers need the axis iq or a dataset named as imaginary, complex ones neither",
        ),
    ],
)
def test_a_file_that_is_not_as_the_layout_says_is_told_in_one_line(opened, layout, told):
    content = {"raw": IQ, "group/x": 1, "text": "abc", "wrong": np.zeros(5), "nan": [0, np.nan, 0, 0]}
    content["agc_nan"] = np.full((2, 4, 3), np.nan)
    if told is None:  # one point serves all positions
        assert len(opened(content, layout)[0]) == POSITIONS
        return
    with pytest.raises(DataError) as error:
        opened(content, layout)
    assert told in str(error.value)
    assert "foreign.h5: " in str(error.value)
    assert "\n" not in str(error.value)


def test_samples_that_do_not_fit_the_description_are_told(opened):
    found, _ = opened({"raw": IQ[..., :250, :]}, PLAIN)
    assert all("250 samples a capture, but 132 GHz rotating-horn sounder describes 254" in str(r) for r in found)


@pytest.mark.parametrize(
    ("layout", "told"),
    [
        (change("[grid]", "[grid]\ncolour = 1"), "grid.colour: unknown key"),
        (change('"iq"]', '"iq", "iq"]'), "captures: axes names one axis twice"),
        (change('"sample"', '"samples"'), "captures.axes.4: "),
        (change('"sample", ', ""), "captures: axes does not name sample"),
        (change('"position"', '"direction"'), "captures: axes names direction as well as azimuth or elevation"),
        (
            change('"raw"', '"raw"\nimaginary = "q"'),
            "captures: axes names iq, but I and Q stand in datasets of their own",
        ),
        (change("2e-7", "{}"), "a reference names either a dataset or an attribute"),
        (change("2e-7", "nan"), "scale_factor"),
        (change("tx = [0, 0, 28.4]\n", ""), "positions.tx: missing"),
        (change("[positions]", '[positions]\nname = "RX{place}"'), "positions: name is"),
        (
            PLAIN + '[back_to_back]\ndataset = "b"\naxes = ["azimuth", "sample"]\nattenuation = 60\n',
            "back_to_back: axes of the back-to-back names azimuth",
        ),
        ("captures = ", "not TOML"),
    ],
)
def test_a_layout_that_is_none_is_told_in_one_line(tmp_path, layout, told):
    path = tmp_path / "layout.toml"
    path.write_text(layout, encoding="utf-8")
    with pytest.raises(DataError) as error:
        layouts.load(path)
    assert str(error.value).startswith(f"{path}: ")
    assert told in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content"), [("x.mat", b"not MATLAB at all"), ("x.dat", b"something"), ("y.mat", None)]
)
def test_files_that_are_none_are_told(tmp_path, sounder, name, content):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    (tmp_path / "layout.toml").write_text(PLAIN, encoding="utf-8")
    with pytest.raises(DataError, match=r"not a MATLAB file|not an HDF5 file|no such file"):
        foreign.recordings(path, layouts.load(tmp_path / "layout.toml"), sounder)


def test_a_damaged_matlab_file_is_told(tmp_path, sounder):
    path = tmp_path / "cut.mat"
    savemat(path, {"raw": IQ}, do_compression=True)
    path.write_bytes(path.read_bytes()[:2000])
    (tmp_path / "layout.toml").write_text(PLAIN, encoding="utf-8")
    with pytest.raises(DataError, match="not a MATLAB file, or a damaged one"):
        foreign.recordings(path, layouts.load(tmp_path / "layout.toml"), sounder)


def test_the_shipped_layout_reads_a_ray_tracers_file(shared_data: Path, sounder, description):
    plan = layouts.load(Path(__file__).parents[2] / "examples" / "layouts" / "raytraced.toml")
    path = shared_data / "raytraced" / "canyon_raw.h5"
    found = foreign.recordings(path, plan, description())
    assert len(found) == 20
    with h5py.File(path) as file:
        for p, recording in enumerate(found):
            assert isinstance(recording, Recording)
            assert recording.missing == []
            assert recording.los == file["rx_los"][p]
            assert np.array_equal(recording.rx_position, file["rx_position"][p])
        # azimuths stand in the second place of the grid's axes there, after the elevations
        assert np.array_equal(found[7].captures(5, 2), file["raw"][7, 2, 5])
    assert found[0].sounder.carrier.frequency == 132e9
    b2b = foreign.back_to_back(path, plan, description())
    assert b2b is not None
    assert b2b.captures.shape == (64, 1022, 2)
