"""The letter's numbers, one per row: as printed, from its printed data, by its method, and by our method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from erm.common.page import Page
from erm.evaluation.outline import summary
from erm.geometry.vertical import FloatArray
from erm.letter import corridor, published
from erm.letter.methods import MERGED, PLANAR
from erm.letter.room import Sensed
from erm.letter.routes import Study

TARGET = 0.01  # m; largest difference of a recomputed number from the printed one; the print has two decimals
MISSING = float("nan")
ROOM_NAMES = {"rmse": "RMSE", "small": "share under 0.02 m"}


@dataclass(frozen=True)
class Row:
    """One number.

    Parameters
    ----------
    where : str
        Place in the letter.
    quantity, unit : str
    printed : float
    recomputed : float
        From data that the letter prints.
    planar, merged : float
        From the twin's captures by the letter's planar method and by our merged walls.
    """

    where: str
    quantity: str
    unit: str
    printed: float
    recomputed: float = MISSING
    planar: float = MISSING
    merged: float = MISSING

    @property
    def label(self) -> str:
        """Quantity with its unit."""
        return f"{self.quantity} [{self.unit}]" if self.unit else self.quantity


def rows(sensed: Sensed, by_route: Mapping[str, Mapping[str, FloatArray]], inside: Study) -> list[Row]:
    """Collect every number of the letter's results.

    Parameters
    ----------
    sensed : Sensed
        The room, from captures with thermal noise.
    by_route : mapping
        From `erm.letter.routes.errors_by_route`.
    inside : Study
        Of `erm.letter.corridor.from_inside`.
    """
    method = {row.label: row.statistics for row in sensed.rows}
    room = {name: (method[PLANAR][name], method[MERGED][name]) for name in published.ROOM_ERRORS}
    found = [
        Row(
            "Fig. 2",
            ROOM_NAMES.get(name, name),
            "" if name == "small" else "m",
            printed,
            planar=room[name][0],
            merged=room[name][1],
        )
        for name, printed in published.ROOM_ERRORS.items()
    ]
    known = {scenario: summary(values) for scenario, values in published.errors().items()}
    for route, column in published.COLUMN_OF_ROUTE.items():
        methods = {name: summary(values) for name, values in by_route[route].items()}
        where = f"Table 3, {column}"
        for name, statistic in (*published.STATISTICS.items(), ("true RMSE", "rmse")):
            quantity = "std (printed as RMSE)" if name == "RMSE" else name
            found.append(
                Row(
                    where,
                    quantity,
                    "m",
                    published.TABLE_3[column].get(name, MISSING),
                    known.get(column, {}).get(statistic, MISSING),
                    methods[PLANAR][statistic],
                    methods[MERGED][statistic],
                )
            )
    width = corridor.width_of(inside.environment)
    found.append(Row("Fig. 4a", "width of the corridor", "m", 14.9, corridor.PRINTED_WIDTH, merged=width))
    return found


def parity(page: Page, table: Sequence[Row]) -> None:
    """Write the table of the letter's numbers beside ours."""
    page.add(
        "## Parity",
        "Each number of the letter's results: as printed; recomputed from data that the letter prints; by the letter's "
        "planar method and by our merged walls, both from the same simulated captures. Experiments in the sections "
        "below show why the columns differ.",
    )
    page.table(
        ["in the letter", "quantity", "printed", "from its printed data", "its method here", "ours, merged"],
        [[one.where, one.label, one.printed, one.recomputed, one.planar, one.merged] for one in table],
    )
    tabulated = [one for one in table if one.where.startswith("Table")]
    apart = [abs(one.recomputed - one.printed) for one in tabulated if np.isfinite(one.recomputed + one.printed)]
    page.add(
        f"{len(apart)} numbers of the letter's table can be recomputed from printed data; the largest difference is "
        f"{max(apart):.4f} m (target: at most {TARGET} m, {'holds' if max(apart) <= TARGET else '**missed**'}). The "
        "width of the corridor is printed to a decimetre."
    )


def as_csv(table: Sequence[Row]) -> str:
    """Return the rows as CSV, blank where a number does not exist."""
    names = ("printed", "recomputed", "planar_method", "merged")
    lines = [
        ",".join(
            [
                f'"{one.where}"',
                one.quantity,
                one.unit,
                *map(_cell, (one.printed, one.recomputed, one.planar, one.merged)),
            ]
        )
        for one in table
    ]
    return "\n".join([",".join(("where", "quantity", "unit", *names)), *lines]) + "\n"


def _cell(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""
