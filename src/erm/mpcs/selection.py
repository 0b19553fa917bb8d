"""Which components are single reflections: clusters, reflection loss, direct path (Algorithm 1, lines 1-10).

Every component keeps its row; it gains its face and the reason for which it was taken or left.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, get_args

import numpy as np
import numpy.typing as npt

from erm.common.constants import c
from erm.common.errors import OptionError
from erm.geometry import vertical
from erm.geometry.sloped import sloped_covariance, sloped_face
from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs import elevation, standard_errors
from erm.mpcs.clusters import clusters
from erm.mpcs.options import Threshold
from erm.mpcs.reasons import Reason
from erm.mpcs.table import free_space_gain, path_length

if TYPE_CHECKING:
    import xarray as xr

BoolArray = npt.NDArray[np.bool_]

CONSISTENT_LOSS = 20.0  # dB; see `select`
MAX_REFLECTION_LOSS = 12.0  # dB; see `select`
GAIN_EXCESS = 3.0  # dB; two paths in one resolution cell may add up to more than free space
DIRECT_DELAY = 1e-9  # s; below this excess a face is tangent to the direct path and cannot be located
DIRECT_AZIMUTH = 5.0  # degree; half a beam
SURELY_LONGER = 3.0  # standard errors by which a path must be longer than the direct one
ELEVATION_TOLERANCE = 3.0  # degree beyond the errors; a scan of few elevations is biased at its edge
FACE_COLUMNS = (
    *("normal", "offset", "tilt", "tilt_std", "grazing"),
    *("reflection_point", "point_covariance", "line_covariance"),
)
"""Columns of `with_faces`."""


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
) -> "xr.Dataset":
    """Choose the components that may be single bounces off vertical faces, and locate these.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.mpcs.table`).
    threshold : {"consistency", "fixed", "letter"}
        ``consistency`` keeps all that a single bounce can be, and leaves it to `erm.reconstruction.reconstruct` to see
        which of them agree between positions. The other two take the strongest component of each cluster only:
        ``fixed`` keeps reflection losses up to ``max_reflection_loss``, ``letter`` losses below twice the smallest of
        the scenario (Eq. 4), which one metal or glass face makes too strict for all others.
    max_reflection_loss : float, optional
        Loss beyond free space [dB]. Smooth faces lose most at normal incidence: metal 0, glass 7, concrete 8,
        brick 10, plaster (n = 1.92) 10, wood 17 dB by Fresnel's equations. Default for ``consistency``: wood and
        3 dB for roughness and gain error, 20 dB. For ``fixed``: plaster and 2 dB, 12 dB; two bounces at 45 degrees
        lose 11 dB or more off concrete and plaster.
    delay_window, azimuth_window : float
        Half axes of a cluster about its strongest component [s], [degree].
    ground_height : float
        Height of the ground under the antennas [m].
    delay_std, azimuth_std : float
        Standard errors where the table gives none [s], [degree]. Default: those that the direct paths show
        (`erm.mpcs.standard_errors`).
    rx_std : float
        Standard error of each coordinate of the receivers [m], to which those of delays and azimuths are widened: a
        receiver that stands ``e`` off sees a path longer by ``u.e``, ``u`` the direction away from its arrival, and
        turned by ``e`` across it over the horizontal length. A wall has one path a receiver, so that its paths' errors
        are independent; that those of several walls at one receiver are not is not used.

    Returns
    -------
    xarray.Dataset
        The table with all four ``_std`` columns filled in and, along ``mpc``:
        ``errors_known`` (false where they were filled in), ``link`` (index of the pair of antennas), ``cluster``,
        ``reflection_loss`` and ``reflection_loss_std`` [dB], given that the elevation is that of a path off vertical
        faces (`erm.mpcs.elevation`; ``letter`` takes gains as measured), ``accepted``, ``reason``, ``reflection_point``
        (mpc, xyz) [m], ``normal`` [degree], ``offset`` [m], ``point_covariance`` (mpc, xyz, xyz_2) [m2] and
        ``line_covariance`` (mpc, parameter, parameter_2) of (normal, offset), all of a vertical face; ``tilt`` and
        ``tilt_std`` [degree] of the face, had it any slope (`erm.geometry.sloped`); and ``grazing`` where the path is
        hardly longer than the direct one, so that these errors mean little. Attributes ``errors_from`` and
        ``errors_count`` say what they were filled in from. The face is NaN where the path is not longer than the direct
        one.
    """
    if threshold not in get_args(Threshold):
        raise OptionError(f"threshold {threshold!r}; expected one of {', '.join(get_args(Threshold))}")
    if not rx_std >= 0:
        raise OptionError(f"rx_std {rx_std} m; expected 0 or more")
    if max_reflection_loss is not None and not max_reflection_loss > 0:
        raise OptionError(f"max_reflection_loss {max_reflection_loss} dB; expected more than 0")
    if not np.isfinite(ground_height):
        raise OptionError(f"ground_height {ground_height} m; expected a finite number")
    table = _widened(_with_errors(table, delay_std, azimuth_std), rx_std)
    link = links(table)
    cluster, strongest = clusters(table, link, delay_window=delay_window, azimuth_window=azimuth_window)
    measured = loss = reflection_loss(table)
    measured_std = loss_std = table["path_gain_std"].values
    if threshold != "letter":
        gain, loss_std = elevation.gain_at_elevation(table, elevation.vertical_face_elevation(table))
        loss = loss + table["path_gain"].values - gain
    doubt, measured_doubt = (2 * loss_std, 2 * measured_std) if threshold == "consistency" else (0.0, 0.0)
    direct = is_direct(table)
    if max_reflection_loss is None:
        max_reflection_loss = CONSISTENT_LOSS if threshold == "consistency" else MAX_REFLECTION_LOSS
    limit = letter_limit(loss, link, strongest, direct) if threshold == "letter" else max_reflection_loss
    reasons: Mapping[Reason, BoolArray] = {
        Reason.DIRECT_PATH: direct,
        Reason.NOT_STRONGEST: ~strongest & (threshold != "consistency"),
        Reason.TOO_SHORT: np.isnan(
            vertical.horizontal_length(table["tx_position"], table["rx_position"], path_length(table))
        ),
        Reason.GROUND_REFLECTION: is_ground_bounce(table, ground_height),
        Reason.ABOVE_FREE_SPACE: measured + measured_doubt < -GAIN_EXCESS,
        Reason.LOSS: ~(loss < limit if threshold == "letter" else loss - doubt <= limit),
        # from that elevation it would be stronger than free space allows: it arrived from elsewhere
        Reason.ELEVATION: ~fits_vertical_face(table) | (loss + doubt < -GAIN_EXCESS),
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


def links(table: "xr.Dataset") -> npt.NDArray[np.int64]:
    """Index (mpc,) of the TX-RX pair of each component, numbered as they first appear."""
    ends = np.hstack([table["tx_position"].values, table["rx_position"].values])
    first, place = vertical.distinct_rows(ends)
    return np.argsort(np.argsort(first))[place]


def reflection_loss(table: "xr.Dataset") -> FloatArray:
    """Free-space gain at the path's length minus its gain (mpc,), ``20 lg(c / (4 pi f L)) - P`` [dB]."""
    return free_space_gain(path_length(table), table["frequency"].values) - table["path_gain"].values


def is_direct(table: "xr.Dataset") -> BoolArray:
    """Components (mpc,) that arrive at the delay and bearing of the direct path.

    They are found by geometry whether the table flags line of sight or not; where it says there is none they
    went through or around something, and locate no face either.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    early_enough = np.abs(table["delay"].values - np.linalg.norm(tx - rx, axis=-1) / c) < np.maximum(
        DIRECT_DELAY, 3 * table["delay_std"].values
    )
    return early_enough & _at_bearing_of_transmitter(table)


def is_ground_bounce(table: "xr.Dataset", ground_height: float) -> BoolArray:
    """Components (mpc,) at the transmitter's bearing and the delay of its image below the ground.

    A path that is known to arrive from above the horizon is none.
    """
    tx, rx = table["tx_position"].values, table["rx_position"].values
    climb = tx[:, 2] + rx[:, 2] - 2 * ground_height
    delay = np.hypot(np.linalg.norm((tx - rx)[:, :2], axis=-1), climb) / c
    near = np.abs(table["delay"].values - delay) < np.maximum(DIRECT_DELAY, 3 * table["delay_std"].values)
    from_above = table["elevation"].values > 3 * table["elevation_std"].values
    return near & _at_bearing_of_transmitter(table) & ~from_above


def fits_vertical_face(table: "xr.Dataset") -> BoolArray:
    """Components (mpc,) whose elevation is that of a path off vertical faces, ``sin e = (z_tx - z_rx) / L``.

    That is: whose image is as high as the transmitter, and not in or above a floor or a ceiling. True where the
    elevation is unknown.
    """
    return ~(np.abs(rise(table)) > ELEVATION_TOLERANCE + 3 * table["elevation_std"].values)


def rise(table: "xr.Dataset") -> FloatArray:
    """Elevation (mpc,) less that of a path off vertical faces [degree]; NaN where it is unknown."""
    return np.asarray(table["elevation"].values - elevation.vertical_face_elevation(table))


def letter_limit(loss: FloatArray, link: npt.NDArray[np.int64], strongest: BoolArray, direct: BoolArray) -> float:
    """Twice the smallest reflection loss of the scenario (Eq. 4) [dB].

    At a position with line of sight the smallest loss is that of the direct path, so the second one counts.
    """
    smallest = [np.inf]
    for one in np.unique(link):
        losses = np.sort(loss[(link == one) & strongest])
        in_sight = bool(np.any(direct & (link == one)))
        smallest += losses[int(in_sight) : int(in_sight) + 1].tolist()
    return 2 * min(smallest)


def _with_errors(table: "xr.Dataset", delay_std: float | None, azimuth_std: float | None) -> "xr.Dataset":
    """The table with every standard error filled in, and what it was filled with in the attributes."""
    found = standard_errors.errors_of_direct_paths(table)
    given = {
        "delay_std": found.delay if delay_std is None else delay_std,
        "azimuth_std": found.azimuth if azimuth_std is None else azimuth_std,
        "elevation_std": found.elevation,
        "path_gain_std": 0.0,
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


def _widened(table: "xr.Dataset", rx_std: float) -> "xr.Dataset":
    """The table with the standard errors that uncertain places of the receivers make of those it has."""
    climb = table["tx_position"].values[:, 2] - table["rx_position"].values[:, 2]
    level = np.sqrt(np.maximum(path_length(table) ** 2 - climb**2, rx_std**2))  # under a mast there is no azimuth
    turned = np.rad2deg(np.divide(rx_std, level, out=np.zeros_like(level), where=level > 0))
    wider = {"delay_std": rx_std / c, "azimuth_std": turned}
    return table.assign({name: ("mpc", np.hypot(table[name].values, more)) for name, more in wider.items()})


def _at_bearing_of_transmitter(table: "xr.Dataset") -> BoolArray:
    """Components (mpc,) that arrive from where the transmitter is, seen from above."""
    bearing = vertical.azimuth_of(table["tx_position"].values - table["rx_position"].values)
    tolerance = np.maximum(DIRECT_AZIMUTH, 3 * table["azimuth_std"].values)
    return np.abs(angle_difference(table["azimuth"].values, bearing)) < tolerance


def with_faces(table: "xr.Dataset") -> "xr.Dataset":
    """The table with the face of each component, were it a single bounce; vertical, and its tilt, were it not."""
    tx, rx = table["tx_position"].values, table["rx_position"].values
    path = (tx, rx, path_length(table), table["azimuth"].values)
    std = (table["delay_std"].values * c, table["azimuth_std"].values)
    point, normal = vertical.reflection_point(*path)
    _, offset = vertical.face_line(*path)
    in_space = (*path, table["elevation"].values)
    errors = np.stack([*std, table["elevation_std"].values], axis=-1)[:, :, None] ** 2 * np.eye(3)
    _, slope = sloped_covariance(*in_space, errors)
    excess = path[2] - np.linalg.norm(tx - rx, axis=-1)
    columns = {
        "normal": (normal, "degree", "azimuth of the face normal"),
        "offset": (offset, "m", "distance of the face from the origin along its normal"),
        "tilt": (sloped_face(*in_space).tilt, "degree", "elevation of the face normal, were the face of any slope"),
        "tilt_std": (np.sqrt(slope[:, 1, 1]), "degree", "standard deviation of the tilt"),
        "grazing": (
            ~(excess > SURELY_LONGER * std[0]),
            "1",
            "hardly longer than the direct path: a face of no use alone",
        ),
    }
    return table.assign(
        {name: ("mpc", values, {"units": unit, "long_name": text}) for name, (values, unit, text) in columns.items()}
        | {
            "reflection_point": (
                ("mpc", "xyz"),
                np.column_stack([point, vertical.bounce_height(*path)]),
                {"units": "m", "long_name": "reflection point if the path bounced once"},
            ),
            "point_covariance": (("mpc", "xyz", "xyz_2"), vertical.point_covariance(*path, *std), {"units": "m2"}),
            "line_covariance": (("mpc", "parameter", "parameter_2"), vertical.line_covariance(*path, *std)),
        }
    )
