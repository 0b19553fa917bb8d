"""A map judged by what it predicts at positions it was not made from: for places where no outline exists."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from erm.common.errors import DataError
from erm.geometry.vertical import angle_difference
from erm.maps.environment import Environment
from erm.mpcs.elevation import implied_gain
from erm.mpcs.selection import links, select
from erm.reconstruction.model.extent import MOST_MARGIN
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

STRONGEST = 3  # components of a position that are looked for
BEYOND, STOREYS = 10.0, 10.0  # m; how much longer and higher than seen walls may be: gaps of 15 m are closed
DELAY, AZIMUTH, GAIN = 0.5e-9, 2.0, 3.0  # s, degree, dB; a prediction nearer than this is right


class Prediction(NamedTuple):
    """How the strongest components of one antenna pair were predicted from all others.

    Errors are those of the predicted path nearest in delay and azimuth, prediction less measurement; NaN where none is
    predicted. The gain that counts as measured is that at the elevation which delay and heights imply
    (`erm.mpcs.elevation.implied_gain`): beyond the fan of a scan a gain is measured only as far as the elevation is
    known.
    """

    position: str
    delay: np.ndarray  # (component,) s
    azimuth: np.ndarray  # (component,) degree
    gain: np.ndarray  # (component,) dB
    gain_std: np.ndarray  # (component,) dB, of the measurement; 0 where the table gives none
    gain_reported: np.ndarray  # (component,) dB, to the gain as the table has it

    @property
    def located(self) -> np.ndarray:
        """Whether (component,) a path is predicted within the tolerances of delay and azimuth."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(self.delay) < DELAY) & (np.abs(self.azimuth) < AZIMUTH))

    @property
    def right(self) -> np.ndarray:
        """Whether (component,) its gain is predicted within the tolerance, too."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain) < GAIN)

    @property
    def right_reported(self) -> np.ndarray:
        """Whether (component,) the gain that the table reports is predicted within the tolerance, too."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain_reported) < GAIN)

    @property
    def compatible(self) -> np.ndarray:
        """Whether (component,) its gain is predicted within the tolerance or two standard errors of the measurement."""
        with np.errstate(invalid="ignore"):
            return self.located & (np.abs(self.gain) < np.maximum(GAIN, 2 * self.gain_std))


def leave_one_out(
    table: "xr.Dataset", *, max_order: int = 2, strongest: int = STRONGEST, beyond: float = BEYOND
) -> list[Prediction]:
    """Predict the strongest components of each antenna pair from the map of all other positions.

    Parameters
    ----------
    table : xarray.Dataset
        MPC table (`erm.mpcs.table`).
    max_order : int
        Most reflections of a predicted path.
    strongest : int
        Components looked for at each pair.
    beyond : float
        How much further than their outermost reflection points walls are taken to reach [m]: a map shows what was
        seen, and the next position looks beside it.

    Raises
    ------
    DataError
        There are fewer than two antenna pairs.
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
        # walls may reflect further than they were seen to, but hide only where reflection points say that they stand
        longer = resized(environment, beyond, STOREYS)
        known = resized(environment, -MOST_MARGIN, -MOST_MARGIN)
        paths = trace(longer, *ends, frequency, max_order=max_order, obstacles=known)
        order = np.argsort(-implied_gain(held)[0], kind="stable")[:strongest]
        result.append(compare(held.isel(mpc=order), paths))
    return result


def compare(measured: "xr.Dataset", paths: "xr.Dataset") -> Prediction:
    """Errors of the paths of `erm.tracing.trace` that are nearest to components of one antenna pair."""
    errors = np.full((4, measured.sizes["mpc"]), np.nan)
    implied, std = implied_gain(measured)
    if paths.sizes["path"]:
        late = paths["delay"].values - measured["delay"].values[:, None]
        aside = angle_difference(paths["azimuth"].values, measured["azimuth"].values[:, None])
        near = np.argmin((late / DELAY) ** 2 + (aside / AZIMUTH) ** 2, axis=1)
        rows, gain = np.arange(len(near)), paths["path_gain"].values[near]
        errors = np.stack([late[rows, near], aside[rows, near], gain - implied, gain - measured["path_gain"].values])
    delay, azimuth, gain, reported = errors
    return Prediction(str(measured["position"].values[0]), delay, azimuth, gain, np.nan_to_num(std), reported)


def resized(environment: Environment, beyond: float, higher: float) -> Environment:
    """The same map with its walls longer at either end and higher [m]; none is shortened to less than a tenth."""
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
    """``positions``, ``components``, the share of components predicted ``right``, and of positions with all right.

    Further the shares of positions with all components ``located``, right by the gains ``reported``, and
    ``compatible``, and the median absolute errors ``delay`` [s], ``azimuth`` [degree] and ``gain`` [dB] of the right
    ones.
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
