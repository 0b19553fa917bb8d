"""The command line: from a scene to figures, exit codes, one line an error, the rest of a batch done."""

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from sounder import cli

SOUNDER = """
name = "small sounder"
[waveform]
order = 7
polynomial = [7, 1, 0]
chip_rate = 600e6
samples_per_chip = 2
sample_rate = 1.2e9
[carrier]
frequency = 132e9
lo_frequency = 21e9
multiplier = 6
if_frequency = 6e9
[tx_antenna]
gain = 20
pattern = "flat"
[rx_antenna]
gain = 15
hpbw_azimuth = 30
hpbw_elevation = 30
[scan]
azimuth = [0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330]
elevation = [-15, 15]
[transmitter]
power = 10
"""
SCENE = """
name = "room"
sounder = "sounder.toml"
attenuator = 60.0
snapshots = 2
max_order = 1
[transmitters]
TX = [4, 5, 3]
[[receivers]]
name = "RX1"
tx = "TX"
position = [12, 3, 1.5]
[[receivers]]
name = "RX2"
tx = "TX"
position = [14, 6, 1.5]
[[environment.walls]]
points = [[0, 0], [20, 0], [20, 10], [0, 10]]
closed = true
material = "metal"
"""
GRID = '[grid]\nazimuth = { dataset = "azimuth" }\nelevation = { dataset = "elevation" }\n'
LAYOUT = f"""
scale_factor = {{ attribute = "scale_factor", of = "iq" }}
agc_gain = {{ dataset = "agc_gain" }}
[captures]
dataset = "iq"
axes = ["position", "azimuth", "elevation", "snapshot", "sample", "iq"]
{GRID}
[positions]
tx = {{ dataset = "tx_position" }}
rx = {{ dataset = "rx_position" }}
name = "P{{}}"
[back_to_back]
dataset = "b2b"
axes = ["snapshot", "sample", "iq"]
attenuation = 60
scale_factor = {{ attribute = "scale_factor", of = "b2b" }}
"""


def run(*arguments: object) -> int:
    """Run the command in this process as a shell would."""
    old, sys.argv = sys.argv, ["sounder", *map(str, arguments)]
    try:
        with pytest.raises(SystemExit) as stop:
            cli.main()
    finally:
        sys.argv = old
    return int(stop.value.code or 0)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> Path:
    """Folder with a simulated scene: ``raw/RX1.h5``, ``raw/RX2.h5``, ``back-to-back.h5`` and ``truth``."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "sounder.toml").write_text(SOUNDER, encoding="utf-8")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert run("simulate", folder / "scene.toml", "--out", folder) == 0
    return folder


@pytest.fixture(scope="module")
def products(campaign: Path) -> Path:
    raw = campaign / "raw"
    arguments = ("process", raw / "RX1.h5", raw / "RX2.h5", "--calibration", campaign / "back-to-back.h5")
    assert run(*arguments, "--keep-cir", "--out", campaign / "products") == 0
    return campaign / "products"


@pytest.fixture
def copied(campaign: Path, tmp_path: Path) -> Path:
    """Copy of the recordings that a test may spoil."""
    for name in ("raw/RX1.h5", "raw/RX2.h5", "back-to-back.h5"):
        shutil.copy(campaign / name, tmp_path)
    return tmp_path


@pytest.fixture
def joined(campaign: Path, tmp_path: Path) -> Path:
    """Both positions and the back-to-back in one foreign file, its layout beside it."""
    (tmp_path / "layout.toml").write_text(LAYOUT, encoding="utf-8")
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        parts = [h5py.File(campaign / "raw" / f"RX{i}.h5") for i in (1, 2)]
        for name in ("iq", "agc_gain"):
            file[name] = np.stack([part[name][()] for part in parts])
        for name in ("tx_position", "rx_position"):
            file[name] = np.concatenate([part[name][()] for part in parts])
        for name in ("azimuth", "elevation"):
            file[name] = parts[0][name][()]
        file["iq"].attrs["scale_factor"] = parts[0]["iq"].attrs["scale_factor"]
        with h5py.File(campaign / "back-to-back.h5") as b2b:
            file["b2b"] = b2b["iq"][()]
            file["b2b"].attrs["scale_factor"] = b2b["iq"].attrs["scale_factor"]
        for part in parts:
            part.close()
    return tmp_path / "foreign.h5"


def digest(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def group(path: Path, name: str) -> xr.Dataset:
    with xr.open_dataset(path, group=name, engine="h5netcdf") as dataset:
        return dataset.load()


def test_simulate_writes_recordings_and_truth(campaign):
    assert names(campaign / "raw") == ["RX1.h5", "RX2.h5"]
    assert names(campaign / "truth") == ["environment.geojson", "paths.h5"]
    paths = group(campaign / "truth" / "paths.h5", "/")
    # the direct path and four walls
    assert [int((paths["position"] == name).sum()) for name in ("RX1", "RX2")] == [5, 5]


def test_the_direct_path_is_found_where_it_is(campaign, products):
    for name, rx in (("RX1", (12, 3, 1.5)), ("RX2", (14, 6, 1.5))):
        toward = np.array((4, 5, 3)) - rx
        mpc = group(products / f"{name}.h5", "/mpc").isel(mpc=0)
        # 40 dB of SNR give picoseconds and tenths of a degree; images, drifts and the walls' paths add their share
        assert mpc["delay"].item() == pytest.approx(np.linalg.norm(toward) / c, abs=0.1e-9)
        assert mpc["azimuth"].item() == pytest.approx(np.degrees(np.arctan2(toward[1], toward[0])) % 360, abs=1.5)
        gain = 20 * np.log10(c / 132e9 / (4 * np.pi * np.linalg.norm(toward)))
        assert mpc["path_gain"].item() == pytest.approx(gain, abs=1.0)


def test_a_product_is_as_its_schema_says(campaign, products):
    path = products / "RX1.h5"
    root, daps, mpc, cir = (group(path, name) for name in ("/", "/daps", "/mpc", "/cir"))
    assert root["tx_position"].dims == root["rx_position"].dims == ("position", "xyz")
    assert root["position"].values.tolist() == ["RX1"]
    assert root["rx_position"].values.tolist() == [[12, 3, 1.5]]
    assert root.attrs["frequency"] == 132e9
    assert root.attrs["los"] == 1
    for name in ("Conventions", "title", "source", "history", "software_version"):
        assert root.attrs[name], name
    assert json.loads(root.attrs["input_sha256"]) == {
        "RX1.h5": hashlib.sha256((campaign / "raw" / "RX1.h5").read_bytes()).hexdigest(),
        "back-to-back.h5": hashlib.sha256((campaign / "back-to-back.h5").read_bytes()).hexdigest(),
    }
    options = json.loads(root.attrs["processing_options"])
    assert options == {"averaging": "coherent", "threshold": "usc", "omnidirectional": "sum", "keep_cir": True}
    grid = {"azimuth": 12, "elevation": 2}
    assert dict(daps["daps"].sizes) == dict(cir["cir"].sizes) == {**grid, "delay": 254}
    assert dict(daps["noise_floor"].sizes) == dict(daps["pas"].sizes) == grid
    assert dict(daps["pdp"].sizes) == {"delay": 254}
    assert cir["cir"].dtype == np.complex64
    columns = ("delay", "azimuth", "elevation", "path_gain")
    for name in (*columns, *(f"{name}_std" for name in columns)):
        assert mpc[name].dims == ("mpc",)
    units = {"delay": "s", "azimuth": "degree", "elevation": "degree"}
    expected = {"daps": "dB", "noise_floor": "dB", "pdp": "dB", "pas": "dB", "path_gain": "dB"}
    for dataset in (root, daps, mpc):
        for name, variable in dataset.variables.items():
            if variable.dtype.kind == "f":
                key = str(name).removesuffix("_std")
                assert variable.attrs["long_name"], name
                assert "standard_name" not in variable.attrs
                wanted = units.get(key) or expected.get(key) or ("m" if key.endswith("position") else "1")
                assert variable.attrs["units"] == wanted, name
    # DAPS is the CIR in dB, to the precision of single floats
    assert daps["daps"].values == pytest.approx(20 * np.log10(np.abs(cir["cir"].values)), abs=1e-4)


def test_the_same_command_gives_the_same_bytes_and_leaves_its_inputs(campaign, products, tmp_path):
    before = digest(campaign / "raw")
    raw = campaign / "raw"
    arguments = ("process", raw / "RX1.h5", raw / "RX2.h5", "--calibration", campaign / "back-to-back.h5", "--keep-cir")
    assert run(*arguments, "--out", tmp_path / "again", "--threads", 1) == 0
    assert digest(tmp_path / "again") == {n: d for n, d in digest(products).items() if n.endswith(".h5")}
    assert digest(raw) == before
    assert run("simulate", campaign / "scene.toml", "--out", tmp_path / "simulated") == 0
    assert digest(tmp_path / "simulated" / "raw") == before


@pytest.mark.parametrize("averaging", ["phase-aligned", "power"])
def test_options_are_stored(campaign, tmp_path, averaging):
    arguments = (
        "process",
        campaign / "raw" / "RX1.h5",
        "--calibration",
        campaign / "back-to-back.h5",
        "--out",
        tmp_path,
    )
    assert run(*arguments, "--averaging", averaging, "--threshold", "nyu", "--omnidirectional", "maximum") == 0
    options = json.loads(group(tmp_path / "RX1.h5", "/").attrs["processing_options"])
    assert options == {"averaging": averaging, "threshold": "nyu", "omnidirectional": "maximum", "keep_cir": False}
    with h5py.File(tmp_path / "RX1.h5") as file:
        assert "cir" not in file


def test_a_foreign_file_gives_the_same_mpcs(products, joined, tmp_path, capsys):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", products.parent / "sounder.toml")
    assert run("process", joined, *layout, "--out", tmp_path / "out") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out == f"{tmp_path / 'out'}: 2 products\n"
    for i in (1, 2):
        ours, theirs = group(products / f"RX{i}.h5", "/mpc"), group(tmp_path / "out" / f"P{i - 1}.h5", "/mpc")
        xr.testing.assert_identical(ours, theirs)


def test_convert_makes_native_recordings_of_a_foreign_file(campaign, products, joined, tmp_path):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml")
    assert run("convert", joined, *layout, "--out", tmp_path / "native") == 0
    assert names(tmp_path / "native") == ["P0.h5", "P1.h5", "back-to-back.h5"]
    native = tmp_path / "native"
    assert run("process", native / "P1.h5", "--calibration", native / "back-to-back.h5", "--out", tmp_path / "out") == 0
    xr.testing.assert_identical(group(products / "RX2.h5", "/mpc"), group(tmp_path / "out" / "P1.h5", "/mpc"))
    # one native recording to another, byte by byte but for its history
    assert run("convert", campaign / "raw" / "RX1.h5", "--out", tmp_path / "one.h5") == 0
    with h5py.File(tmp_path / "one.h5") as one, h5py.File(campaign / "raw" / "RX1.h5") as other:
        assert one.keys() == other.keys()
        for name in one:
            assert np.array_equal(one[name][()], other[name][()])


def test_convert_refuses_many_positions_in_one_file(campaign, joined, tmp_path, capsys):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml")
    assert run("convert", joined, *layout, "--out", tmp_path / "one.h5") == 1
    assert "holds 2 positions and more; pass a folder as --out" in capsys.readouterr().err
    assert not (tmp_path / "one.h5").exists()


def facts(capsys) -> dict[str, str]:
    return dict(line.split("\t", 1) for line in capsys.readouterr().out.splitlines())


def test_info_tells_of_a_recording(campaign, capsys):
    assert run("info", campaign / "raw" / "RX1.h5") == 0
    told = facts(capsys)
    assert told["kind"] == "raw recording"
    assert told["position"] == "RX1"
    assert told["line of sight"] == "yes"
    assert told["sounder"] == "small sounder, 132 GHz"
    assert told["waveform"] == "order 7, 254 samples at 1.2 GS/s, 211.67 ns"
    assert told["directions"] == "12 azimuths x 2 elevations"
    assert told["RX position"] == "12.00, 3.00, 1.50 m"
    assert told["health"] == "no direction missing, none zero, none clipped"
    # 10 dBm + 20 dBi + 15 dBi, the horn up to 15 degrees off (3 dB at most), 8.4 m of free space; the walls add little
    direct = 45 + 20 * np.log10(c / 132e9 / (4 * np.pi * np.sqrt(8**2 + 2**2 + 1.5**2)))
    highest = float(told["received power"].split(" to ")[1].split(" dBm")[0])
    assert direct - 6 < highest < direct + 1


def test_info_tells_of_back_to_back_and_product(campaign, products, capsys):
    assert run("info", campaign / "back-to-back.h5") == 0
    told = facts(capsys)
    assert told["kind"] == "back-to-back recording"
    assert told["attenuation"] == "60 dB (nominal)"
    assert told["sequence found"].startswith("order 7, polynomial [7, 1, 0] forward, ")
    assert run("info", products / "RX2.h5") == 0
    told = facts(capsys)
    assert told["kind"] == "product of sounder process"
    assert int(told["MPCs"]) == group(products / "RX2.h5", "/mpc").sizes["mpc"]
    assert "0 directions missing" in told["health"]


def test_info_tells_of_a_foreign_file(campaign, joined, capsys):
    assert run("info", joined, "--layout", joined.with_name("layout.toml"), "--sounder", campaign / "sounder.toml") == 0
    out = capsys.readouterr().out
    assert out.count("raw recording") == 2
    assert out.count("back-to-back recording") == 1


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_figures_of_every_product_and_of_two_together(products, tmp_path, suffix):
    both = products / "RX1.h5", products / "RX2.h5"
    assert run("figures", *both, "--overlay", "--out", tmp_path, "--format", suffix) == 0
    kinds = ("daps", "daps_polar", "pdp")
    expected = {f"RX{i}_{kind}.{suffix}" for i in (1, 2) for kind in kinds} | {f"RX1_RX2_daps_polar.{suffix}"}
    assert set(names(tmp_path)) == expected
    assert all(path.stat().st_size > 5000 for path in tmp_path.iterdir())


def test_figures_name_what_is_no_product_and_draw_the_rest(campaign, products, tmp_path, capsys):
    assert run("figures", campaign / "raw" / "RX1.h5", products / "RX1.h5", "--out", tmp_path) == 1
    error = capsys.readouterr().err
    assert str(campaign / "raw" / "RX1.h5") in error
    assert error.count("\n") == 1
    assert len(names(tmp_path)) == 3


def spoil(path: Path, what: str) -> None:
    with h5py.File(path, "r+") as file:
        iq = file["iq"]
        if what == "samples":
            data, scale = iq[..., :200, :], iq.attrs["scale_factor"]
            del file["iq"]
            file["iq"] = data
            file["iq"].attrs["scale_factor"] = scale
        elif what == "nan":
            file["rx_position"][0, 1] = np.nan
        elif what == "same":
            file["rx_position"][()] = file["tx_position"][()]
        elif what == "zero":
            iq[()] = 0
        elif what == "damaged":
            del file["iq"]


@pytest.mark.parametrize(
    ("what", "told"),
    [
        (
            "samples",
            "200 samples a capture, but small sounder describes 254 (order 7, 2 samples a chip); pass --sounder",
        ),
        ("nan", "RX1: rx_position is [12.0, nan, 1.5]; expected three finite metres"),
        ("same", "RX1: tx_position equals rx_position [4.0, 5.0, 3.0]; expected two places"),
        ("zero", "RX1: all samples are zero, in all directions; record the position again"),
        ("damaged", "no iq in the file"),
    ],
)
def test_a_bad_recording_is_named_and_the_rest_processed(copied, what, told, capsys):
    spoil(copied / "RX1.h5", what)
    out = copied / "out"
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", copied / "RX2.h5", "--calibration", b2b, "--out", out) == 1
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert line.startswith(str(copied / "RX1.h5"))
    assert told in line
    assert names(out) == ["RX2.h5"]
    assert printed.out == f"{out}: 1 products\n"


def test_what_is_no_recording_is_named(copied, capsys):
    text = copied / "text.h5"
    text.write_text("not HDF5")
    absent, b2b, out = copied / "absent.h5", copied / "back-to-back.h5", copied / "out"
    assert run("process", absent, text, b2b, copied / "RX2.h5", "--calibration", b2b, "--out", out) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"{absent}: no such file"
    assert [line.split(": ")[0] for line in lines] == [str(absent), str(text), str(b2b)]
    assert names(out) == ["RX2.h5"]


def test_directions_of_zeros_or_clipped_samples_are_named_one_by_one(copied, capsys):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file["iq"][2, 0] = 0
        file["iq"][7, 1, 0, :2] = [[-32768, 32767], [32767, 0]]
    b2b, out = copied / "back-to-back.h5", copied / "out"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", out) == 1
    zero, clipped = capsys.readouterr().err.splitlines()
    who = f"{copied / 'RX1.h5'}: RX1: "
    assert zero == f"{who}azimuth 60, elevation -15: all samples are zero; left out"
    # 3 of 2 x 254 x 2 numbers
    assert clipped == f"{who}azimuth 210, elevation 15: 0.3 % of the samples are clipped; lower the receiver gain"
    daps = group(out / "RX1.h5", "/daps")
    assert daps["daps"].sel(azimuth=60, elevation=-15).isnull().all()
    assert daps["daps"].isnull().sum() == 254
    assert group(out / "RX1.h5", "/").attrs["problem_directions"] == 2
    capsys.readouterr()
    assert run("info", copied / "RX1.h5") == 0
    assert facts(capsys)["health"] == "no direction missing, 1 all zero, 1 clipped"


def test_missing_directions_are_processed_and_noted(copied, capsys):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file["valid"][4:6] = 0
    out = copied / "out"
    assert run("process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", out) == 0
    (note,) = capsys.readouterr().err.splitlines()
    assert note == (
        f"note: {copied / 'RX1.h5'}: RX1: 4 of 24 directions missing: (azimuth, elevation) (120, -15), (150, -15), "
        "(120, 15) and 1 more; processed without them"
    )
    assert group(out / "RX1.h5", "/").attrs["missing_directions"] == 4
    assert group(out / "RX1.h5", "/mpc").sizes["mpc"] > 0
    assert run("info", copied / "RX1.h5") == 0
    assert facts(capsys)["health"].startswith("4 directions missing")


@pytest.mark.parametrize(
    ("replaced", "told"),
    [
        (("polynomial = [7, 1, 0]", "polynomial = [7, 3, 0]"), "does not stand out in it"),
        (("frequency = 132e9\nlo_frequency = 21e9", "frequency = 138e9\nlo_frequency = 22e9"), "carrier [Hz]"),
        (("order = 7\npolynomial = [7, 1, 0]", "order = 8\npolynomial = [8, 4, 3, 2, 0]"), "samples a capture"),
    ],
)
def test_the_back_to_back_of_another_sounder_is_refused(copied, campaign, replaced, told, capsys):
    other = copied / "other"
    other.mkdir()
    (other / "sounder.toml").write_text(SOUNDER.replace(*replaced), encoding="utf-8")
    (other / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert run("simulate", other / "scene.toml", "--out", other) == 0
    capsys.readouterr()
    b2b = other / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{b2b}: back-to-back of another sounder: ")
    assert told in line
    assert names(copied / "out") == []


def test_no_back_to_back_at_all_is_told(copied, capsys):
    assert run("process", copied / "RX1.h5", "--out", copied / "out") == 1
    assert capsys.readouterr().err == (f"{copied / 'RX1.h5'}: no back-to-back capture; pass one with --calibration\n")


def test_a_back_to_back_of_zeros_is_told(copied, capsys):
    with h5py.File(copied / "back-to-back.h5", "r+") as file:
        file["iq"][()] = 0
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "out") == 1
    assert capsys.readouterr().err == f"{b2b}: all back-to-back samples are zero; record it again\n"


def test_a_product_never_replaces_its_recording(copied, capsys):
    before = digest(copied)
    assert run("process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", copied) == 1
    assert "would replace an input; choose another --out" in capsys.readouterr().err
    assert digest(copied) == before
    assert run("convert", copied / "RX1.h5", "--out", copied / "RX1.h5") == 1
    assert digest(copied) == before


@pytest.mark.parametrize("name", ["back-to-back", "RX2"])
def test_a_product_never_replaces_another_input(copied, capsys, name):
    with h5py.File(copied / "RX1.h5", "r+") as file:
        file.attrs["position"] = name
    before = digest(copied)
    recordings = (copied / "RX1.h5", copied / "RX2.h5")
    assert run("process", *recordings, "--calibration", copied / "back-to-back.h5", "--out", copied) == 1
    assert f"position {name}: the output" in capsys.readouterr().err
    assert {key: value for key, value in digest(copied).items() if key in before} == before


def test_two_positions_of_one_name_are_told(copied, capsys):
    shutil.copy(copied / "RX1.h5", copied / "copy.h5")
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", copied / "copy.h5", "--calibration", b2b, "--out", copied / "out") == 1
    assert "RX1.h5 is already taken by" in capsys.readouterr().err
    assert names(copied / "out") == ["RX1.h5"]


def test_a_folder_that_cannot_be_written_is_told(copied, capsys):
    (copied / "file").write_text("in the way")
    b2b = copied / "back-to-back.h5"
    assert run("process", copied / "RX1.h5", "--calibration", b2b, "--out", copied / "file") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "cannot be written" in line


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["process"],
        ["process", "x.h5"],
        ["process", "x.h5", "--out", "y", "--averaging", "median"],
        ["process", "x.h5", "--out", "y", "--unknown"],
        ["figures", "x.h5", "--overlay", "--out", "y"],
        ["predict"],
    ],
)
def test_wrong_usage_is_2(arguments, capsys):
    assert run(*arguments) == 2


@pytest.mark.parametrize("command", ["info", "simulate", "convert"])
def test_a_missing_file_is_one_line_and_1(tmp_path, command, capsys):
    out = () if command == "info" else ("--out", tmp_path / "out")
    assert run(command, tmp_path / "absent", *out) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{tmp_path / 'absent'}: ")
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "content"),
    [("layout.toml", "captures = 1"), ("sounder.toml", "[waveform]\norder = 3"), ("layout.toml", None)],
)
def test_a_layout_or_description_that_is_none_stops_at_once(copied, name, content, capsys):
    if content:
        (copied / name).write_text(content, encoding="utf-8")
    option = "--" + name.removesuffix(".toml")
    assert run("process", copied / "RX1.h5", option, copied / name, "--out", copied / "out") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{copied / name}: ")
    assert names(copied / "out") == []


def test_in_a_pipe_there_is_the_result_alone(copied):
    command = ["process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", copied / "out"]
    done = subprocess.run(
        [sys.executable, "-m", "sounder.cli", *map(str, command)], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert done.stdout == f"{copied / 'out'}: 1 products\n"
    assert done.returncode == 0


def test_help_imports_nothing_heavy():
    program = (
        "import sys\n"
        "from sounder import cli\n"
        "sys.argv = ['sounder', 'process', '--help']\n"
        "try:\n    cli.main()\n"
        "except SystemExit as stop:\n    assert not stop.code\n"
        "print([m for m in ('numpy', 'xarray', 'numba', 'scipy', 'matplotlib', 'h5py') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
