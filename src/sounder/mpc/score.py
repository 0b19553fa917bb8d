"""Score of MPCs against the true paths: detected paths, false MPCs, errors, and errors over standard deviations."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from erm.common.errors import OptionError
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.mpc.cramer_rao import UNITS
from sounder.mpc.directions import beam_directions, beam_gains, wrap

Real = NDArray[np.float64]
OUTSIDE_COST = 1e6
"""Cost of a pair outside the gates: more than all pairs inside them together."""


@dataclass(frozen=True)
class Gates:
    """Largest differences between an MPC and its path; infinite where any difference is allowed.

    The defaults are the resolution of the 132 GHz sounder, about ``1 / bandwidth`` and half a beam. Elevation is free,
    because it is not known outside the fan.

    Attributes
    ----------
    delay : float
        [s]
    azimuth, elevation : float
        [degree]
    path_gain : float
        [dB]
    """

    delay: float = 1e-9
    azimuth: float = 5.0
    elevation: float = np.inf
    path_gain: float = 10.0

    def __post_init__(self) -> None:
        for name, gate in asdict(self).items():
            if not gate > 0:
                raise OptionError(f"gate of {name} is {gate:g}; expected more than 0")


@dataclass(frozen=True)
class Score:
    """True paths and MPCs with their matches.

    Attributes
    ----------
    paths : xarray.Dataset
        Along ``path``: the true ``position``, ``delay`` [s], ``azimuth``, ``elevation`` [degree], ``path_gain`` and
        ``snr`` [dB] (NaN where not known); ``required``, whether the path must be found; ``separation`` from the next
        path, as a distance with each gate as unit; ``match``, the index of its MPC, -1 if it was not found; and of
        its MPC ``delay_error`` and so on, estimated less true, with ``delay_normalised`` and so on, the same over
        ``_std``.
    estimates : xarray.Dataset
        Along ``mpc``: the MPCs, with ``match``, the index of the path, -1 for false ones.
    gates : Gates
    """

    paths: xr.Dataset
    estimates: xr.Dataset
    gates: Gates

    @property
    def detection(self) -> float:
        """Share of the required paths that were found; NaN if there are none."""
        required = self.paths["required"].values
        return _share(self.paths["match"].values[required] >= 0)

    @property
    def false_share(self) -> float:
        """Share of the MPCs that match no path; NaN if there are none."""
        return _share(self.estimates["match"].values < 0)

    def summary(self) -> dict[str, Any]:
        """Counts, and the errors of the required paths that were found; numbers and names only.

        ``within_1_std`` and ``within_2_std`` are 0.683 and 0.954 for normal errors with right standard deviations.
        """
        required = self.paths["required"].values
        found = self.paths.isel(path=np.flatnonzero(required & (self.paths["match"].values >= 0)))
        return {
            "positions": len(np.unique(self.paths["position"].values)),
            "gates": asdict(self.gates),
            "paths": int(required.sum()),
            "found": found.sizes["path"],
            "detection": self.detection,
            "mpcs": self.estimates.sizes["mpc"],
            "false": int((self.estimates["match"].values < 0).sum()),
            "false_share": self.false_share,
            "errors": {
                name: {"unit": unit, **_errors(found[f"{name}_error"].values, found[f"{name}_normalised"].values)}
                for name, unit in UNITS.items()
            },
        }


def score(
    estimated: xr.Dataset,
    truth: xr.Dataset,
    *,
    gates: Gates | None = None,
    dynamic_range: float = 25.0,
    least_snr: float = 10.0,
    period: float | None = None,
) -> Score:
    """Match MPCs to true paths, one to one, and compare them.

    In each position the required paths are assigned to MPCs first, so that no weak neighbour takes their MPCs. Then
    the other paths are assigned to the remaining MPCs. These paths may be missed, and an MPC that matches one is not
    false. Each assignment has the largest number of pairs within the gates. Among such assignments it has the least
    sum of squared distances, in units of the gates.

    Parameters
    ----------
    estimated : xarray.Dataset
        Along ``mpc``: ``delay``, ``azimuth``, ``elevation``, ``path_gain``, their ``_std`` if known, and ``position``
        if there are several.
    truth : xarray.Dataset
        The same along any dimension, without ``_std``. May hold ``snr`` and ``beam_gain`` (from :func:`with_snr`), and
        ``required`` (bool), which takes precedence over the two rules below.
    gates : Gates, optional
        Largest differences of a match.
    dynamic_range : float
        Paths are required down to this level below the position's strongest, in the beam that sees each best [dB].
    least_snr : float
        And from this SNR on, where it is known [dB].
    period : float, optional
        Delays are known modulo this [s].

    Returns
    -------
    Score
        The matches; its ``summary()`` holds the counts and the errors.

    References
    ----------
    Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001 (gating, normalised
    errors).

    Examples
    --------
    Two paths, of which one was found 0.1 ns late, and one MPC that is no path:

    >>> values = {"delay": [100e-9, 130e-9], "azimuth": [10.0, 200.0], "elevation": [0.0, 0.0]}
    >>> values["path_gain"] = [-100.0, -105.0]
    >>> truth = xr.Dataset({name: ("path", value) for name, value in values.items()})
    >>> values["delay"] = [100.1e-9, 300e-9]
    >>> found = xr.Dataset({name: ("mpc", value) for name, value in values.items()})
    >>> result = score(found, truth)
    >>> result.detection, result.false_share
    (0.5, 0.5)
    >>> result.paths["match"].values
    array([ 0, -1])
    """
    for option, limit in (("dynamic_range", dynamic_range), ("least_snr", least_snr)):
        if np.isnan(limit):
            raise OptionError(f"{option} is {limit} dB; expected a number")
    gates = gates or Gates()
    (dim,) = truth["delay"].dims
    paths = truth.rename({dim: "path"}) if dim != "path" else truth
    true, found = _columns(paths), _columns(estimated)
    position, mpc_position = _positions(paths, "path"), _positions(estimated, "mpc")
    match = np.full(len(true), -1)
    required = np.zeros(len(true), bool)
    separation = np.full(len(true), np.inf)
    for name in np.unique(position):
        here, mpcs = np.flatnonzero(position == name), np.flatnonzero(mpc_position == name)
        required[here] = _required(paths.isel(path=here), dynamic_range, least_snr)
        separation[here] = _separation(true[here], gates, period)
        for candidates in (here[required[here]], here[~required[here]]):
            free = mpcs[~np.isin(mpcs, match)]
            distance = _distance(true[candidates], found[free], gates, period)
            row, column = linear_sum_assignment(np.minimum(distance, OUTSIDE_COST))
            inside = np.isfinite(distance[row, column])
            match[candidates[row[inside]]] = free[column[inside]]

    columns: dict[str, Any] = {
        "position": position,
        **{name: true[:, i] for i, name in enumerate(UNITS)},
        "snr": paths["snr"].values if "snr" in paths else np.full(len(true), np.nan),
        "required": required,
        "separation": separation,
        "match": match,
    }
    error = np.full(true.shape, np.nan)
    hit = match >= 0
    error[hit] = _difference(found[match[hit]], true[hit], period)
    for i, name in enumerate(UNITS):
        std = estimated[f"{name}_std"].values if f"{name}_std" in estimated else np.full(len(found), np.nan)
        columns[f"{name}_error"] = error[:, i]
        columns[f"{name}_normalised"] = np.full(len(true), np.nan)
        columns[f"{name}_normalised"][hit] = error[hit, i] / std[match[hit]]
    back = np.full(len(found), -1)
    back[match[hit]] = np.flatnonzero(hit)
    matched = xr.Dataset({name: ("path", values) for name, values in columns.items()})
    return Score(matched, estimated.assign(match=("mpc", back)), gates)


def with_snr(truth: xr.Dataset, daps: xr.Dataset, sounder: Sounder) -> xr.Dataset:
    """Add to true paths their SNR in the scan of a position.

    Parameters
    ----------
    truth : xarray.Dataset
        One dimension: ``azimuth``, ``elevation`` [degree], ``path_gain`` [dB].
    daps : xarray.Dataset
        Group ``/daps`` of the position's product, for its directions and their noise.
    sounder : Sounder
        For the receive antenna.

    Returns
    -------
    xarray.Dataset
        With ``beam_gain``, of the antenna in the direction that sees the path best, relative to boresight, and
        ``snr``, of the path's peak in that direction [dB].
    """
    (dim,) = truth["azimuth"].dims
    pattern = Pattern.of(sounder.rx_antenna)
    directions = beam_directions(daps["azimuth"].values, daps["elevation"].values)
    toward = beam_gains(truth["azimuth"].values, truth["elevation"].values, directions, pattern)
    noise = daps["noise_floor"].transpose("azimuth", "elevation").values.ravel()
    recorded = np.isfinite(noise)
    best = toward[:, recorded].argmax(axis=1)
    gain = toward[:, recorded][np.arange(len(best)), best]
    snr = truth["path_gain"].values + pattern.gain + gain - noise[recorded][best]
    return truth.assign(beam_gain=(dim, gain), snr=(dim, snr))


def _columns(table: xr.Dataset) -> Real:
    """Parameters (row, parameter) in the order of ``UNITS``."""
    columns: Real = np.stack([np.asarray(table[name].values, float) for name in UNITS], axis=-1)
    return columns


def _positions(table: xr.Dataset, dim: str) -> NDArray[np.str_]:
    if "position" in table.variables:
        return np.broadcast_to(table["position"].values.astype(np.str_), table.sizes[dim])
    return np.full(table.sizes[dim], "")


def _required(paths: xr.Dataset, dynamic_range: float, least_snr: float) -> NDArray[np.bool_]:
    if "required" in paths:
        return np.asarray(paths["required"].values, bool)
    received = paths["path_gain"].values + (paths["beam_gain"].values if "beam_gain" in paths else 0.0)
    strong: NDArray[np.bool_] = received >= received.max(initial=-np.inf) - dynamic_range
    return strong & (paths["snr"].values >= least_snr) if "snr" in paths else strong


def _difference(a: Real, b: Real, period: float | None) -> Real:
    """Difference of parameters; delays and azimuths the short way round."""
    difference: Real = a - b
    difference[..., 1] = wrap(difference[..., 1])
    if period is not None:
        difference[..., 0] = wrap(difference[..., 0], period)
    return difference


def _distance(a: Real, b: Real, gates: Gates, period: float | None) -> Real:
    """Squared distance of every a from every b with each gate as unit, infinite outside any gate; unknowns count 0."""
    scaled = _difference(a[:, None], b[None, :], period) / np.array([getattr(gates, name) for name in UNITS])
    inside = ~(np.abs(scaled) > 1).any(axis=-1)
    return np.where(inside, np.nansum(scaled**2, axis=-1), np.inf)


def _separation(paths: Real, gates: Gates, period: float | None) -> Real:
    """Distance in delay and azimuth to the next path that is not ``gates.path_gain`` weaker, with each gate as unit."""
    difference = _difference(paths[:, None], paths[None, :], period)
    distance = np.hypot(difference[..., 0] / gates.delay, difference[..., 1] / gates.azimuth)
    distance[np.eye(len(paths), dtype=bool) | (difference[..., 3] > gates.path_gain)] = np.inf
    nearest: Real = distance.min(axis=1, initial=np.inf)
    return nearest


def _errors(error: Real, normalised: Real) -> dict[str, float | int]:
    known, size = error[np.isfinite(error)], np.abs(normalised[np.isfinite(normalised)])
    return {
        "count": known.size,
        "rmse": float(np.sqrt(np.mean(known**2))) if known.size else np.nan,
        "bias": float(np.mean(known)) if known.size else np.nan,
        "median_absolute": float(np.median(np.abs(known))) if known.size else np.nan,
        "within_1_std": _share(size < 1),
        "within_2_std": _share(size < 2),
    }


def _share(which: NDArray[np.bool_]) -> float:
    return float(which.mean()) if which.size else np.nan
