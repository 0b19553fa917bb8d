"""Two positions of random captures, and the plain layout of a file that holds them."""

import numpy as np

from erm.common.errors import DataError
from sounder.recordings.recording import Recording

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


def change(old: str, new: str) -> str:
    assert old in PLAIN
    return PLAIN.replace(old, new)
