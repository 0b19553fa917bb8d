"""Tables for other programs."""

import numpy as np

from sounder.processing.parameter_tables import write_csv


def test_zero_has_no_sign_and_what_is_unknown_is_blank(tmp_path):
    write_csv(tmp_path / "table.csv", ["name", "a", "b", "c"], [["RX", -0.0, np.nan, -1 / 3]])
    assert (tmp_path / "table.csv").read_text() == "name,a,b,c\nRX,0,,-0.333333333\n"
