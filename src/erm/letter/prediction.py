"""Why a map: the channel along a route that nobody measured, predicted from maps of more and more positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from erm.environment import Environment
from erm.geometry import FloatArray, angle_difference
from erm.letter.captures import Campaign
from erm.reconstruct import reconstruct
from erm.select import select
from erm.trace import trace

if TYPE_CHECKING:
    import xarray as xr

COUNTS = (3, 4, 5, 7, 9, 13, 25)
ASIDE = (5.0, 0.0, 0.0)  # m, from the measured route to the new one
MAX_ORDER = 2
DELAY_GATE, AZIMUTH_GATE = 1e-9, 3.0  # s, degree; nearer than this a predicted path is the true one
LEAST = 1e-3  # of the true power; where less is predicted the error of the level is 30 dB


@dataclass(frozen=True)
class Prediction:
    """How well a map of ``positions`` predicts a route.

    Parameters
    ----------
    positions : int
        That the map was made of.
    walls : int
        In the map.
    power : float
        Share of the power of the true reflected paths that predicted ones carry.
    false : float
        Power of predicted reflected paths that do not exist, over that of the true ones.
    level : float
        Root mean square error over the route of all reflected power together [dB].
    """

    positions: int
    walls: int
    power: float
    false: float
    level: float


def beside(campaign: Campaign, aside: Sequence[float] = ASIDE) -> Campaign:
    """The campaign along its route moved aside [m]."""
    moved = [type(link)(link.name, link.tx, _shifted(link.rx, aside)) for link in campaign.links]
    return campaign.at(moved)


def predict(
    table: "xr.Dataset", measured: Campaign, route: Campaign, counts: Sequence[int] = COUNTS
) -> list[Prediction]:
    """Predict a route from maps of evenly spread positions of a measured one.

    Parameters
    ----------
    table : xarray.Dataset
        MPCs of all positions of ``measured``.
    measured : Campaign
        Along a route, in its order.
    route : Campaign
        To be predicted, in the same environment.
    counts : sequence of int
        Positions that the maps are made of.
    """
    truth = reflected(route.environment, route)
    found = []
    for count in counts:
        spread = np.unique(np.rint(np.linspace(0, len(measured.links) - 1, count)).astype(int))
        names = [measured.links[i].name for i in spread]
        chosen = table.isel(mpc=np.flatnonzero(np.isin(table["position"].values, names)))
        environment, _ = reconstruct(select(chosen))
        found.append(judge(environment, route, len(spread), truth=truth))
    return found


def judge(
    environment: Environment, route: Campaign, positions: int, *, truth: Sequence[FloatArray] | None = None
) -> Prediction:
    """Judge a map of some positions by what it predicts along a route.

    Parameters
    ----------
    truth : sequence of array (path, 3), optional
        From `reflected` for the route's own environment, where it is known already.
    """
    truth = reflected(route.environment, route) if truth is None else truth
    pairs = zip(truth, reflected(environment, route), strict=True)
    scores = [_score(true, predicted) for true, predicted in pairs if len(true)]
    there, hit, false, level = np.array(scores).T
    error = 10 * np.log10(np.maximum(level / there, LEAST))
    return Prediction(
        positions=positions,
        walls=environment.reflectors.sizes["reflector"],
        power=float(np.mean(hit / there)),
        false=float(np.mean(false / there)),
        level=float(np.sqrt(np.mean(error**2))),
    )


def reflected(environment: Environment, route: Campaign) -> list[FloatArray]:
    """Delay [s], azimuth [degree] and power (path, 3) of the paths at each position that met a wall or pole."""
    found = []
    for link in route.links:
        paths = trace(environment, link.tx, link.rx, route.frequency, max_order=MAX_ORDER)
        met = (paths["reflector"].values >= 0).any(axis=1)
        power = np.abs(paths["coefficient"].values) ** 2
        found.append(np.column_stack([paths["delay"].values, paths["azimuth"].values, power])[met])
    return found


def _score(true: FloatArray, predicted: FloatArray) -> tuple[float, float, float, float]:
    """Power of the true paths, of those that are predicted, of predicted ones that are not, and of all predicted."""
    late = (true[:, None, 0] - predicted[:, 0]) / DELAY_GATE
    turned = angle_difference(true[:, None, 1], predicted[:, 1]) / AZIMUTH_GATE
    near = late**2 + turned**2 < 1
    hit = true[near.any(axis=1), 2].sum()
    false = predicted[~near.any(axis=0), 2].sum()
    return float(true[:, 2].sum()), float(hit), float(false), float(predicted[:, 2].sum())


def _shifted(place: Sequence[float], aside: Sequence[float]) -> tuple[float, float, float]:
    east, north, up = (float(a + b) for a, b in zip(place, aside, strict=True))
    return east, north, up
