"""The table of multipath components: read from CSV files and sounder products, checked, written as CSV.

In memory it is one `xarray.Dataset` along ``mpc``, one row a component, whatever the number of files,
positions and transmitters. A row that breaks a rule is dropped and reported, a file that cannot be read is
reported and skipped: one bad position must not cost a campaign.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.common.errors import DataError
from erm.common.storage import atomic_path, open_group, require_file

if TYPE_CHECKING:
    import xarray as xr

VALUES = {"delay": "s", "azimuth": "degree", "elevation": "degree", "path_gain": "dB"}
COORDINATES = tuple(f"{end}_{axis}" for end in ("tx", "rx") for axis in "xyz")
COLUMNS = ("position", "los", *COORDINATES, "frequency", *VALUES)
OPTIONAL = {f"{name}_std": unit for name, unit in VALUES.items()} | {
    "gain_slope": "dB degree-1",  # what the gain is higher for a degree of elevation more
    "gain_curvature": "dB degree-2",
    "wrap_period": "s",
}
BLANK_ALLOWED = ("los", "elevation", *OPTIONAL)
EARLY = 1e-9  # s; a path this much shorter than the direct one is timing and surveying error, not a contradiction
LONGEST = 1e-3  # s; 300 km: the delay is not in seconds

Columns = Mapping[str, npt.ArrayLike]


def make_table(columns: Columns) -> "xr.Dataset":
    """Table from arrays by column name; numbers and names broadcast to the longest column.

    Parameters
    ----------
    columns : mapping
        ``position`` (str), ``tx_position`` and ``rx_position`` (mpc, 3) or (3,) [m], ``frequency`` [Hz],
        ``delay`` [s], ``azimuth`` [degree], ``path_gain`` [dB]; optionally ``los`` (1, 0, -1 unknown),
        ``elevation`` [degree], and `OPTIONAL`: the ``_std`` of each value; ``gain_slope`` [dB/degree] and
        ``gain_curvature`` [dB/degree2], by which the gain would be higher if the path arrived higher;
        ``wrap_period`` [s], by whole numbers of which the delay may be too short.

    Returns
    -------
    xarray.Dataset
        Dimension ``mpc``, of length 0 if the columns are.
    """
    import xarray as xr

    given = {name: np.asarray(column) for name, column in columns.items()}
    count = next((column.shape[0] for name, column in given.items() if name in VALUES and column.ndim), 1)
    table: dict[str, tuple[tuple[str, ...], npt.NDArray, dict[str, str]]] = {
        "position": (("mpc",), np.broadcast_to(given["position"], count).astype(np.str_), {}),
        "los": (
            ("mpc",),
            np.broadcast_to(given.get("los", np.int8(-1)), count).astype(np.int8),
            {"long_name": "line of sight: 1 yes, 0 no, -1 unknown"},
        ),
    }
    for end in ("tx_position", "rx_position"):
        value = np.broadcast_to(given[end].astype(float), (count, 3))
        table[end] = (("mpc", "xyz"), value.copy(), {"units": "m"})
    units = {"frequency": "Hz"} | VALUES | OPTIONAL
    for name, unit in units.items():
        value = np.broadcast_to(given.get(name, np.asarray(np.nan)).astype(float), count)
        table[name] = (("mpc",), value.copy(), {"units": unit})
    return xr.Dataset(table)


def empty_table() -> "xr.Dataset":
    """The table of a place where nothing arrived."""
    nothing = np.empty(0)
    return make_table(
        {"position": nothing.astype(str), "tx_position": np.empty((0, 3)), "rx_position": np.empty((0, 3))}
        | {"delay": nothing, "azimuth": nothing, "path_gain": nothing, "frequency": nothing}
    )


def read_mpcs(paths: Iterable[Path | str]) -> tuple["xr.Dataset", list[str]]:
    """Read any number and mixture of CSV files and sounder products into one table.

    Returns
    -------
    table : xarray.Dataset
        All rows that keep the rules, in the order of the files.
    complaints : list of str
        One line for each file that could not be used, or repeats others, and for each rule that rows of a file broke.
    """
    import xarray as xr

    tables, complaints, seen = [], [], set()
    known: set[bytes] = set()
    for path in map(Path, paths):
        if path.resolve() in seen:
            complaints.append(f"{path}: given twice; counted once")
            continue
        seen.add(path.resolve())
        try:
            table, problems = read_csv(path) if path.suffix.lower() == ".csv" else read_product(path)
        except DataError as error:
            complaints.append(str(error))
            continue
        complaints += problems
        measured = _measured(table)
        again = np.array([one in known for one in measured], dtype=bool)
        if again.any():
            complaints.append(f"{path}: {again.sum()} of {len(again)} components are in files before it; counted once")
        known.update(measured)
        tables.append(table.isel(mpc=np.flatnonzero(~again)))
    joined = xr.concat(tables, dim="mpc") if tables else empty_table()
    return joined, complaints


def read_csv(path: Path | str) -> tuple["xr.Dataset", list[str]]:
    """Read one CSV file with the header `COLUMNS` in any order, those of `OPTIONAL` or not; others are ignored.

    Raises
    ------
    DataError
        The file is missing, is not text, or lacks a column.
    """
    path = Path(path)
    require_file(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            rows = list(reader)
            header = list(reader.fieldnames or [])
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(
            f"{path}: not a text table ({error}); expected CSV with the header {','.join(COLUMNS)}"
        ) from None
    if missing := [name for name in COLUMNS if name not in header]:
        some = f"has no column {', '.join(missing)}" if len(missing) < len(COLUMNS) else "not an MPC table"
        raise DataError(f"{path}: {some}; expected the header {','.join(COLUMNS)}")

    numbers = {
        name: np.array([_number(row.get(name), name in BLANK_ALLOWED) for row in rows], dtype=float)
        for name in (*COLUMNS[1:], *OPTIONAL)
    }
    unreadable = {name: np.isinf(column) for name, column in numbers.items()}
    los = numbers.pop("los")
    table = make_table(
        {"position": np.array([(row["position"] or "").strip() for row in rows], dtype=str)}
        | {"los": np.where(np.isin(los, (0, 1)), los, -1)}
        | {
            end: np.column_stack([numbers.pop(f"{end[:2]}_{axis}") for axis in "xyz"])
            for end in ("tx_position", "rx_position")
        }
        | numbers
    )
    rules = {f"{name} is not a number": bad for name, bad in unreadable.items()}
    rules["los is none of 1, 0 and blank"] = ~np.isnan(los) & ~np.isin(los, (0, 1))
    return _checked(table, path, rules, first_line=2)


def read_product(path: Path | str) -> tuple["xr.Dataset", list[str]]:
    """Read the ``/mpc`` group of one product of ``sounder process``.

    Raises
    ------
    DataError
        The file is missing, is not such a product, or does not say where the antennas were.
    """
    root, mpc = open_group(path), open_group(path, "mpc")
    if missing := [name for name in ("tx_position", "rx_position") if name not in root]:
        raise DataError(f"{path}: has no {missing[0]}; expected a product of `sounder process`")
    if missing := [name for name in VALUES if name not in mpc]:
        raise DataError(f"{path}: group /mpc has no {missing[0]}; expected a product of `sounder process`")
    if "frequency" not in root.attrs:
        raise DataError(f"{path}: has no attribute frequency; expected a product of `sounder process`")
    names = np.atleast_1d(root["position"].values) if "position" in root else np.array([Path(path).stem])
    if len(names) != 1:
        raise DataError(f"{path}: holds {len(names)} positions; expected one a file, as `sounder process` writes")
    table = make_table(
        {
            "position": str(names[0]),
            "los": int(root.attrs.get("los", -1)),
            "frequency": root.attrs["frequency"],
        }
        | {end: np.ravel(root[end].values) for end in ("tx_position", "rx_position")}
        | columns_of(mpc)
    )
    return _checked(table, path, {}, first_line=0)


def columns_of(mpc: "xr.Dataset") -> dict[str, npt.NDArray]:
    """Columns for `make_table` of the MPCs of a product; the period of those only that may have wrapped."""
    columns = {name: mpc[name].values for name in (*VALUES, *OPTIONAL) if name in mpc}
    if "may_be_wrapped" in mpc:
        period = mpc.attrs.get("period", np.nan)
        columns["wrap_period"] = np.where(mpc["may_be_wrapped"].values == 1, period, np.nan)
    return columns


def write_csv(table: "xr.Dataset", path: Path | str) -> None:
    """Write a table as CSV; unknown values blank, `OPTIONAL` columns only where one is known."""
    known = [name for name in OPTIONAL if np.isfinite(table[name].values).any()]
    columns: list[Sequence[str]] = [
        table["position"].values.tolist(),
        ["" if flag < 0 else str(flag) for flag in table["los"].values],
    ]
    ends = [table[f"{name[:2]}_position"].values[:, "xyz".index(name[3])] for name in COORDINATES]
    values = [*ends, *(table[name].values for name in ("frequency", *VALUES, *known))]
    columns += [["" if np.isnan(value) else repr(float(value)) for value in column] for column in values]
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, *known])
        writer.writerows(zip(*columns, strict=True))


def write_reflection_points(table: "xr.Dataset", path: Path | str) -> None:
    """Write accepted components as CSV: reflection points, their errors, their walls.

    ``std_along``, ``std_across`` and ``std_up`` are the standard errors of the point along and across its face and of
    its height; ``wall_x .. wall_z`` is where the merged wall reflects the same path. Metres, degrees, dB.
    """
    kept = table.isel(mpc=np.flatnonzero(table["accepted"].values))
    covariance = kept["point_covariance"].values
    n = np.deg2rad(kept["normal"].values)
    level = np.zeros_like(n)
    across, along = np.stack([np.cos(n), np.sin(n), level], axis=-1), np.stack([-np.sin(n), np.cos(n), level], axis=-1)
    columns = {name: kept[name].values for name in ("position", "wall")}
    for column, variable in (("rp", "reflection_point"), ("wall", "wall_point")):
        columns |= {f"{column}_{axis}": kept[variable].values[:, i] for i, axis in enumerate("xyz")}
    columns |= {
        f"std_{name}": np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", way, covariance, way), 0))
        for name, way in (("along", along), ("across", across), ("up", np.broadcast_to([0.0, 0.0, 1.0], across.shape)))
    }
    columns |= {name: kept[name].values for name in ("normal", "tilt", "tilt_std")}
    columns["grazing"] = kept["grazing"].values.astype(int)
    columns |= {name: kept[name].values for name in ("delay", "azimuth", "path_gain", "reflection_loss")}
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))


def path_length(table: "xr.Dataset") -> npt.NDArray[np.float64]:
    """Length (mpc,) of each path, delay times the speed of light [m]."""
    return table["delay"].values * c


def _measured(table: "xr.Dataset") -> list[bytes]:
    """What was measured where (mpc,), in one piece: no two components are alike to the last bit."""
    places = [table[f"{end}_position"].values for end in ("tx", "rx")]
    values = [table[name].values[:, None] for name in ("delay", "azimuth", "path_gain")]
    return [row.tobytes() for row in np.ascontiguousarray(np.hstack([*places, *values]))]


def _number(text: str | None, blank_allowed: bool) -> float:
    """The value of a cell: NaN where it is blank and may be, infinite where it is no number."""
    text = (text or "").strip()
    if not text and blank_allowed:
        return np.nan
    try:
        value = float(text)
    except ValueError:
        return np.inf
    return value if np.isfinite(value) or blank_allowed else np.inf


def _checked(
    table: "xr.Dataset", path: Path | str, rules: Mapping[str, npt.NDArray[np.bool_]], first_line: int
) -> tuple["xr.Dataset", list[str]]:
    """Drop the rows that break a rule; one line for each rule that was broken."""
    tx, rx = table["tx_position"].values, table["rx_position"].values
    delay = table["delay"].values
    early = np.fmax(EARLY, 3 * table["delay_std"].values)
    with np.errstate(invalid="ignore"):  # rows may hold infinities here; the rules catch them
        direct = np.linalg.norm(tx - rx, axis=-1)
        broken = dict(rules) | {
            "position has no name": table["position"].values == "",
            "a position is NaN": ~np.isfinite(direct),
            "TX and RX are at the same place": direct < 1e-6,
            "frequency is not positive": ~(table["frequency"].values > 0),
            "delay, azimuth or path_gain is NaN": ~np.isfinite(
                delay + table["azimuth"].values + table["path_gain"].values
            ),
            "delay is above 1 ms; seconds are expected": delay > LONGEST,
            "delay is shorter than the direct path": delay < direct / c - early,
        }
    kept = np.ones(table.sizes["mpc"], dtype=bool)
    complaints = []
    for rule, rows in broken.items():
        fresh = rows & kept
        if fresh.any():
            where = f"line {np.argmax(fresh) + first_line}" if first_line else f"component {np.argmax(fresh)}"
            complaints.append(f"{path}: {np.count_nonzero(fresh)} of {len(kept)} rows dropped: {rule} (first: {where})")
        kept &= ~rows
    return table.isel(mpc=kept), complaints
