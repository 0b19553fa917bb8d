"""Errors of the positions of a table: what was removed from it, and what remains uncertain of each."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from erm.common.constants import c
from erm.common.odds import THOUSAND_TO_ONE
from erm.geometry.vertical import FloatArray
from erm.mpcs.antenna_pairs import distinct_rows
from erm.mpcs.standard_errors import SIGMAS
from erm.mpcs.survey_widths import survey_widths
from erm.mpcs.table import path_length
from erm.survey.bundle import Bundle, SurveyStd, adjust, by_error
from erm.survey.calibration import FEWEST_DIRECT
from erm.survey.direct_paths import LEAST_EVIDENCE, SPREADS, direct_paths_at
from erm.survey.observations import Observations
from erm.survey.residuals import CLOCK, HEADING, IntArray, MeasuredPaths
from erm.survey.restart import NO_FACES, Restarted

if TYPE_CHECKING:
    import xarray as xr

TOLERANCE = 0.1
"""Change of what a path should be, in its own standard errors, that changes no map. Chosen; not derived."""


@dataclass(frozen=True)
class PositionErrors:
    """Errors of each position, and those of paths.

    Parameters
    ----------
    number : array (mpc,) of int
        Position of each MPC: one name at one place of the receiver.
    first : array (position,) of int
        First MPC of each position.
    errors : array (position, 4)
        True minus surveyed east and north [m], measured minus true heading [degree] and clock [m].
    covariance : array (position, 4, 4)
        Of the true errors about these.
    own_covariance : array (position, 4, 4)
        Without the errors that all positions share: paths off one wall agree whatever these are.
    given : SurveyStd
        Standard deviations of the errors that are known.
    common : bool
        Whether all positions may share an error of heading and of clock.
    clock_doubt : float
        Standard deviation [m] of this error among clocks at which other paths belong together: an adjustment, which is
        told what belongs together, does not see them.
    errors_known : bool
        Whether the table gives all standard errors of delays and azimuths.
    scale : array (2,)
        Factors of these standard errors.
    adjusted : Bundle, optional
        The adjustment of faces that has estimated them.
    """

    number: IntArray
    first: IntArray
    errors: FloatArray
    covariance: FloatArray
    own_covariance: FloatArray
    given: SurveyStd
    common: bool
    errors_known: bool
    scale: FloatArray
    clock_doubt: float = 0.0
    adjusted: Bundle | None = None

    @classmethod
    def none(cls, table: "xr.Dataset", given: SurveyStd, *, common: bool = False) -> "PositionErrors":
        """Positions that are as surveyed, to the standard deviations that are given."""
        _, name = np.unique(table["position"].values, return_inverse=True)
        first, number = distinct_rows(np.column_stack([name, table["rx_position"].values]))
        variance = np.square(by_error(np.array([std or 0.0 for std in given.known()])))
        covariance = np.tile(np.diag(variance), (len(first), 1, 1))
        known = bool(table["errors_known"].values.all())
        return cls(number, first, np.zeros((len(first), 4)), covariance, covariance, given, common, known, np.ones(2))

    @property
    def inexact(self) -> bool:
        """Whether positions may have errors."""
        return self.common or any(std is None or std > 0 for std in self.given.known())

    def at_clock(self, clock: float) -> "PositionErrors":
        """The same with a clock [m] that all positions share."""
        return replace(self, errors=self.errors + np.array([0.0, 0.0, 0.0, clock]))

    def updated(self, found: Bundle) -> "PositionErrors":
        """Errors that an adjustment of faces found."""
        return replace(
            self,
            errors=found.errors,
            covariance=found.covariance,
            own_covariance=found.own_covariance,
            scale=found.scale,
            adjusted=found,
        )

    def restarted(self, found: Restarted) -> "PositionErrors":
        """The errors of a new start where they are a thousand times more likely.

        Where both are likely, the covariance covers both: the one that is not kept adds its probability times the
        square of its difference.
        """
        new = found.log_odds > THOUSAND_TO_ONE
        other = expit(np.where(new, -found.log_odds, found.log_odds))
        added = other[:, None, None] * found.apart[:, :, None] * found.apart[:, None, :]
        covariance, own = (
            np.where(new[:, None, None], found.covariance, before) + added
            for before in (self.covariance, self.own_covariance)
        )
        errors = np.where(new[:, None], found.errors, self.errors)
        return replace(self, errors=errors, covariance=covariance, own_covariance=own)

    def corrected(self, table: "xr.Dataset") -> "xr.Dataset":
        """Remove the errors from a table, and tell by how much the rest widens the errors of its MPCs.

        Columns ``survey_delay_std`` [s] and ``survey_azimuth_std`` [degree] hold the latter; `erm.select` adds them.
        """
        errors = self.errors[self.number]
        rx = table["rx_position"].values.copy()
        rx[:, :2] += errors[:, :2]
        length_std, azimuth_std = _widths(table, self.own_covariance[self.number])
        return table.assign(
            rx_position=(("mpc", "xyz"), rx, table["rx_position"].attrs),
            delay=("mpc", table["delay"].values - errors[:, CLOCK] / c, table["delay"].attrs),
            azimuth=("mpc", (table["azimuth"].values - errors[:, HEADING]) % 360, table["azimuth"].attrs),
            delay_std=("mpc", table["delay_std"].values * self.scale[0], table["delay_std"].attrs),
            azimuth_std=("mpc", table["azimuth_std"].values * self.scale[1], table["azimuth_std"].attrs),
            errors_known=("mpc", table["errors_known"].values | (self.adjusted is not None)),
            survey_delay_std=("mpc", length_std / c, {"units": "s"}),
            survey_azimuth_std=("mpc", azimuth_std, {"units": "degree"}),
        )

    def described(self, table: "xr.Dataset") -> "xr.Dataset":
        """Return a table with its positions without their errors, and these, along ``survey_position``.

        Attributes ``heading_error`` and ``clock_error``, what a calibration removed before, are added to the errors.
        Attributes ``adjusted_heading`` [degree] and ``adjusted_clock`` [s] with ``_std`` are the errors that all
        positions share, if the adjustment showed them.
        """
        std = np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))
        rows = ("survey_position",)
        heading, clock = (table.attrs.get(f"{name}_error", 0.0) for name in ("heading", "clock"))
        unit = np.array([1.0, 1.0, 1.0, 1 / c])
        if self.adjusted is not None and self.common:
            shared, shared_std = self.adjusted.common, np.sqrt(np.diag(self.adjusted.common_covariance))
            table = table.assign_attrs(
                adjusted_heading=float(shared[0] + heading),
                adjusted_heading_std=float(shared_std[0]),
                adjusted_clock=float(shared[1] / c + clock),
                adjusted_clock_std=float(shared_std[1] / c),
            )
        return table.assign(
            survey_name=(rows, table["position"].values[self.first].astype(object)),
            survey_rx=((*rows, "xyz"), table["rx_position"].values[self.first], {"units": "m"}),
            survey_rx_correction=((*rows, "xy"), self.errors[:, :2], {"units": "m"}),
            survey_heading=(rows, self.errors[:, HEADING] + heading, {"units": "degree"}),
            survey_clock=(rows, self.errors[:, CLOCK] / c + clock, {"units": "s"}),
            survey_rx_std=((*rows, "xy"), std[:, :2], {"units": "m"}),
            survey_heading_std=(rows, std[:, HEADING], {"units": "degree"}),
            survey_clock_std=(rows, std[:, CLOCK] / c, {"units": "s"}),
            survey_covariance=(
                (*rows, "error", "error_2"),
                self.covariance * unit[:, None] * unit,
                {"long_name": "covariance of east [m], north [m], heading [degree] and clock [s]"},
            ),
        )

    def contradicts(self, other: "PositionErrors") -> bool:
        """Whether an adjustment found another common clock than another one did."""
        if self.adjusted is None or other.adjusted is None:
            return False
        std = np.hypot(self.adjusted.clock_std, other.adjusted.clock_std)
        return bool(abs(self.adjusted.common[1] - other.adjusted.common[1]) > SIGMAS * std)

    def moves(self, other: "PositionErrors", table: "xr.Dataset") -> bool:
        """Whether other errors of the positions make paths of a table clearly different."""
        change = self.errors - other.errors
        squares = change[:, :, None] * change[:, None, :]
        length, azimuth = _widths(table, squares[self.number])
        length, azimuth = length / (table["delay_std"].values * c), azimuth / table["azimuth_std"].values
        return bool(np.maximum(length, azimuth).max(initial=0.0) > TOLERANCE)


def from_direct_paths(
    table: "xr.Dataset", given: SurveyStd, *, common: bool = False, clock_doubt: float = 0.0
) -> PositionErrors:
    """Errors of positions as their direct paths show them; the start of a search for walls.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table with all standard errors (`erm.mpcs.selection.with_errors`).
    given, common, clock_doubt
        See `PositionErrors`.
    """
    start = replace(PositionErrors.none(table, given, common=common), clock_doubt=clock_doubt)
    if not table.sizes["mpc"]:
        return start
    seen = Observations.of(table)
    direct = max((direct_paths_at(seen, 0.0, 0.0, spreads) for spreads in SPREADS), key=lambda one: one.evidence)
    rows = np.flatnonzero(direct.weight > 0.5)
    if len(rows) < FEWEST_DIRECT or direct.evidence < LEAST_EVIDENCE * len(rows):
        return start
    tx, rx = table["tx_position"].values[rows], table["rx_position"].values[rows]
    paths = MeasuredPaths(
        tx[:, :2],
        rx[:, :2],
        tx[:, 2] - rx[:, 2],
        np.column_stack([path_length(table)[rows], table["azimuth"].values[rows]]),
        np.column_stack([table["delay_std"].values[rows] * c, table["azimuth_std"].values[rows]]),
        start.number[rows],
        np.empty((len(rows), 0), dtype=np.int64),
    )
    found = adjust(paths, NO_FACES, len(start.first), given, common=common)
    return replace(start, errors=found.errors, covariance=found.covariance, own_covariance=found.own_covariance)


def _widths(table: "xr.Dataset", covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (mpc,) of lengths [m] and azimuths [degree] for covariances (mpc, 4, 4)."""
    height = table["tx_position"].values[:, 2] - table["rx_position"].values[:, 2]
    return survey_widths(path_length(table), height, table["azimuth"].values, covariance)
