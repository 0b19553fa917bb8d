"""Why a map: the channel along a route that nobody measured, predicted from maps of more and more positions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from erm.evaluation.outline import point_errors
from erm.geometry.vertical import FloatArray, angle_difference
from erm.letter.captures import Campaign
from erm.letter.replicates import columns
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

COUNTS = (3, 4, 5, 7, 9, 13, 25)
ASIDE = (5.0, 0.0, 0.0)  # m, from the measured route to the new one
MAX_ORDER = 2
DELAY_GATE, AZIMUTH_GATE = 1e-9, 3.0  # s, degree; nearer than this a predicted path is the true one
STEP, ON_FACE = 0.1, 0.3  # m; between the points by which a wall is cut, and from these to a face
LOW = 2.0  # m; a face that begins higher leaves an opening under it
LEAST = 1e-3  # of the true power; where less is predicted the error of the level is 30 dB


@dataclass(frozen=True)
class Prediction:
    """How well a map of some positions predicts a route.

    Parameters
    ----------
    walls : int
        In the map.
    power : float
        Share of the power of the true reflected paths that predicted ones carry.
    false : float
        Power of predicted reflected paths that do not exist, over that of the true ones.
    false_cut : float
        The same after the map's walls were cut back to where a face stands on the ground in truth.
    level : float
        Root mean square error over the route of all reflected power together [dB].
    """

    walls: int
    power: float
    false: float
    false_cut: float
    level: float


@dataclass(frozen=True)
class Predicted:
    """What maps of so many positions predict.

    Parameters
    ----------
    positions : int
        That each map was made of.
    replicates : tuple of Prediction
        Of maps of different positions; a single one where all there are were used.
    """

    positions: int
    replicates: tuple[Prediction, ...]

    def of(self, field: str) -> FloatArray:
        """A field (replicate,) of the predictions."""
        return columns([self.replicates], field)[0]


def beside(campaign: Campaign, aside: Sequence[float] = ASIDE) -> Campaign:
    """The campaign along its route moved aside [m]."""
    moved = [type(link)(link.name, link.tx, _shifted(link.rx, aside)) for link in campaign.links]
    return campaign.at(moved)


def predict(
    table: "xr.Dataset", measured: Campaign, route: Campaign, counts: Sequence[int] = COUNTS, *, replicates: int = 5
) -> list[Predicted]:
    """Predict a route from maps of more and more positions of a measured one.

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
    replicates : int
        Maps of each count, each of other positions.
    """
    truth = reflected(route.environment, route)
    found = []
    for count in counts:
        made = []
        for chosen in choices(len(measured.links), count, replicates):
            names = [measured.links[i].name for i in chosen]
            part = table.isel(mpc=np.flatnonzero(np.isin(table["position"].values, names)))
            made.append(judge(reconstruct(select(part))[0], route, truth=truth))
        found.append(Predicted(min(count, len(measured.links)), tuple(made)))
    return found


def choices(there: int, count: int, replicates: int) -> list[list[int]]:
    """Indices of ``count`` of the positions there are, spread over all: evenly, then one at random of each stretch."""
    if count >= there:
        return [list(range(there))]
    rng = np.random.default_rng(count)
    edges = np.linspace(0, there, count + 1)
    chosen = [np.rint(np.linspace(0, there - 1, count)).astype(int).tolist()]
    while len(chosen) < replicates:
        chosen.append(np.floor(rng.uniform(edges[:-1], edges[1:])).astype(int).tolist())
    return chosen


def judge(environment: Environment, route: Campaign, *, truth: Sequence[FloatArray] | None = None) -> Prediction:
    """Judge a map by what it predicts along a route.

    Parameters
    ----------
    truth : sequence of array (path, 3), optional
        From `reflected` for the route's own environment, where it is known already.
    """
    truth = reflected(route.environment, route) if truth is None else truth
    there, hit, false, level = _scores(truth, reflected(environment, route))
    *_, false_cut, _ = _scores(truth, reflected(cut_back(environment, standing(route.environment)), route))
    error = 10 * np.log10(np.maximum(level / there, LEAST))
    return Prediction(
        walls=environment.reflectors.sizes["reflector"],
        power=float(np.mean(hit / there)),
        false=float(np.mean(false / there)),
        false_cut=float(np.mean(false_cut / there)),
        level=float(np.sqrt(np.mean(error**2))),
    )


def cut_back(environment: Environment, faces: FloatArray) -> Environment:
    """A map whose walls stand only along known faces (segment, 2 ends, 2) [m]; poles stay."""
    table = environment.reflectors
    rows, ends = [], []
    for row, (kind, (start, stop)) in enumerate(zip(table["kind"].values, table["end_points"].values, strict=True)):
        if kind != "wall":
            rows.append(row)
            ends.append((start, stop))
            continue
        share = np.linspace(0, 1, max(int(np.linalg.norm(stop - start) / STEP), 1) + 1)
        points = start + share[:, None] * (stop - start)
        real = np.flatnonzero(point_errors(points, faces).distance < ON_FACE)
        for run in np.split(real, np.flatnonzero(np.diff(real) > 1) + 1):
            if len(run) > 1:
                rows.append(row)
                ends.append((points[run[0]], points[run[-1]]))
    kept = table.isel(reflector=np.array(rows, dtype=int))
    moved = kept.assign(end_points=(kept["end_points"].dims, np.reshape(ends, (-1, 2, 2)), kept["end_points"].attrs))
    return replace(environment, reflectors=moved)


def standing(environment: Environment) -> FloatArray:
    """Faces (segment, 2 ends, 2) that reach down to the height of streets; what hangs over a passage is none [m]."""
    table = environment.reflectors
    return table["end_points"].values[(table["kind"].values == "wall") & (table["base"].values < LOW)]


def _scores(truth: Sequence[FloatArray], predicted: Sequence[FloatArray]) -> FloatArray:
    """`_score` (4, position) of every position that has a reflected path in truth."""
    return np.array([_score(true, of) for true, of in zip(truth, predicted, strict=True) if len(true)]).T


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
