"""Tables of channel parameters as files: one row a position or one row a statistic, as CSV, LaTeX or HDF5."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from erm.common.atomic import atomic_path
from erm.common.storage import provenance, write_product
from sounder.parameters.catalogue import PARAMETERS, READ_IN
from sounder.parameters.statistics import LINES_OF_SIGHT, Statistic

SCALES = {"s": (1e9, "ns"), "Hz": (1e-6, "MHz"), "degree": (1.0, r"$^\circ$"), "dB": (1.0, "dB"), "1": (1.0, "")}
"""Factor and unit of a number in LaTeX, by its unit."""
PRINTED = (
    "path_loss",
    "rms_delay_spread",
    "maximum_excess_delay",
    "coherence_bandwidth",
    "azimuth_spread_arrival",
    "zenith_spread_arrival",
    "k_strongest",
    "mpcs",
)
"""Parameters of a LaTeX table of positions, which must fit a page."""
STATISTIC_HEADER = ("group", "parameter", "statistic", "unit", "value", "low", "high", "positions", "definition")


def write_parameters(parameters: xr.Dataset, path: Path) -> None:
    """Write a table with a row for each position.

    Parameters
    ----------
    parameters : xarray.Dataset
        From :func:`sounder.channel_parameters`.
    path : Path
        ``.csv``: all columns, in SI units, degrees and dB. ``.tex``: those of :data:`PRINTED` with their errors, in ns,
        MHz, degrees and dB. ``.h5``: all, with units and definitions as attributes.
    """
    if path.suffix.lower() == ".h5":
        about = provenance("Channel parameters of positions", "sounder parameters")
        write_product({"/": parameters.assign_attrs(about)}, path)
    elif path.suffix.lower() == ".tex":
        _write_text(path, _latex_positions(parameters))
    else:
        header, columns = flat_columns(parameters)
        write_csv(path, header, zip(*columns, strict=True))


def write_statistics(statistics: Sequence[Statistic], path: Path) -> None:
    """Write the statistics of a campaign: ``.csv`` with a row for each number, ``.tex`` with a row for a parameter."""
    if path.suffix.lower() == ".tex":
        _write_text(path, _latex_statistics(statistics))
    else:
        write_csv(path, STATISTIC_HEADER, ([getattr(one, name) for name in STATISTIC_HEADER] for one in statistics))


def summarise(statistics: Sequence[Statistic]) -> tuple[list[str], list[list[str]]]:
    """Header and rows for people: median (10 %, 90 %) of each parameter in each group, fits with their intervals."""
    groups = list(dict.fromkeys(one.group for one in statistics))
    known = {(one.group, one.parameter, one.statistic): one for one in statistics}
    lines = {(one.parameter, one.statistic): one for one in statistics if _is_summarised(one)}
    rows = []
    for (parameter, statistic), line in lines.items():
        scale, unit = READ_IN.get(line.unit, (1.0, line.unit))
        cells = []
        for group in groups:
            one = known.get((group, parameter, statistic))
            ends: list[float] = []
            if one is not None:
                ends = [one.low, one.high]
                if statistic == "median":
                    ends = [known[group, parameter, part].value for part in ("p10", "p90")]
            cells.append("" if one is None else _with_ends(one.value * scale, [end * scale for end in ends]))
        label = f"{parameter} {statistic}" if statistic != "median" else parameter
        rows.append([label, unit, *cells, line.definition.partition("; from ")[0]])
    return ["median (10 %, 90 %); fit (95 % interval)", "unit", *groups, "definition"], rows


def _is_summarised(one: Statistic) -> bool:
    return one.statistic == "median" or one.parameter not in PARAMETERS


def _with_ends(value: float, ends: Sequence[float]) -> str:
    return f"{value:.4g}" + ("" if np.isnan(ends).any() else f" ({ends[0]:.4g}, {ends[1]:.4g})")


def flat_columns(parameters: xr.Dataset) -> tuple[list[str], list[list[object]]]:
    """Header and columns of a table of positions; a position in space is three columns."""
    header, columns = ["position"], [parameters["position"].values.tolist()]
    first = ["los", "tx_position", "rx_position", "distance", "frequency"]
    for name in [*first, *(str(other) for other in parameters.data_vars if other not in first)]:
        variable = parameters[name]
        if "xyz" in variable.dims:
            header += [f"{name[:2]}_{axis}" for axis in "xyz"]
            columns += variable.values.T.tolist()
        else:
            header.append(name)
            columns.append(variable.values.tolist())
    los = header.index("los")
    columns[los] = ["" if flag < 0 else flag for flag in columns[los]]
    return header, columns


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table; NaN is blank."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: object) -> object:
    if not isinstance(value, float):
        return value
    return "" if np.isnan(value) else f"{value:z.9g}"


def _write_text(path: Path, lines: Iterable[str]) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join([*lines, ""]), encoding="utf-8")


def _latex_positions(parameters: xr.Dataset) -> Iterable[str]:
    """Lines of a tabular for booktabs, and its definition as a comment."""
    units = [SCALES[PARAMETERS[name].unit][1] for name in PRINTED]
    heads = [_bracketed(PARAMETERS[name].text, unit) for name, unit in zip(PRINTED, units, strict=True)]
    defined = {PARAMETERS[name].text: PARAMETERS[name].definition for name in PRINTED}
    yield from _definitions(np.unique(parameters["definition"].values).tolist(), defined)
    yield rf"\begin{{tabular}}{{ll{'r' * (len(PRINTED) + 1)}}}"
    yield r"\toprule"
    yield " & ".join(["Position", "", "Distance [m]", *heads]) + r" \\"
    yield r"\midrule"
    for i, name in enumerate(parameters["position"].values.tolist()):
        row = parameters.isel(position=i)
        cells = [_escaped(name), LINES_OF_SIGHT[int(row["los"])], f"{float(row['distance']):.1f}"]
        for parameter in PRINTED:
            std = float(row[f"{parameter}_std"]) if f"{parameter}_std" in row else float("nan")
            cells.append(_number(float(row[parameter]), PARAMETERS[parameter].unit, std))
        yield " & ".join(cells) + r" \\"
    yield r"\bottomrule"
    yield r"\end{tabular}"


def _latex_statistics(statistics: Sequence[Statistic]) -> Iterable[str]:
    """Lines of a tabular: median (10 %, 90 %) of each parameter in each group, then the fits with their intervals."""
    groups = list(dict.fromkeys(one.group for one in statistics))
    names = list(dict.fromkeys(one.parameter for one in statistics))
    known = {(one.group, one.parameter, one.statistic): one for one in statistics}
    parts = {one.parameter: one.definition.partition("; from ") for one in statistics}
    defined = {
        PARAMETERS[name].text if name in PARAMETERS else name.replace("_", " "): definition
        for name, (definition, _, _) in parts.items()
    }
    yield from _definitions(dict.fromkeys(f"from {how}" for _, _, how in parts.values()), defined)
    yield rf"\begin{{tabular}}{{l{'r' * len(groups)}}}"
    yield r"\toprule"
    yield " & ".join(["Median (10 \\%, 90 \\%)", *groups]) + r" \\"
    yield r"\midrule"
    for name in (name for name in names if name in PARAMETERS):
        about = PARAMETERS[name]
        cells = [_bracketed(about.text, SCALES[about.unit][1])]
        for group in groups:
            three = [known.get((group, name, part)) for part in ("median", "p10", "p90")]
            middle, low, high = ("" if one is None else _number(one.value, about.unit) for one in three)
            cells.append(f"{middle} ({low}, {high})" if middle else "")
        yield " & ".join(cells) + r" \\"
    yield r"\midrule"
    for name in (name for name in names if name not in PARAMETERS):
        for part in ("intercept", "exponent", "shadowing"):
            ones = [known.get((group, name, part)) for group in groups]
            unit = next((one.unit for one in ones if one is not None), "1")
            label = f"{name.replace('_', ' ')}: {part}"
            yield " & ".join([_bracketed(label, SCALES[unit][1]), *map(_with_interval, ones)]) + r" \\"
    yield r"\bottomrule"
    yield r"\end{tabular}"


def _definitions(selections: Iterable[str], defined: Mapping[str, str]) -> Iterable[str]:
    """Comments of LaTeX that say what the numbers are."""
    for selection in selections:
        yield f"% {selection}"
    for text, definition in defined.items():
        yield f"% {text}: {definition}"


def _with_interval(one: Statistic | None) -> str:
    if one is None:
        return ""
    number = _number(one.value, one.unit)
    if np.isnan(one.low):
        return number
    return f"{number} [{_number(one.low, one.unit)}, {_number(one.high, one.unit)}]"


def _number(value: float, unit: str, std: float = float("nan")) -> str:
    """Number scaled for people, with two digits of its error if that is known; blank if it is not known."""
    if np.isnan(value):
        return "--"
    if np.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    scale = SCALES[unit][0]
    if unit == "1" and value == int(value):
        return f"{value:.0f}"
    if not std > 0 or np.isinf(std):
        return f"${value * scale:.{2 if unit == '1' else 1}f}$"
    digits = min(max(1 - int(np.floor(np.log10(std * scale))), 0), 3)
    return rf"${value * scale:.{digits}f} \pm {std * scale:.{digits}f}$"


def _bracketed(text: str, unit: str) -> str:
    """Text of a heading with its unit, its first letter in upper case."""
    return f"{text[0].upper()}{text[1:]} [{unit}]" if unit else f"{text[0].upper()}{text[1:]}"


def _escaped(text: str) -> str:
    """Text with LaTeX's own signs escaped."""
    return "".join(f"\\{one}" if one in "&%$#_{}" else one for one in text)
