"""Select the MPCs that may be single reflections: direct path, ground, reflection loss (Algorithm 1, lines 1-10).

Every MPC keeps its row and gets its face and the reason why it is selected or not.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, get_args

import numpy as np
import numpy.typing as npt

from erm.common.constants import SAME_DELAY, c
from erm.common.errors import OptionError
from erm.geometry import vertical
from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs import elevation, standard_errors
from erm.mpcs.antenna_pairs import links
from erm.mpcs.clusters import clusters
from erm.mpcs.departures import is_no_single_reflection
from erm.mpcs.faces import elevation_excess, with_faces
from erm.mpcs.options import Threshold
from erm.mpcs.reasons import Reason
from erm.mpcs.standard_errors import SIGMAS, UNKNOWN_GAIN_STD
from erm.mpcs.survey_widths import survey_widths
from erm.mpcs.table import free_space_gain, path_length

if TYPE_CHECKING:
    import xarray as xr

BoolArray = npt.NDArray[np.bool_]

CONSISTENT_LOSS = 20.0
"""Default of ``max_reflection_loss`` for ``consistency`` [dB]; derived in `select`."""
FIXED_LOSS = 12.0
"""Default of ``max_reflection_loss`` for ``fixed`` [dB]; derived in `select`."""
TYPICAL_LOSS = 8.0
"""Loss of a reflection of unknown gain [dB]: concrete at normal incidence."""
MAX_GAIN_EXCESS = 3.0
"""Gain above that of free space up to which a path is possible [dB]: two paths in one resolution cell add up."""
DIRECT_AZIMUTH = 5.0
"""Azimuth from the transmitter up to which a path counts as direct [degree]: half a beam of 10 degrees."""
ELEVATION_TOLERANCE = 3.0
"""Deviation of elevations that is tolerated beyond their errors [degree]: a scan of few elevations is biased by 2
degrees beyond its edges, all paths alike."""
ELEVATION_STD = ELEVATION_TOLERANCE / SIGMAS
"""The same as a standard error."""


def select(
    table: "xr.Dataset",
    *,
    threshold: Threshold = "consistency",
    max_reflection_loss: float | None = None,
    delay_window: float = 5e-9,
    azimuth_window: float = 10.0,
    ground_height: float = 0.0,
    delay_std: float | None = None,
    azimuth_std: float | None = None,
    rx_std: float = 0.0,
    heading_std: float = 0.0,
    clock_std: float = 0.0,
) -> "xr.Dataset":
    """Select the MPCs that may be single reflections off vertical walls, and locate their faces.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    threshold : {"consistency", "fixed", "letter"}
        ``consistency`` keeps every MPC that may be a single reflection; `erm.reconstruct` then finds those that agree
        between positions. The other two keep only the strongest MPC of each cluster: ``fixed`` those with a reflection
        loss up to ``max_reflection_loss``, ``letter`` those with a loss below twice the smallest one of the scenario
        (Eq. 4), which one metal or glass wall makes too strict for all others.
    max_reflection_loss : float, optional
        Loss above free space [dB]. Smooth walls lose most at normal incidence: metal 0, glass 7, concrete 8,
        brick 10, plaster (n = 1.92) 10, wood 17 dB by Fresnel's equations. Default for ``consistency``: wood and
        3 dB for roughness and gain error, 20 dB. For ``fixed``: plaster and 2 dB, 12 dB; two reflections at 45 degrees
        lose 11 dB or more off concrete and plaster.
    delay_window, azimuth_window : float
        Half axes of a cluster about its strongest MPC [s], [degree].
    ground_height : float
        Height of the ground under the antennas [m].
    delay_std, azimuth_std : float
        Standard errors where the table gives none [s], [degree]. Default: estimated from the direct paths
        (`erm.mpcs.standard_errors`).
    rx_std, heading_std, clock_std : float
        Standard errors of each horizontal coordinate of a receiver [m], of the azimuth zero [degree] and of the clock
        [s] of a position. Those of delays and azimuths are widened by them (`erm.mpcs.survey_widths`), unless the table
        tells by how much: columns ``survey_delay_std`` [s] and ``survey_azimuth_std`` [degree].

    Returns
    -------
    xarray.Dataset
        The table with all four ``_std`` columns filled in and, along ``mpc``:

        - ``errors_known``: false where the errors were filled in; attributes ``errors_from`` and ``errors_count`` tell
          from what.
        - ``survey_delay_std``, ``survey_azimuth_std``: what errors of the survey add to those of delays and azimuths.
        - ``link``: index of the pair of antennas. ``cluster``: index of the cluster.
        - ``reflection_loss``, ``reflection_loss_std`` [dB], at the elevation of a path off vertical walls
          (`erm.mpcs.elevation`); for ``letter`` from the gains as measured.
        - ``accepted``, ``reason``: a value of `erm.mpcs.reasons.Reason`.
        - ``reflection_point`` (mpc, xyz) [m], ``normal`` [degree], ``offset`` [m] of a vertical face, and their
          covariances ``point_covariance`` (mpc, xyz, xyz_2) [m2] and ``line_covariance`` (mpc, parameter, parameter_2)
          of (normal, offset). NaN where the path is not longer than the direct one.
        - ``tilt``, ``tilt_std`` [degree] of a face of any slope (`erm.geometry.sloped`).
        - ``grazing``: whether the path is hardly longer than the direct one, so that these errors are unreliable.

    Raises
    ------
    OptionError
        An option has no valid value.

    Examples
    --------
    >>> import erm
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> table = erm.predict(street, (0, 0, 9), (10, -4, 2), 132e9)
    >>> selected = erm.select(table)
    >>> selected["reason"].values.tolist()
    ['direct_path', 'accepted']
    >>> selected["reflection_point"].values[1].round(2).tolist()
    [4.17, 10.0, 6.08]
    """
    if threshold not in get_args(Threshold):
        raise OptionError(f"threshold {threshold!r}; expected one of {', '.join(get_args(Threshold))}")
    for name, value, unit in (
        ("rx_std", rx_std, "m"),
        ("heading_std", heading_std, "degree"),
        ("clock_std", clock_std, "s"),
    ):
        if not value >= 0:
            raise OptionError(f"{name} {value} {unit}; expected 0 or more")
    if max_reflection_loss is not None and not max_reflection_loss > 0:
        raise OptionError(f"max_reflection_loss {max_reflection_loss} dB; expected more than 0")
    if not np.isfinite(ground_height):
        raise OptionError(f"ground_height {ground_height} m; expected a finite number")
    table = _widened(with_errors(_with_gains(table), delay_std, azimuth_std), rx_std, heading_std, clock_std)
    link = links(table)
    cluster, strongest = clusters(table, link, delay_window=delay_window, azimuth_window=azimuth_window)
    measured = loss = reflection_loss(table)
    measured_std = loss_std = table["path_gain_std"].values
    if threshold != "letter":
        gain, loss_std = elevation.gain_at_elevation(table, elevation.vertical_face_elevation(table))
        loss = loss + table["path_gain"].values - gain
    margin, measured_margin = (2 * loss_std, 2 * measured_std) if threshold == "consistency" else (0.0, 0.0)
    direct = is_direct(table)
    if max_reflection_loss is None:
        max_reflection_loss = CONSISTENT_LOSS if threshold == "consistency" else FIXED_LOSS
    limit = letter_loss_limit(loss, link, strongest, direct) if threshold == "letter" else max_reflection_loss
    reasons: Mapping[Reason, BoolArray] = {
        Reason.DIRECT_PATH: direct,
        Reason.NOT_STRONGEST: ~strongest & (threshold != "consistency"),
        Reason.TOO_SHORT: np.isnan(
            vertical.horizontal_length(table["tx_position"], table["rx_position"], path_length(table))
        ),
        Reason.GROUND_REFLECTION: is_ground_reflection(table, ground_height),
        Reason.ABOVE_FREE_SPACE: measured + measured_margin < -MAX_GAIN_EXCESS,
        Reason.LOSS: ~(loss < limit if threshold == "letter" else loss - margin <= limit),
        # if its gain at the elevation of a vertical wall exceeds free space, it arrived from another elevation
        Reason.ELEVATION: ~fits_vertical_wall(table) | (loss + margin < -MAX_GAIN_EXCESS),
        Reason.DEPARTURE: is_no_single_reflection(table, direct),
        Reason.UNCERTAIN: (partners_by_chance(table, link) > 1) & (threshold == "consistency"),
    }
    reason = np.full(table.sizes["mpc"], Reason.ACCEPTED, dtype=object)
    for why, holds in reasons.items():
        reason[(reason == Reason.ACCEPTED) & holds] = why
    options = {
        "threshold": threshold,
        "max_reflection_loss": float(limit),
        "delay_window": delay_window,
        "azimuth_window": azimuth_window,
        "ground_height": ground_height,
        "rx_std": rx_std,
        "heading_std": heading_std,
        "clock_std": clock_std,
    }
    return (
        with_faces(table)
        .assign(
            link=("mpc", link),
            cluster=("mpc", cluster),
            reflection_loss=("mpc", loss, {"units": "dB"}),
            reflection_loss_std=("mpc", loss_std, {"units": "dB"}),
            accepted=("mpc", reason == Reason.ACCEPTED),
            reason=("mpc", reason.astype(np.str_)),
        )
        .assign_attrs(options)
    )


def reflection_loss(table: "xr.Dataset") -> FloatArray:
    """Free-space gain at the path's length minus its gain (mpc,), ``20 lg(c / (4 pi f L)) - P`` [dB]."""
    return free_space_gain(path_length(table), table["frequency"].values) - table["path_gain"].values


def is_direct(table: "xr.Dataset") -> BoolArray:
    """Whether (mpc,) MPCs arrive with the delay and azimuth of the direct path.

    The flag of line of sight is not used. Where it says that there is none, these MPCs went through or around
    something and do not locate a wall either. Where receivers are surveyed badly, a reflection off the ground or a
    ceiling has the delay of a direct path; its elevation is not that of the transmitter.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    excess = table["delay"].values - np.linalg.norm(tx - rx, axis=-1) / c
    above = np.sign(tx[:, 2] - rx[:, 2]) * table["elevation"].values
    from_other_side = above < -SIGMAS * table["elevation_std"].values
    at_elevation = fits_vertical_wall(table) & ~from_other_side
    return (np.abs(excess) < _delay_tolerance(table)) & _at_azimuth_of_transmitter(table) & at_elevation


def is_ground_reflection(table: "xr.Dataset", ground_height: float) -> BoolArray:
    """Whether (mpc,) MPCs arrive with the transmitter's azimuth and the delay of its image below the ground.

    An MPC that certainly arrives from above the horizon is none.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    height = tx[:, 2] + rx[:, 2] - 2 * ground_height
    delay = np.hypot(np.linalg.norm((tx - rx)[:, :2], axis=-1), height) / c
    near = np.abs(table["delay"].values - delay) < _delay_tolerance(table)
    from_above = table["elevation"].values > SIGMAS * table["elevation_std"].values
    return near & _at_azimuth_of_transmitter(table) & ~from_above


def fits_vertical_wall(table: "xr.Dataset") -> BoolArray:
    """Whether (mpc,) the elevation is that of a path off vertical walls, ``sin e = (z_tx - z_rx) / L``.

    The image is then as high as the transmitter, and not in or above a floor or a ceiling. The path leaves as far below
    the horizon as it arrives above it. True where the elevations are unknown.
    """
    departing = table["departure_elevation"].values + elevation.vertical_face_elevation(table)
    wrong = [
        np.abs(excess) > ELEVATION_TOLERANCE + SIGMAS * table[f"{name}_std"].values
        for name, excess in (("elevation", elevation_excess(table)), ("departure_elevation", departing))
    ]
    return ~(wrong[0] | wrong[1])


def partners_by_chance(table: "xr.Dataset", link: npt.NDArray[np.int64]) -> FloatArray:
    """Number (mpc,) of MPCs that an antenna pair has by chance within the errors of each of its MPCs.

    Within `SIGMAS` of an MPC is the area ``pi 9 s_L s_a`` of lengths and azimuths. The ``n`` MPCs of
    the pair are spread over the range ``R`` of their lengths and 360 degrees, so that
    ``n pi 9 s_L s_a / (360 R)`` of them are in it by chance. An MPC with more than one agrees with any wall.
    """
    length = path_length(table)
    count = np.bincount(link)
    longest, shortest = np.full(count.size, -np.inf), np.full(count.size, np.inf)
    np.maximum.at(longest, link, length)
    np.minimum.at(shortest, link, length)
    spread = (longest - shortest)[link] * 360.0
    gate = np.pi * SIGMAS**2 * c * table["delay_std"].values * table["azimuth_std"].values
    return count[link] * np.minimum(np.divide(gate, spread, out=np.zeros(len(gate)), where=spread > 0), 1.0)


def letter_loss_limit(loss: FloatArray, link: npt.NDArray[np.int64], strongest: BoolArray, direct: BoolArray) -> float:
    """Twice the smallest reflection loss of the scenario (Eq. 4) [dB].

    At a position with line of sight the smallest loss is that of the direct path, so the second one counts.
    """
    smallest = [np.inf]
    for one in np.unique(link):
        losses = np.sort(loss[(link == one) & strongest])
        line_of_sight = bool(np.any(direct & (link == one)))
        smallest += losses[int(line_of_sight) : int(line_of_sight) + 1].tolist()
    return 2 * min(smallest)


def _with_gains(table: "xr.Dataset") -> "xr.Dataset":
    """Return the table with unknown gains replaced by those of a typical reflection, with an error that says so."""
    gain = table["path_gain"].values
    unknown = np.isnan(gain)
    if not unknown.any():
        return table
    assumed = free_space_gain(path_length(table), table["frequency"].values) - TYPICAL_LOSS
    std = np.where(unknown, UNKNOWN_GAIN_STD, table["path_gain_std"].values)
    return table.assign(
        path_gain=("mpc", np.where(unknown, assumed, gain), table["path_gain"].attrs),
        path_gain_std=("mpc", std, table["path_gain_std"].attrs),
    )


def with_errors(table: "xr.Dataset", delay_std: float | None = None, azimuth_std: float | None = None) -> "xr.Dataset":
    """Return the table with all standard errors filled in; attributes tell from what.

    A table whose errors were filled in before is returned as it is.
    """
    if "errors_known" in table:
        return table
    found = standard_errors.errors_of_direct_paths(table)
    given = {
        "delay_std": found.delay if delay_std is None else delay_std,
        "azimuth_std": found.azimuth if azimuth_std is None else azimuth_std,
        "elevation_std": found.elevation,
        "path_gain_std": 0.0,
        "departure_azimuth_std": standard_errors.ASSUMED.azimuth,
        "departure_elevation_std": standard_errors.ASSUMED.elevation,
    }
    known = np.isfinite(table["delay_std"].values) & np.isfinite(table["azimuth_std"].values)
    source = "the table" if known.all() else found.source if delay_std is azimuth_std is None else "the caller"
    count = found.sample if source == found.source else 0
    return table.assign(
        {name: ("mpc", _filled(table[name].values, value), table[name].attrs) for name, value in given.items()}
        | {"errors_known": ("mpc", known)}
    ).assign_attrs(errors_from=source, errors_count=count)


def _filled(values: FloatArray, value: float) -> FloatArray:
    return np.where(np.isnan(values), value, values)


def _widened(table: "xr.Dataset", rx_std: float, heading_std: float, clock_std: float) -> "xr.Dataset":
    """Return the table with standard errors widened for errors of positions, and these widths as columns."""
    if "survey_delay_std" not in table:
        covariance = np.diag([rx_std, rx_std, heading_std, clock_std * c])[None] ** 2
        height = table["tx_position"].values[:, 2] - table["rx_position"].values[:, 2]
        length, azimuth = survey_widths(path_length(table), height, table["azimuth"].values, covariance)
        table = table.assign(
            survey_delay_std=("mpc", length / c, {"units": "s"}),
            survey_azimuth_std=("mpc", azimuth, {"units": "degree"}),
        )
    return table.assign(
        {
            name: ("mpc", np.hypot(table[name].values, table[f"survey_{name}"].values), table[name].attrs)
            for name in ("delay_std", "azimuth_std")
        }
    )


def _delay_tolerance(table: "xr.Dataset") -> FloatArray:
    """Difference (mpc,) up to which a delay is equal to a predicted one [s]."""
    return np.maximum(SAME_DELAY, SIGMAS * table["delay_std"].values)


def _at_azimuth_of_transmitter(table: "xr.Dataset") -> BoolArray:
    """Whether (mpc,) MPCs arrive from the direction of the transmitter, seen from above."""
    azimuth = vertical.azimuth_of(table["tx_position"].values - table["rx_position"].values)
    tolerance = np.maximum(DIRECT_AZIMUTH, SIGMAS * table["azimuth_std"].values)
    return np.abs(angle_difference(table["azimuth"].values, azimuth)) < tolerance
