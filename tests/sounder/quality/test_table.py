"""Remarks survive the way into a product and back, and are read out as lines."""

import math
from pathlib import Path

import numpy as np

from erm.common.storage import open_group, write_product
from sounder.quality.table import read_remarks, rows, tabulate_remarks
from sounder.remark import Code, Remark, doubts, lines

REMARKS = [
    Remark(Code.CLIPPED, azimuth=350.0, elevation=-9.0, snapshot=3, figure=0.02, bound=0.001),
    Remark(Code.CLIPPED, azimuth=0.0, elevation=9.0, figure=0.004, bound=0.001),
    Remark(Code.OVER_FREE_SPACE, figure=7.0, bound=3.0, detail="the MPC at 3 ns"),
    Remark(Code.TABLE_FULL),
]


def same(a, b):
    return a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))


def test_remarks_come_back_from_a_product(tmp_path):
    write_product({"/quality": tabulate_remarks(REMARKS)}, tmp_path / "product.h5")
    found = read_remarks(open_group(tmp_path / "product.h5", "/quality"))
    assert len(found) == len(REMARKS)
    for one, other in zip(found, REMARKS, strict=True):
        assert all(same(getattr(one, name), getattr(other, name)) for name in vars(other))


def test_no_remark_is_a_table_of_length_0(tmp_path):
    write_product({"/quality": tabulate_remarks([])}, tmp_path / "product.h5")
    assert read_remarks(open_group(tmp_path / "product.h5", "/quality")) == []


def test_rows_are_plain_values():
    first, *_, last = rows(tabulate_remarks(REMARKS), "RX1")
    assert first["position"] == "RX1"
    assert (first["code"], first["azimuth"], first["snapshot"], first["unit"]) == ("clipped", 350.0, 3, "1")
    assert last["azimuth"] is None
    assert last["figure"] is None


def test_one_line_for_each_kind():
    assert lines(REMARKS, 108, failures=True) == [
        "samples are clipped (up to 2.0 %) in 2 of 108 directions: (azimuth, elevation) (350, -9), (0, 9); "
        "left out; lower the receiver gain",
        f"the MPC at 3 ns: {Code.OVER_FREE_SPACE.action}",
    ]
    assert lines(REMARKS, 108, failures=False) == [f"{Code.TABLE_FULL.text}; {Code.TABLE_FULL.action}"]


def test_doubts_are_columns_of_the_mpc_table():
    assert set(doubts([Remark(code) for code in Code])) <= {"delay", "azimuth", "elevation", "path_gain", "position"}
    assert np.unique([code.label for code in Code]).size == len(Code)


def test_every_code_is_documented() -> None:
    text = (Path(__file__).parents[3] / "docs" / "quality.md").read_text()
    for code in Code:
        row = next(line for line in text.splitlines() if line.startswith(f"| `{code.label}` |"))
        assert code.text in row
        assert code.action in row
