"""Leave-one-out prediction: a map is evaluated by what it predicts at positions it was not made from.

No known outline is needed.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from erm.common.errors import DataError
from erm.geometry.vertical import angle_difference
from erm.maps.environment import Environment
from erm.mpcs.antenna_pairs import links
from erm.mpcs.elevation import implied_gain
from erm.mpcs.selection import select
from erm.reconstruction.model.extent import MAX_FRESNEL_MARGIN
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

EXTRA_HEIGHT = 10.0
"""Walls may reflect this far above their highest reflection point [m]; chosen."""
DELAY_TOLERANCE, AZIMUTH_TOLERANCE, GAIN_TOLERANCE = 0.5e-9, 2.0, 3.0
"""A prediction within these errors is right [s], [degree], [dB]; chosen."""


class Prediction(NamedTuple):
    """Prediction of the strongest MPCs of one antenna pair from all others.

    Errors are prediction minus measurement, for the predicted path that is nearest in delay and azimuth; NaN if no path
    is predicted. The measured gain is the gain at the elevation that delay and heights imply
    (`erm.mpcs.elevation.implied_gain`): outside the elevations of a scan, a gain is only as certain as the elevation.
    """

    position: str
    delay: np.ndarray
    """Delay errors (mpc,) [s]."""
    azimuth: np.ndarray
    """Azimuth errors (mpc,) [degree]."""
    gain: np.ndarray
    """Gain errors (mpc,) [dB]."""
    gain_std: np.ndarray
    """Standard errors (mpc,) of the measured gains; 0 where the table has none [dB]."""
    gain_reported: np.ndarray
    """Gain errors (mpc,) relative to the gains of the table [dB]."""

    @property
    def located(self) -> np.ndarray:
        """Whether (mpc,) a path is predicted within the tolerances of delay and azimuth."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(self.delay) < DELAY_TOLERANCE) & (np.abs(self.azimuth) < AZIMUTH_TOLERANCE))

    @property
    def right(self) -> np.ndarray:
        """Whether (mpc,) delay, azimuth and gain are predicted within the tolerances."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain) < GAIN_TOLERANCE)

    @property
    def right_reported(self) -> np.ndarray:
        """The same (mpc,), with the gain of the table."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain_reported) < GAIN_TOLERANCE)

    @property
    def compatible(self) -> np.ndarray:
        """The same (mpc,), with gain errors up to the tolerance or two standard errors of the measurement."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain) < np.maximum(GAIN_TOLERANCE, 2 * self.gain_std))


def leave_one_out(
    table: "xr.Dataset", *, max_order: int = 2, strongest: int = 3, beyond: float = 10.0
) -> list[Prediction]:
    """Predict the strongest MPCs of each antenna pair from a map of all other positions.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.make_table`).
    max_order : int
        Largest number of reflections of a predicted path.
    strongest : int
        Number of MPCs of each pair that are compared.
    beyond : float
        Walls may reflect this far beyond their outermost reflection points [m]. A map shows only what was measured,
        and other positions see the parts beside it.

    Returns
    -------
    list of Prediction
        One for each antenna pair; `erm.evaluation.leave_one_out.score` summarises them.

    Raises
    ------
    DataError
        There are fewer than two antenna pairs.

    Examples
    --------
    >>> import erm
    >>> import xarray as xr
    >>> street = erm.Environment.walls([[[-60, 10], [60, 10]]], top=40.0)
    >>> links = [erm.predict(street, (0, 0, 9), (x, -4, 2), 132e9) for x in (10, 14, 18, 22)]
    >>> [prediction.right.tolist() for prediction in erm.leave_one_out(xr.concat(links, dim="mpc"))]
    [[True, True], [True, True], [True, True], [True, True]]
    """
    link = links(table)
    if len(np.unique(link)) < 2:
        raise DataError(f"{len(np.unique(link))} antenna pairs; leaving one out needs at least two")
    result = []
    for one in np.unique(link):
        held = table.isel(mpc=np.flatnonzero(link == one))
        environment, _ = reconstruct(select(table.isel(mpc=np.flatnonzero(link != one))))
        ends = (held["tx_position"].values[0], held["rx_position"].values[0])
        frequency = float(held["frequency"].values[0])
        # walls may reflect beyond their reflection points, but block only between them
        longer = resized(environment, beyond, EXTRA_HEIGHT)
        known = resized(environment, -MAX_FRESNEL_MARGIN, -MAX_FRESNEL_MARGIN)
        paths = trace(longer, *ends, frequency, max_order=max_order, obstacles=known)
        order = np.argsort(-implied_gain(held)[0], kind="stable")[:strongest]
        result.append(compare(held.isel(mpc=order), paths))
    return result


def compare(measured: "xr.Dataset", paths: "xr.Dataset") -> Prediction:
    """Errors of the paths of `erm.trace` that are nearest to the MPCs of one antenna pair."""
    errors = np.full((4, measured.sizes["mpc"]), np.nan)
    implied, std = implied_gain(measured)
    if paths.sizes["path"]:
        delay_error = paths["delay"].values - measured["delay"].values[:, None]
        azimuth_error = angle_difference(paths["azimuth"].values, measured["azimuth"].values[:, None])
        near = np.argmin((delay_error / DELAY_TOLERANCE) ** 2 + (azimuth_error / AZIMUTH_TOLERANCE) ** 2, axis=1)
        rows, gain = np.arange(len(near)), paths["path_gain"].values[near]
        errors = np.stack(
            [delay_error[rows, near], azimuth_error[rows, near], gain - implied, gain - measured["path_gain"].values]
        )
    delay, azimuth, gain, reported = errors
    return Prediction(str(measured["position"].values[0]), delay, azimuth, gain, np.nan_to_num(std), reported)


def resized(environment: Environment, beyond: float, higher: float) -> Environment:
    """Make all walls longer at both ends and higher [m]; at least a tenth of each length is kept."""
    table = environment.reflectors.copy()
    is_wall = table["kind"].values == "wall"
    ends = table["end_points"].values
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along[is_wall], axis=-1, keepdims=True)
    step = np.zeros_like(along)
    step[is_wall] = np.maximum(beyond / length, -0.45) * along[is_wall]
    table["end_points"] = table["end_points"].copy(data=ends + np.stack([-step, step], axis=1))
    table["top"] = table["top"].copy(data=table["top"].values + np.where(is_wall, higher, 0.0))
    return replace(environment, reflectors=table)


def score(predictions: list[Prediction]) -> dict[str, Any]:
    """Summarise the predictions of `leave_one_out`.

    Returns
    -------
    dict
        Numbers of ``positions`` and ``components``; share ``right`` of the MPCs that are predicted; shares of positions
        with all MPCs right (``positions_right``), located (``positions_located``), right by the gains of the table
        (``positions_reported``) and compatible (``positions_compatible``), see `Prediction`; median absolute errors
        ``delay`` [s], ``azimuth`` [degree] and ``gain`` [dB] of the right MPCs.
    """
    right = np.concatenate([one.right for one in predictions])
    errors = np.concatenate([np.stack([one.delay, one.azimuth, one.gain]) for one in predictions], axis=1)
    middle = np.median(np.abs(errors[:, right]), axis=1) if right.any() else np.full(3, np.nan)
    return {
        "positions": len(predictions),
        "components": int(right.size),
        "right": float(right.mean()),
        "positions_right": float(np.mean([one.right.all() for one in predictions])),
        "positions_located": float(np.mean([one.located.all() for one in predictions])),
        "positions_reported": float(np.mean([one.right_reported.all() for one in predictions])),
        "positions_compatible": float(np.mean([one.compatible.all() for one in predictions])),
        **dict(zip(("delay", "azimuth", "gain"), middle.tolist(), strict=True)),
    }
