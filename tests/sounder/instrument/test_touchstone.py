"""Attenuator files: read as written, refused in one line when they cannot serve."""

import numpy as np
import pytest

from erm.common.errors import DataError
from sounder.instrument.touchstone import read_s21, transmission


def write(path, rows, header="# GHz S RI R 50"):
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def row(frequency, s21, other=0.5):
    return f"{frequency} 0 0 {s21.real} {s21.imag} {other} 0 0 0"


def test_s21_is_from_port_1_to_port_2_and_not_the_other_way(tmp_path):
    path = write(tmp_path / "a.s2p", [row(131, 0.25 - 0.5j), row(133, 0.125 + 0j)])
    frequency, s21 = read_s21(path, band=(131.2e9, 132.9e9))
    assert frequency == pytest.approx([131e9, 133e9])
    assert s21 == pytest.approx([0.25 - 0.5j, 0.125])


def test_units_and_formats_of_touchstone(tmp_path):
    path = write(
        tmp_path / "a.s2p", ["131000 0 0 -60 90 -60 90 0 0", "133000 0 0 -60 90 -60 90 0 0"], "# MHz S DB R 50"
    )
    frequency, s21 = read_s21(path)
    assert frequency == pytest.approx([131e9, 133e9])
    assert s21 == pytest.approx([1e-3j, 1e-3j])


def test_interpolation_keeps_the_gain_of_a_device_with_delay():
    # 0.2 turns of phase a step: a chord between points would be 1 - cos(pi 0.2) = 19 % short in its middle
    frequency = np.linspace(131e9, 133e9, 11)
    wanted = np.linspace(131e9, 133e9, 77)
    s21, expected = (1e-3 * np.exp(-2j * np.pi * f * 1e-9) for f in (frequency, wanted))
    assert transmission(frequency, s21, wanted) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.s2p", None, "no such file"),
        ("a.s1p", "# GHz S RI R 50\n131 0 0\n133 0 0\n", "two-port"),
        ("a.s2p", "", "two or more frequencies in ascending order"),
        ("a.s2p", "hello world\n", "touchstone"),
        ("a.s2p", "# GHz S RI R 50\n131 0 0 1e-3\n", "touchstone"),
        ("a.s2p", "# GHz S RI R 50\n131 0 0 x y 0 0 0 0\n", "touchstone"),
        ("a.s2p", "# GHz S RI R 50\n131 0 0 1e-3 0 1e-3 0 0 0\n", "two or more frequencies in ascending order"),
        ("a.s2p", "# GHz S RI R 50\n131 0 0 0 0 0 0 0 0\n133 0 0 0 0 0 0 0 0\n", "other than 0"),
        ("a.s2p", "# GHz S RI R 50\n131 0 0 1e-3 0 1e-3 0 0 0\n132 0 0 1e-3 0 1e-3 0 0 0\n", "132.500 GHz"),
        ("a.s2p", "\xff\xfe\x00", "touchstone"),
    ],
)
def test_unusable_files_are_refused_in_one_line(tmp_path, name, text, said):
    path = tmp_path / name
    if text is not None:
        path.write_bytes(text.encode("latin-1"))
    with pytest.raises(DataError, match=said) as caught:
        read_s21(path, band=(131.5e9, 132.5e9))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
