"""MPC tables survive the trip through CSV, and what is wrong in a file is said in one line."""

from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings

from erm.common.errors import DataError
from erm.common.storage import write_product
from erm.mpcs.files import COLUMNS, read_csv, read_mpcs, read_product, write_mpcs
from erm.mpcs.table import make_table

from ..strategies import tables

HEADER = ",".join(COLUMNS)
GOOD = "RX1,1,0,0,28.4,60,10,1.4,132e9,3e-7,45,5,-110"


def random_table(seed=0, n=20):
    rng = np.random.default_rng(seed)
    return make_table(
        {
            "position": np.array([f"RX{i % 4}" for i in range(n)]),
            "los": rng.integers(-1, 2, n),
            "tx_position": rng.uniform(-5, 5, (n, 3)),
            "rx_position": rng.uniform(20, 30, (n, 3)),
            "frequency": 132e9,
            "delay": rng.uniform(3e-7, 6e-7, n),
            "azimuth": rng.uniform(0, 360, n),
            "elevation": np.where(rng.random(n) < 0.5, np.nan, 3.0),
            "path_gain": rng.uniform(-140, -100, n),
            "azimuth_std": rng.uniform(0.1, 1, n),
        }
    )


def lines(path: Path, *rows: str, header: str = HEADER) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@settings(max_examples=25, deadline=None)
@given(table=tables())
def test_csv_keeps_every_bit_of_any_table(table):
    with TemporaryDirectory() as folder:
        write_mpcs(table, Path(folder) / "t.csv")
        read, complaints = read_csv(Path(folder) / "t.csv")
    assert complaints == []
    xr.testing.assert_identical(read, table)


def test_columns_may_stand_in_any_order_with_others_between(tmp_path: Path):
    names = ["comment", *reversed(COLUMNS)]
    row = ",".join(["hello", *reversed(GOOD.split(","))])
    read, complaints = read_csv(lines(tmp_path / "t.csv", row, header=",".join(names)))
    assert complaints == []
    assert read["delay"].item() == 3e-7
    assert read["tx_position"].values[0].tolist() == [0, 0, 28.4]


def product(path: Path, n=2, **root_attrs) -> Path:
    root = xr.Dataset(
        {
            "tx_position": (("position", "xyz"), [[0.0, 0.0, 28.4]]),
            "rx_position": (("position", "xyz"), [[60.0, 10.0, 1.4]]),
        },
        coords={"position": ["RX7"]},
        attrs={"frequency": 132e9, "los": 0} | root_attrs,
    )
    values = {"delay": 3e-7, "azimuth": 30.0, "elevation": 4.0, "path_gain": -110.0}
    columns = {name: ("mpc", np.full(n, value)) for name, value in values.items()}
    columns |= {f"{name}_std": ("mpc", np.full(n, 0.5)) for name in values}
    columns["delay_std"] = ("mpc", np.full(n, 1e-10))
    write_product({"/": root, "mpc": xr.Dataset(columns)}, path)
    return path


@pytest.mark.parametrize("n", [0, 2])
def test_products_of_the_sounder_are_tables_too(tmp_path: Path, n):
    read, complaints = read_product(product(tmp_path / "RX7.h5", n))
    assert complaints == []
    assert read.sizes["mpc"] == n
    assert set(read["position"].values.tolist()) == ({"RX7"} if n else set())
    assert set(read["los"].values.tolist()) == ({0} if n else set())
    assert read["rx_position"].shape == (n, 3)


@pytest.mark.parametrize("period", ["x", np.inf, [1e-6, 2e-6]])
def test_a_period_that_is_no_number_is_named(tmp_path: Path, period):
    with h5py.File(product(tmp_path / "RX7.h5"), "r+") as file:
        file["mpc"]["may_be_wrapped"] = np.ones(2, np.int8)
        file["mpc/may_be_wrapped"].dims[0].attach_scale(file["mpc/mpc"])
        file["mpc"].attrs["period"] = period
        del file.attrs["members"]
    with pytest.raises(DataError, match=r"RX7\.h5: attribute period is .*; expected a finite number"):
        read_product(tmp_path / "RX7.h5")


def test_files_of_both_kinds_make_one_table_and_bad_ones_are_named(tmp_path: Path):
    (tmp_path / "text.h5").write_text("not a product")
    paths = [product(tmp_path / "RX7.h5"), lines(tmp_path / "a.csv", GOOD), tmp_path / "no.csv", tmp_path / "text.h5"]
    table, complaints = read_mpcs(paths)
    assert table.sizes["mpc"] == 3
    assert len(complaints) == 2
    assert "no.csv: no such file" in complaints[0]
    assert "text.h5: not an HDF5 file" in complaints[1]
    assert all("\n" not in complaint for complaint in complaints)


def test_a_file_given_twice_counts_once_and_is_told(tmp_path: Path):
    path = product(tmp_path / "RX7.h5")
    table, complaints = read_mpcs([path, tmp_path / "." / "RX7.h5", lines(tmp_path / "a.csv", GOOD)])
    assert table.sizes["mpc"] == 3
    assert complaints == [f"{path}: given twice; counted once"]


def test_components_that_another_file_holds_too_count_once_and_are_told(tmp_path: Path):
    path = product(tmp_path / "RX7.h5")
    table, _ = read_mpcs([path])
    copy = tmp_path / "all.csv"
    write_mpcs(table.assign(position=("mpc", ["another name"] * table.sizes["mpc"])), copy)
    with copy.open("a") as file:
        file.write(GOOD + "\n")
    both, complaints = read_mpcs([path, copy])
    assert both.sizes["mpc"] == table.sizes["mpc"] + 1
    assert complaints == [f"{copy}: 2 of 3 MPCs are in earlier files; counted once"]


def test_a_missing_column_is_named_with_the_header_that_would_be_right(tmp_path: Path):
    path = lines(tmp_path / "t.csv", header=HEADER.replace(",azimuth", ""))
    with pytest.raises(DataError, match="no column azimuth; expected the header position,los,"):
        read_csv(path)


def test_bytes_are_no_table(tmp_path: Path):
    (tmp_path / "t.csv").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(DataError, match="not text"):
        read_csv(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("column", "value", "complaint"),
    [
        ("rx_x", "nan", "rx_x is not a number"),
        ("rx_x", "", "rx_x is not a number"),
        ("delay", "soon", "delay is not a number"),
        ("los", "2", "los is not 1, 0 or blank"),
        ("position", "", "position has no name"),
        ("frequency", "0", "frequency is not positive"),
        ("delay", "300", "expected seconds"),
        ("path_gain", "1e5", "path_gain is above 1000 dB"),
    ],
)
def test_a_bad_row_is_dropped_and_reported_and_the_others_kept(tmp_path: Path, column, value, complaint):
    cells = GOOD.split(",")
    cells[COLUMNS.index(column)] = value
    table, complaints = read_csv(lines(tmp_path / "t.csv", GOOD, ",".join(cells), GOOD))
    assert table.sizes["mpc"] == 2
    assert len(complaints) == 1
    assert complaints[0].startswith(f"{tmp_path / 't.csv'}: 1 of 3 rows dropped: ")
    assert complaint in complaints[0]
    assert complaints[0].endswith("(first: line 3)")


def test_antennas_at_one_place_are_reported(tmp_path: Path):
    table, complaints = read_csv(lines(tmp_path / "t.csv", "RX1,,1,2,3,1,2,3,132e9,3e-7,45,,-110"))
    assert table.sizes["mpc"] == 0
    assert "TX and RX are at the same place" in complaints[0]


def test_a_path_that_is_shorter_than_the_direct_one_is_kept_for_the_clock_may_be_wrong(tmp_path: Path):
    table, complaints = read_csv(lines(tmp_path / "t.csv", "RX1,1,0,0,28.4,60,10,1.4,132e9,1e-9,45,5,-110"))
    assert (table.sizes["mpc"], complaints) == (1, [])


def test_gains_may_be_blank_or_absent(tmp_path: Path):
    blank = GOOD.rsplit(",", 1)[0]
    table, complaints = read_csv(lines(tmp_path / "t.csv", f"{blank},"))
    other, also = read_csv(lines(tmp_path / "u.csv", blank, header=HEADER.removesuffix(",path_gain")))
    assert complaints == also == []
    assert np.isnan(table["path_gain"].values).all()
    assert np.isnan(other["path_gain"].values).all()


def test_delays_of_another_unit_are_told(tmp_path: Path):
    _, complaints = read_csv(lines(tmp_path / "t.csv", "RX1,1,0,0,28.4,60,10,1.4,132e9,230,45,5,-110"))
    assert "as nanoseconds they agree" in complaints[0]


@pytest.mark.parametrize(("doubts", "kept"), [("", 2), ("path_gain elevation", 2), ("delay", 0), ("azimuth", 0)])
def test_what_a_product_marks_as_doubtful_is_widened_or_left_out(tmp_path: Path, doubts, kept):
    table, problems = read_mpcs([product(tmp_path / "RX1.h5", doubts=doubts)])
    assert table.sizes["mpc"] == kept
    assert len(problems) == (kept == 0)
    assert all("--trust-all" in line for line in problems)
    if "path_gain" in doubts:
        assert (table["path_gain_std"] >= 100).all()
        assert table["elevation"].isnull().all()


@pytest.mark.slow
@pytest.mark.parametrize(("evidence", "told"), [([3.0, -9.0], True), ([2.0, 2.0], False)])
def test_what_only_all_products_together_make_certain_leaves_them_out(tmp_path: Path, evidence, told):
    """Log-likelihood ratios of a fault that all share: 9 is certain, 6 is not."""
    each = [product(tmp_path / f"RX{k}.h5", shared_evidence=evidence) for k in range(3)]
    line = "the products together mark position as doubtful"
    assert sum(line in one for one in read_mpcs(each)[1]) == 3 * told
    assert not any(line in one for one in read_mpcs(each[:2])[1])


def test_a_product_that_does_not_say_where_it_was_is_refused(tmp_path: Path):
    root = xr.Dataset(attrs={"frequency": 1e9})
    write_product({"/": root, "mpc": xr.Dataset()}, tmp_path / "p.h5")
    with pytest.raises(DataError, match="has no tx_position"):
        read_product(tmp_path / "p.h5")


@pytest.mark.parametrize(
    ("std", "what"),
    [("0", "not positive"), ("-1", "not positive"), ("1e-320", "below 1e-17"), ("0.2", "above 0.001")],
)
def test_a_standard_deviation_that_cannot_be_one_is_unknown_and_reported(tmp_path: Path, std, what):
    header = f"{HEADER},delay_std,elevation_std"
    table, problems = read_csv(lines(tmp_path / "t.csv", f"{GOOD},1e-10,0.5", f"{GOOD},{std},0.5", header=header))
    assert np.isnan(table["delay_std"].values).tolist() == [False, True]
    assert table["elevation_std"].values.tolist() == [0.5, 0.5]
    assert problems == [
        f"{tmp_path / 't.csv'}: delay_std is {what} in 1 of 2 rows (first: line 3); taken as unknown; leave "
        "unknown values blank"
    ]


def test_a_slope_that_no_pattern_has_is_unknown_and_reported(tmp_path: Path):
    rows = [f"{GOOD},-0.05", f"{GOOD},1e308"]
    table, [problem] = read_csv(lines(tmp_path / "t.csv", *rows, header=f"{HEADER},gain_slope"))
    assert np.isnan(table["gain_slope"].values).tolist() == [False, True]
    assert "gain_slope is beyond 1000 in 1 of 2 rows (first: line 3)" in problem


def test_a_table_of_a_spreadsheet_is_the_same_table(tmp_path: Path):
    plain, _ = read_csv(lines(tmp_path / "t.csv", GOOD))
    european = [line.replace(",", ";").replace(".", ",") for line in (HEADER.upper(), GOOD)]
    (tmp_path / "e.csv").write_text("\r\n".join(["sep=;", *european]), encoding="cp1252")
    table, problems = read_csv(tmp_path / "e.csv")
    assert problems == []
    assert table.equals(plain)
