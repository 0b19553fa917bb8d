"""A layout reads the same recordings from any form in which a foreign file stores captures."""

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.recordings.recording import BackToBack

from .captures import AGC, AZIMUTH, B2B, ELEVATION, IQ, ORDER, PLAIN, POSITIONS, RX, TIME, TX, assert_same, toml


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
[sounder]
name = { attribute = "instrument" }
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
    found, b2b = opened(
        content, layout, {"raw@tx": TX, "lsb": [5e-7], "loss": 61.5, "carrier": 140e9, "instrument": "D-band"}
    )
    assert [(r.name, r.los, r.scale_factor) for r in found] == [("P0", 1, 5e-7), ("P1", 0, 5e-7)]
    assert [np.unique(r.agc_gain).tolist() for r in found] == [[3], [7]]
    assert {(r.sounder.name, r.sounder.carrier.frequency) for r in found} == {("D-band", 140e9)}
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


def test_links_of_antennas_at_several_places(opened):
    """Two transmit and three receive antennas, and grids by their ends: each link is a position."""
    data = np.stack([IQ, IQ[::-1], IQ + 1])[:, :, :, :, :1]  # tx is along the second axis
    layout = PLAIN.replace('"position", "azimuth"', '"rx", "tx", "azimuth"')
    layout = layout.replace("[-9, 0, 9]", "{ start = -9, stop = 9, points = 3 }")
    layout = layout.replace("tx = [0, 0, 28.4]", "tx = [[0, 0, 28.4], [1, 0, 28.4]]")
    layout = layout.replace("rx = [[31, -46, 1.4], ", "rx = [[31, -46, 1.4], [30, -46, 1.4], ")
    found, _ = opened({"raw": data}, layout)
    assert [recording.name for recording in found] == [f"foreign-{k:02d}" for k in range(6)]
    for number, recording in enumerate(found):
        tx, rx = divmod(number, 3)
        assert recording.tx_position[0] == tx
        assert recording.rx_position[0] == [31, 30, 32][rx]
        assert np.array_equal(recording.captures(2, 1), data[rx, tx, 2, 1])
