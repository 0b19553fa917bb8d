"""MATLAB files, old and new, give the same recordings."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from erm.common.errors import DataError
from sounder.recordings import foreign
from sounder.recordings.layout import load_layout

from .captures import AZIMUTH, B2B, ELEVATION, IQ, PLAIN, RX, SAMPLES, TX, toml


@pytest.mark.parametrize("version", [5, 7.3])
@pytest.mark.parametrize("positions", [1, 2])
@pytest.mark.slow
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


@pytest.mark.slow
def test_a_damaged_matlab_file_is_reported(tmp_path, sounder):
    path = tmp_path / "cut.mat"
    savemat(path, {"raw": IQ}, do_compression=True)
    path.write_bytes(path.read_bytes()[:2000])
    (tmp_path / "layout.toml").write_text(PLAIN, encoding="utf-8")
    with pytest.raises(DataError, match="not a MATLAB file, or a damaged one"):
        foreign.recordings(path, load_layout(tmp_path / "layout.toml"), sounder)


@pytest.mark.parametrize("name", ["rec.mat", "REC.MAT"])
@pytest.mark.parametrize("version", [5, 7.3])
@pytest.mark.slow
def test_text_of_matlab_is_text(opened, tmp_path, version, name):
    layout = PLAIN + '[sounder]\nname = { dataset = "label" }\n'
    path = tmp_path / name
    if version == 5:
        savemat(path, {"raw": IQ, "label": "Hall sounder"})
    else:
        with h5py.File(path, "w") as file:
            file["raw"] = IQ
            file["label"] = np.array([[ord(letter)] for letter in "Hall sounder"], np.uint16)
            file["label"].attrs["MATLAB_class"] = np.bytes_(b"char")
    found, _ = opened(path, layout)
    assert {recording.sounder.name for recording in found} == {"Hall sounder"}


def test_an_empty_array_of_matlab_is_not_its_shape(opened):
    layout = PLAIN.replace("rx = [[31, -46, 1.4], [32, -50, 1.5]]", 'rx = { dataset = "rx" }')
    content = {"raw": IQ, "rx": np.array([2, 3], np.uint64)}
    with pytest.raises(DataError, match="rx is empty; expected values"):
        opened(content, layout, {"rx@MATLAB_class": "double", "rx@MATLAB_empty": 1})
