"""MPC tables on disk: CSV files and products of ``sounder process`` are read, CSV files are written.

A row that breaks a rule is dropped and reported. A file that cannot be read is skipped and reported. One bad position
does not stop a campaign.
"""

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from erm.common.atomic import atomic_path
from erm.common.constants import FARTHEST, SAME_PLACE, c
from erm.common.errors import DataError
from erm.common.significance import CERTAIN
from erm.common.storage import open_group, open_groups
from erm.common.text_files import read_table
from erm.mpcs.standard_errors import UNKNOWN_GAIN_STD
from erm.mpcs.table import OPTIONAL, VALUES, columns_of_product, empty_table, make_table

if TYPE_CHECKING:
    import xarray as xr

COORDINATES = tuple(f"{end}_{axis}" for end in ("tx", "rx") for axis in "xyz")
COLUMNS = ("position", "los", *COORDINATES, "frequency", *VALUES)
"""Header of a CSV file; the columns of `OPTIONAL` may follow."""
PRODUCT = "a product of `sounder process`"
BLANK_ALLOWED = ("los", "elevation", "path_gain", *OPTIONAL)
ABSENT_ALLOWED = ("path_gain",)
"""Columns of `COLUMNS` that a file may lack."""
MAX_DELAY = 1e-3
"""Longest delay that is accepted, 300 km [s]. A longer one is in a wrong unit."""
MOST_GAIN = 1000.0
"""Largest gain and error of a gain that are accepted [dB]: sums of such powers, and their squares, are numbers."""
LARGEST_STD = {"delay_std": MAX_DELAY, "azimuth_std": 180.0, "elevation_std": 180.0, "path_gain_std": MOST_GAIN}
"""Largest standard deviations [s], [degree], [dB]: what is beyond is no error of such a value, or in another unit."""
MAX_DELAY_RATIO = 50.0
"""Length of a typical path over the distance of its antennas, at most; chosen."""


def read_mpcs(paths: Iterable[Path | str]) -> tuple["xr.Dataset", list[str]]:
    """Read CSV files and products of ``sounder process``, in any number and mixture, into one table.

    Parameters
    ----------
    paths : iterable of path
        The files. Their suffix tells CSV files from products.

    Returns
    -------
    table : xarray.Dataset
        All valid rows, in the order of the files; see `erm.make_table`.
    problems : list of str
        One line for each file that could not be read or repeats others, and for each rule that rows of a file break.

    Examples
    --------
    >>> import erm
    >>> table, problems = erm.read_mpcs(["absent.csv"])
    >>> table.sizes["mpc"], problems
    (0, ['absent.csv: no such file'])
    """
    import xarray as xr

    files = list(map(Path, paths))
    trusted, doubted = _shared_doubts(files)
    tables, problems, seen = [], [], set()
    known: set[bytes] = set()
    for path in files:
        if path.resolve() in seen:
            problems.append(f"{path}: given twice; counted once")
            continue
        seen.add(path.resolve())
        try:
            table, broken = read_csv(path) if path.suffix.lower() == ".csv" else read_product(path, trusted, doubted)
        except DataError as error:
            problems.append(str(error))
            continue
        problems += broken
        measured = _measured(table)
        repeated = np.array([row in known for row in measured], dtype=bool)
        if repeated.any():
            problems.append(f"{path}: {repeated.sum()} of {len(repeated)} MPCs are in earlier files; counted once")
        known.update(measured)
        tables.append(table.isel(mpc=np.flatnonzero(~repeated)))
    joined = xr.concat(tables, dim="mpc") if tables else empty_table()
    return joined, problems


SHARED_DOUBTS = ("delay", "azimuth")
"""What is doubtful in a position by itself, but not if most positions share it: an error of clock or heading that all
have alike is removed by the calibration of the survey."""
FEWEST_SHARED = 3
"""Fewest products that can share a doubt."""


def _shared_doubts(paths: Iterable[Path]) -> tuple[list[str], list[str]]:
    """What most products mark as doubtful, which is trusted, and what they make doubtful only together."""
    doubts = []
    evidence: Counter[int] = Counter()
    for path in paths:
        try:
            attributes = {} if path.suffix.lower() == ".csv" else open_group(path).attrs
        except DataError:  # told by the reader
            continue
        if attributes:
            doubts.append(str(attributes.get("doubts", "")).split())
            ratios = np.ravel(attributes.get("shared_evidence", 0.0))
            evidence.update(dict(enumerate(ratios.tolist())) if ratios.dtype.kind == "f" else {})
    together = ["position"] if max(evidence.values(), default=0.0) > CERTAIN else []
    if len(doubts) < FEWEST_SHARED:
        return [], together
    return [name for name in SHARED_DOUBTS if sum(name in each for each in doubts) > len(doubts) / 2], together


def read_csv(path: Path | str) -> tuple["xr.Dataset", list[str]]:
    """Read one CSV file.

    Its header holds `COLUMNS` in any order, and any of `OPTIONAL`. Other columns are ignored. Separators and encodings
    are those of `erm.common.text_files.read_table`. A standard deviation that cannot be one is taken as unknown.

    Returns
    -------
    table : xarray.Dataset
        Valid rows.
    problems : list of str
        One line for each rule that rows break.

    Raises
    ------
    DataError
        The file is missing, is not text, or lacks a column.
    """
    text = read_table(path, f"CSV with the header {','.join(COLUMNS)}")
    if missing := [name for name in COLUMNS if name not in (*text.header, *ABSENT_ALLOWED)]:
        some = (
            f"has no column {', '.join(missing)}"
            if len(missing) < len(COLUMNS) - len(ABSENT_ALLOWED)
            else "not an MPC table"
        )
        raise DataError(f"{path}: {some}; expected the header {','.join(COLUMNS)}")

    numbers = {
        name: np.array([_number(cell, name in BLANK_ALLOWED) for cell in text.column(name)], dtype=float)
        for name in (*COLUMNS[1:], *OPTIONAL)
    }
    unreadable = {name: np.isinf(column) for name, column in numbers.items()}
    los = numbers.pop("los")
    table = make_table(
        {"position": np.array(text.column("position"), dtype=str)}
        | {"los": np.where(np.isin(los, (0, 1)), los, -1)}
        | {
            end: np.column_stack([numbers.pop(f"{end[:2]}_{axis}") for axis in "xyz"])
            for end in ("tx_position", "rx_position")
        }
        | numbers
    )
    rules = {f"{name} is not a number": bad for name, bad in unreadable.items()}
    rules["los is not 1, 0 or blank"] = ~np.isnan(los) & ~np.isin(los, (0, 1))
    unknown = _impossible_errors(table, numbers, path, text.lines)
    table, problems = _checked(table, path, rules, text.lines)
    return table, unknown + problems


def read_product(
    path: Path | str, trusted: Iterable[str] = (), doubted: Iterable[str] = ()
) -> tuple["xr.Dataset", list[str]]:
    """Read the MPCs of one product of ``sounder process``.

    Its attribute ``doubts`` names what the checks of the recording made doubtful. A doubtful gain gets a large standard
    deviation, a doubtful elevation is left out. With a doubtful delay, azimuth or position all rows are left out.

    Parameters
    ----------
    path : path
        The file.
    trusted : iterable of str
        What is used although it is doubtful.
    doubted : iterable of str
        What is doubtful although the product does not say so.

    Returns
    -------
    table : xarray.Dataset
        Valid rows.
    problems : list of str
        One line for each rule that rows break.

    Raises
    ------
    DataError
        The file is missing, is not such a product, or has no positions of the antennas.
    """
    root, mpc = open_groups(path, "/", "/mpc", expected=PRODUCT)
    if missing := [name for name in ("tx_position", "rx_position") if name not in root]:
        raise DataError(f"{path}: has no {missing[0]}; expected {PRODUCT}")
    if missing := [name for name in VALUES if name not in mpc]:
        raise DataError(f"{path}: group /mpc has no {missing[0]}; expected {PRODUCT}")
    if "frequency" not in root.attrs:
        raise DataError(f"{path}: has no attribute frequency; expected {PRODUCT}")
    names = np.atleast_1d(root["position"].values) if "position" in root else np.array([Path(path).stem])
    if len(names) != 1:
        raise DataError(f"{path}: holds {len(names)} positions; expected one per file, as `sounder process` writes")
    columns: dict[str, Any] = dict(columns_of_product(mpc))
    for name, column in columns.items():
        if column.dtype.kind not in "biuf" or column.shape != columns["delay"].shape or column.ndim != 1:
            raise DataError(f"{path}: group /mpc has {name} as {column.dtype} {column.shape}; expected a number an MPC")
    for end in ("tx_position", "rx_position"):
        if root[end].dtype.kind not in "biuf" or root[end].size != 3:
            raise DataError(f"{path}: {end} is {root[end].dtype} {root[end].shape}; expected three numbers")
    columns |= {end: np.ravel(root[end].values) for end in ("tx_position", "rx_position")}
    columns |= {"position": str(names[0]), "los": line_of_sight(root, path)}
    table = make_table(columns | {"frequency": root.attrs["frequency"]})
    marked = [*str(root.attrs.get("doubts", "")).split(), *doubted]
    doubts = list(dict.fromkeys(name for name in marked if name not in trusted))
    if "path_gain" in doubts:
        table["path_gain_std"][:] = UNKNOWN_GAIN_STD
    if "elevation" in doubts:
        for name in ("elevation", "elevation_std", "gain_slope", "gain_curvature"):
            table[name][:] = np.nan
    unknown = _impossible_errors(table, columns, path, None)
    doubtful = bool({"delay", "azimuth", "position"} & set(doubts))
    who = "the products together mark" if set(doubts) <= set(doubted) else "the product marks"
    rule = f"{who} {' and '.join(doubts)} as doubtful; see sounder info, or process with --trust-all"
    table, problems = _checked(table, path, {rule: np.full(table.sizes["mpc"], doubtful)}, None)
    return table, unknown + problems


def line_of_sight(root: "xr.Dataset", path: Path | str) -> int:
    """Attribute ``los`` of a product: 1 line of sight, 0 none, -1 unknown."""
    los = root.attrs.get("los", -1)
    if los not in (-1, 0, 1):
        raise DataError(f"{path}: attribute los is {los:g}; expected 1 (line of sight), 0 (none) or -1 (unknown)")
    return int(los)


def write_mpcs(table: "xr.Dataset", path: Path | str) -> None:
    """Write an MPC table as CSV.

    Unknown values are blank. Columns of `OPTIONAL` are written if they hold a known value.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    path : path
        The file.

    Examples
    --------
    >>> import erm
    >>> from tempfile import TemporaryDirectory
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> mpcs = erm.predict(street, (0, 0, 28.4), (31, -60, 1.4), 132e9)
    >>> with TemporaryDirectory() as folder:
    ...     erm.write_mpcs(mpcs, f"{folder}/mpcs.csv")
    ...     table, problems = erm.read_mpcs([f"{folder}/mpcs.csv"])
    >>> table.sizes["mpc"], problems
    (2, [])
    """
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


def _measured(table: "xr.Dataset") -> list[bytes]:
    """Positions and measured values (mpc,) as bytes. Two different MPCs never agree in all bits."""
    places = [table[f"{end}_position"].values for end in ("tx", "rx")]
    values = [table[name].values[:, None] for name in ("delay", "azimuth", "path_gain")]
    return [row.tobytes() for row in np.ascontiguousarray(np.hstack([*places, *values]))]


def _number(text: str, blank_allowed: bool) -> float:
    """Number in a cell: NaN for a blank that is allowed, infinite for anything else that is not a number."""
    if not text and blank_allowed:
        return np.nan
    try:
        value = float(text)
    except ValueError:
        return np.inf
    return value if np.isfinite(value) or blank_allowed else np.inf


def _impossible_errors(
    table: "xr.Dataset", given: Mapping[str, npt.NDArray[np.float64]], path: Path | str, lines: Sequence[int] | None
) -> list[str]:
    """Make standard deviations and slopes unknown that none can be; one line for each column that has any."""
    problems = []
    most_gain = LARGEST_STD["path_gain_std"]
    for name, most in {**LARGEST_STD, "gain_slope": most_gain, "gain_curvature": most_gain}.items():
        stated = given.get(name, np.empty(0))
        odd = {f"beyond {most:g}": np.abs(stated) > most}
        if name in LARGEST_STD:
            # a weight that others of a nanosecond, a degree or a dB are lost beside
            least = np.sqrt(np.finfo(float).eps) * (1e-9 if name == "delay_std" else 1.0)
            odd = {
                "not positive": stated <= 0,
                f"below {least:.0e}": (stated > 0) & (stated < least),
                f"above {most:g}": stated > most,
            }
        for what, wrong in odd.items():
            if wrong.any():
                table[name].values[wrong] = np.nan
                first = int(np.argmax(wrong))
                where = f"line {lines[first]}" if lines else f"MPC {first}"
                problems.append(
                    f"{path}: {name} is {what} in {np.count_nonzero(wrong)} of {len(wrong)} rows (first: {where}); "
                    "taken as unknown; leave unknown values blank"
                )
    return problems


def _unit_of(delay: npt.NDArray[np.float64], distance: npt.NDArray[np.float64]) -> str:
    """What the unit of delays may be that are too long: paths are a little longer than the antennas are apart."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        ratios = delay * c / distance
    ratio = np.median(ratios[np.isfinite(ratios)]) if np.isfinite(ratios).any() else np.nan
    units = {"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3}
    fitting = [unit for unit, factor in units.items() if 0.5 < ratio * factor < MAX_DELAY_RATIO]
    return f" (as {fitting[0]} they agree with the places of the antennas)" if fitting else ""


def _checked(
    table: "xr.Dataset", path: Path | str, rules: Mapping[str, npt.NDArray[np.bool_]], lines: Sequence[int] | None
) -> tuple["xr.Dataset", list[str]]:
    """Drop the rows that break a rule; return one line for each broken rule."""
    tx, rx = table["tx_position"].values, table["rx_position"].values
    delay = table["delay"].values
    with np.errstate(invalid="ignore", over="ignore"):  # infinite values are caught by the rules
        direct = np.linalg.norm(tx - rx, axis=-1)
        broken = dict(rules) | {
            "position has no name": table["position"].values == "",
            "a position is NaN or no place on earth": ~(np.abs(np.hstack([tx, rx])).max(axis=1) < FARTHEST),
            "TX and RX are at the same place": direct < SAME_PLACE,
            "frequency is not positive": ~(table["frequency"].values > 0),
            "delay or azimuth is NaN": ~np.isfinite(delay + table["azimuth"].values),
            f"delay is above 1 ms; expected seconds{_unit_of(delay, direct)}": delay > MAX_DELAY,
            f"path_gain is above {MOST_GAIN:g} dB": table["path_gain"].values > MOST_GAIN,
        }
    kept = np.ones(table.sizes["mpc"], dtype=bool)
    problems = []
    for rule, rows in broken.items():
        dropped = rows & kept
        if dropped.any():
            where = f"line {lines[int(np.argmax(dropped))]}" if lines else f"MPC {np.argmax(dropped)}"
            problems.append(f"{path}: {np.count_nonzero(dropped)} of {len(kept)} rows dropped: {rule} (first: {where})")
        kept &= ~rows
    return table.isel(mpc=kept), problems
