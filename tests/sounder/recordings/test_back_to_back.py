"""Back-to-back files return what was written, and are refused if they do not fit."""

import h5py
import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.cir.amplitudes import within_range
from sounder.recordings import native
from sounder.recordings.writer import write_back_to_back
from sounder.twin import receiver

from .files import IQ, edit


@pytest.mark.parametrize("attenuator", [60.0, (np.linspace(131e9, 133e9, 5), np.linspace(1, 2, 5) * 1e-3j)])
def test_a_back_to_back_comes_back(tmp_path, sounder, attenuator):
    made = receiver.back_to_back(sounder, attenuator, snapshots=2)
    write_back_to_back(made, tmp_path / "b2b.h5", history="test")
    back = native.back_to_back(tmp_path / "b2b.h5")
    assert np.array_equal(back.captures, made.captures)
    assert back.captures.dtype == np.int16
    for name in ("sounder", "scale_factor", "attenuation", "includes_tx_antenna"):
        assert getattr(back, name) == getattr(made, name), name
    assert (back.s21 is None) == (made.s21 is None)
    if back.s21 is not None and made.s21 is not None:
        assert np.array_equal(back.s21, made.s21)


@pytest.mark.parametrize(
    ("datasets", "expected"),
    [
        ({"iq": None}, "the file has no iq"),
        ({"iq": IQ[0, 0, 0]}, "expected int16 (snapshot, sample, 2)"),
        ({"iq": IQ[0, 0, :0]}, "the back-to-back holds no samples"),
        ({"attenuator_frequency": None}, "the file has no attenuator_frequency"),
        ({"attenuator_frequency": [1.0, 3.0, 2.0, 4.0, 5.0]}, "attenuator_frequency is not in ascending order"),
        ({"attenuator_s21": np.ones(5)}, "attenuator_s21 has shape (5,); expected (5, 2)"),
        ({"attenuator_s21": np.full((5, 2), np.inf)}, "attenuator_s21 is NaN or beyond 200 dB"),
        ({"attenuator_s21": np.full((5, 2), 5e-324)}, "attenuator_s21 is NaN or beyond 200 dB"),
    ],
)
def test_a_back_to_back_that_does_not_fit_is_reported(tmp_path, sounder, datasets, expected):
    path = tmp_path / "b2b.h5"
    measured = np.linspace(131e9, 133e9, 5), np.ones(5) * 1e-3j
    write_back_to_back(receiver.back_to_back(sounder, measured, snapshots=2), path, history="test")
    edit(path, **datasets)
    with pytest.raises(DataError) as error:
        native.back_to_back(path)
    assert expected in str(error.value)


def test_numbers_of_half_precision_are_read_without_a_warning(tmp_path, sounder):
    path = tmp_path / "b2b.h5"
    measured = np.linspace(131e9, 133e9, 5), np.ones(5) * 2.0**-10
    write_back_to_back(receiver.back_to_back(sounder, measured, snapshots=2), path, history="test")
    edit(path, attenuator_s21=np.tile(np.float16([2.0**-10, 0.0]), (5, 1)))
    read = native.back_to_back(path)
    assert read.s21 is not None
    assert np.array_equal(read.s21[1], measured[1])
    assert within_range(read.captures[..., 0].astype(np.float16))
    assert not within_range(np.float16([np.nan, 0.0]))


def test_a_back_to_back_without_its_loss_is_refused(tmp_path, sounder):
    path = tmp_path / "b2b.h5"
    write_back_to_back(receiver.back_to_back(sounder, 60.0, snapshots=2), path, history="test")
    with h5py.File(path, "r+") as file:
        del file.attrs["attenuation"]
    with pytest.raises(DataError, match=r"expected the loss of the attenuator \[dB\]"):
        native.back_to_back(path)
