"""Failures of a position follow from the physics of propagation."""

import numpy as np
import pytest
import xarray as xr
from scipy.constants import c

from sounder.processing.remarks import over_free_space, remarks_on_cuts
from sounder.twin import receiver

LENGTH = 30.0


@pytest.mark.parametrize(
    ("excess", "std", "reported"),
    [
        ([-6.0, 0.0], [0.1, 0.1], False),
        ([-6.0, 2.9], [0.1, 0.0], False),
        ([-6.0, 3.3], [0.1, 0.1], True),
        ([5.5, -6.0], [0.5, 0.1], True),
        ([5.5, -6.0], [2.0, 0.1], False),  # beyond the fan, where the gain hangs on the elevation
        ([3.3, -6.0], [np.nan, 0.1], True),
        ([], [], False),
    ],
)
def test_a_gain_surely_over_free_space_is_a_failure(description, excess, std, reported):
    sounder = description()
    nothing = xr.Dataset({name: ("path", np.empty(0)) for name in ("delay", "azimuth", "elevation", "coefficient")})
    recording = receiver.record(
        nothing, sounder, name="P", tx_position=(0, 0, 1), rx_position=(LENGTH, 0, 1), snapshots=1
    )
    free_space = 20 * np.log10(c / sounder.carrier.frequency / (4 * np.pi * LENGTH))
    columns = {"delay": np.full(len(std), LENGTH / c), "path_gain": free_space + np.array(excess), "path_gain_std": std}
    mpc = xr.Dataset({name: ("mpc", np.array(values, float)) for name, values in columns.items()})
    remark = over_free_space(mpc, recording)
    assert (remark is not None) == reported
    assert remark is None or f"free space over 30.0 m allows {free_space:.1f} dB" in remark.meaning


@pytest.mark.parametrize(
    ("excess", "std", "reported"),
    [
        ([4.8, -30.0], [1.5, 0.1], True),  # the direct path, its receiver written 140 m off
        ([4.8, -10.0], [9.0, 0.1], False),  # perhaps not the strongest
        ([-0.5, -30.0], [0.1, 0.1], False),  # off metal, a period late
    ],
)
def test_the_strongest_path_before_the_direct_one_may_not_reach_free_space_a_period_later(
    description, excess, std, reported
):
    sounder = description()
    nothing = xr.Dataset({name: ("path", np.empty(0)) for name in ("delay", "azimuth", "elevation", "coefficient")})
    recording = receiver.record(
        nothing, sounder, name="P", tx_position=(0, 0, 1), rx_position=(LENGTH, 0, 1), snapshots=1
    )
    delay = np.array([LENGTH / c / 2 + sounder.waveform.period, LENGTH / c])
    gain = 20 * np.log10(1 / sounder.carrier.frequency / (4 * np.pi * delay)) + excess
    columns = {"delay": delay, "path_gain": gain, "path_gain_std": np.array(std)}
    mpc = xr.Dataset({name: ("mpc", values) for name, values in columns.items()})
    assert (over_free_space(mpc, recording) is not None) == reported


@pytest.mark.parametrize(("stated", "told"), [(None, True), (0.1, False)])
def test_a_cut_in_rows_as_far_apart_as_the_beam_is_wide_is_told_with_figures(description, stated, told):
    rows = np.arange(-180.0, 181.0, 10.0)
    lobe = tuple(np.maximum(-12 * (rows / 20) ** 2, -40))
    cut = {"angle": tuple(rows), "azimuth": lobe, "elevation": lobe}
    horn = {"pattern": "cut", "cut": cut, "hpbw_azimuth": 20.0, "hpbw_elevation": 20.0, "gain_error": stated}
    remarks = remarks_on_cuts(description(rx_antenna={"gain": 20.0, **horn}))
    assert len(remarks) == told
    if told:
        assert "rx_antenna: the cut in azimuth has rows 10 degree apart" in remarks[0].meaning
        assert remarks[0].figure > 5 * remarks[0].bound
