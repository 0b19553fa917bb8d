"""`sounder simulate` and `sounder process`: from a scene to products, the same bytes every time."""

import hashlib
import json
import subprocess
import sys

import h5py
import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from erm.maps.formats import read_map

from .commands import digest, group, names, run


def test_simulate_writes_recordings_and_truth(campaign):
    assert names(campaign / "raw") == ["RX1.h5", "RX2.h5"]
    assert names(campaign / "truth") == ["environment.geojson", "paths.h5"]
    paths = group(campaign / "truth" / "paths.h5", "/")
    environment = read_map(campaign / "truth" / "environment.geojson")
    assert environment.reflectors.attrs["history"] == paths.attrs["history"] == "sounder simulate room"
    # the direct path and four walls
    assert [int((paths["position"] == name).sum()) for name in ("RX1", "RX2")] == [5, 5]


@pytest.mark.slow
def test_the_direct_path_is_found_where_it_is(campaign, products):
    for name, rx in (("RX1", (12, 3, 1.5)), ("RX2", (14, 6, 1.5))):
        toward = np.array((4, 5, 3)) - rx
        mpc = group(products / f"{name}.h5", "/mpc").isel(mpc=0)
        # 40 dB of SNR give picoseconds and tenths of a degree; images, drifts and the walls' paths add their share
        assert mpc["delay"].item() == pytest.approx(np.linalg.norm(toward) / c, abs=0.1e-9)
        assert mpc["azimuth"].item() == pytest.approx(np.degrees(np.arctan2(toward[1], toward[0])) % 360, abs=1.5)
        gain = 20 * np.log10(c / 132e9 / (4 * np.pi * np.linalg.norm(toward)))
        assert mpc["path_gain"].item() == pytest.approx(gain, abs=1.0)


@pytest.mark.slow
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
    extraction = {"threshold": "cfar", "method": "sage"}
    others = {"averaging": "coherent", "omnidirectional": "synthesis", "keep_cir": True, "trust_all": False}
    assert options == {**extraction, **others}
    grid = {"azimuth": 12, "elevation": 2}
    assert dict(daps["daps"].sizes) == dict(cir["cir"].sizes) == {**grid, "delay": 254}
    assert dict(daps["noise_floor"].sizes) == dict(daps["pas"].sizes) == grid
    assert dict(daps["pdp"].sizes) == {"delay": 254}
    assert cir["cir"].dtype == np.complex64
    columns = ("delay", "azimuth", "elevation", "path_gain")
    for name in (*columns, *(f"{name}_std" for name in columns)):
        assert mpc[name].dims == ("mpc",)
    units = {"delay": "s", "clock": "s", "azimuth": "degree", "elevation": "degree"}
    units |= {"gain_slope": "dB degree-1", "gain_curvature": "dB degree-2"}
    expected = {"daps": "dB", "noise_floor": "dB", "pdp": "dB", "pas": "dB", "path_gain": "dB", "snr": "dB"}
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


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes_and_leaves_its_inputs(campaign, products, tmp_path):
    before = digest(campaign / "raw")
    raw = campaign / "raw"
    arguments = ("process", raw / "RX1.h5", raw / "RX2.h5", "--calibration", campaign / "back-to-back.h5", "--keep-cir")
    assert run(*arguments, "--out", tmp_path / "again", "--threads", 1) == 0
    assert digest(tmp_path / "again") == {n: d for n, d in digest(products).items() if n.endswith(".h5")}
    assert digest(raw) == before
    assert run("simulate", campaign / "scene.toml", "--out", tmp_path / "simulated") == 0
    assert digest(tmp_path / "simulated" / "raw") == before


@pytest.mark.slow
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
    chosen = {"averaging": averaging, "threshold": "nyu", "method": "peaks", "omnidirectional": "maximum"}
    assert run(*arguments, *(part for name, value in chosen.items() for part in (f"--{name}", value))) == 0
    options = json.loads(group(tmp_path / "RX1.h5", "/").attrs["processing_options"])
    assert options == {**chosen, "keep_cir": False, "trust_all": False}
    with h5py.File(tmp_path / "RX1.h5") as file:
        assert "cir" not in file


@pytest.mark.slow
def test_a_foreign_file_gives_the_same_mpcs(products, joined, tmp_path, capsys):
    layout = ("--layout", joined.with_name("layout.toml"), "--sounder", products.parent / "sounder.toml")
    assert run("process", joined, *layout, "--out", tmp_path / "out") == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert printed.out == f"{tmp_path / 'out'}: 2 products\n"
    for i in (1, 2):
        ours, theirs = group(products / f"RX{i}.h5", "/mpc"), group(tmp_path / "out" / f"P{i - 1}.h5", "/mpc")
        xr.testing.assert_identical(ours, theirs)


@pytest.mark.slow
def test_in_a_pipe_there_is_the_result_alone(copied):
    command = ["process", copied / "RX1.h5", "--calibration", copied / "back-to-back.h5", "--out", copied / "out"]
    done = subprocess.run(
        [sys.executable, "-m", "sounder", *map(str, command)], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert done.stdout == f"{copied / 'out'}: 1 product\n"
    assert done.returncode == 0


SIGNATURES = """
import sys
from sounder.cli import main
try:
    main()
except SystemExit as stop:
    assert not stop.code, stop.code
seen = 0
for name in [name for name in sys.modules if name.startswith("sounder.kernels.")]:
    for function in vars(sys.modules[name]).values():
        if hasattr(function, "signatures") and not isinstance(function, type):
            assert len(function.signatures) <= 1, (function, function.signatures)
            seen += len(function.signatures)
assert seen > 2, seen
"""


@pytest.mark.slow
def test_a_run_has_no_kernel_compiled_twice(campaign, tmp_path):
    """Files are mapped read-only and a back-to-back is read into memory; the kernels must not see the difference."""
    arguments = ("process", campaign / "raw" / "RX1.h5", "--calibration", campaign / "back-to-back.h5")
    command = [sys.executable, "-W", "error", "-c", SIGNATURES, *map(str, arguments), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


IMPORTS = """
import sys
from sounder.cli import main
try:
    main()
finally:
    assert "numba" in sys.modules and "xarray" in sys.modules
    assert not {"distributed", "matplotlib"} & set(sys.modules)
"""


@pytest.mark.slow
def test_nothing_is_imported_that_no_product_needs(campaign, tmp_path):
    arguments = ("process", campaign / "raw" / "RX1.h5", "--calibration", campaign / "back-to-back.h5")
    command = [sys.executable, "-W", "error", "-c", IMPORTS, *map(str, arguments), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
