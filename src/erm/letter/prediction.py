"""Prediction of the channel along a route that was not measured, from maps of more and more positions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from erm.evaluation.outline import point_errors
from erm.geometry.vertical import FloatArray, angle_difference
from erm.letter import truth
from erm.letter.captures import Campaign
from erm.letter.replicates import columns
from erm.maps.environment import Environment
from erm.mpcs.selection import select
from erm.reconstruction.reconstruct import reconstruct
from erm.tracing.trace import trace

if TYPE_CHECKING:
    import xarray as xr

COUNTS = (3, 4, 5, 7, 9, 13, 25)
SHIFT = (5.0, 0.0, 0.0)  # m, from the measured route to the new one. Chosen; not derived
MAX_ORDER = 2
DELAY_GATE = 2 * truth.DELAY_GATE  # s; a predicted path within this and `truth.AZIMUTH_GATE` is the true one
CUT_STEP, ON_FACE = (
    0.1,
    0.3,
)  # m; spacing of the points at which a wall is tested, and their distance from a face. Chosen
MAX_BASE = 2.0  # m; a face that begins higher leaves an opening under it. Chosen; not derived
MIN_POWER = 1e-3  # of the true power; limits the error of the level to 30 dB


@dataclass(frozen=True)
class Prediction:
    """How well a map of some positions predicts a route.

    Parameters
    ----------
    walls : int
        Number of reflectors of the map.
    power : float
        Share of the power of the true reflected paths that is predicted.
    false : float
        Power of predicted reflected paths that do not exist, over that of the true ones.
    false_cut : float
        The same with the map's walls cut back to where a face truly stands on the ground.
    level : float
        RMS error over the route of the sum of the reflected power [dB].
    """

    walls: int
    power: float
    false: float
    false_cut: float
    level: float


@dataclass(frozen=True)
class Predicted:
    """Predictions of maps with the same number of positions.

    Parameters
    ----------
    positions : int
        Number of positions of each map.
    replicates : tuple of Prediction
        One for each choice of positions; a single one if all positions are used.
    """

    positions: int
    replicates: tuple[Prediction, ...]

    def of(self, field: str) -> FloatArray:
        """Return a field (replicate,) of the predictions."""
        return columns([self.replicates], field)[0]


def shifted_route(campaign: Campaign, shift: Sequence[float] = SHIFT) -> Campaign:
    """Return the campaign along its route shifted by ``shift`` [m]."""
    moved = [type(link)(link.name, link.tx, _shifted(link.rx, shift)) for link in campaign.links]
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
        Measured positions in their order along a route.
    route : Campaign
        Route to predict, in the same environment.
    counts : sequence of int
        Numbers of positions of the maps.
    replicates : int
        Number of maps for each count, each of other positions.
    """
    truth = reflected(route.environment, route)
    found = []
    for count in counts:
        made = []
        for chosen in choose_positions(len(measured.links), count, replicates):
            names = [measured.links[i].name for i in chosen]
            part = table.isel(mpc=np.flatnonzero(np.isin(table["position"].values, names)))
            made.append(evaluate_prediction(reconstruct(select(part))[0], route, truth=truth))
        found.append(Predicted(min(count, len(measured.links)), tuple(made)))
    return found


def choose_positions(available: int, count: int, replicates: int) -> list[list[int]]:
    """Choose ``count`` of the available positions: evenly spaced first, then one at random in each stretch."""
    if count >= available:
        return [list(range(available))]
    rng = np.random.default_rng(count)
    edges = np.linspace(0, available, count + 1)
    chosen = [np.rint(np.linspace(0, available - 1, count)).astype(int).tolist()]
    while len(chosen) < replicates:
        chosen.append(np.floor(rng.uniform(edges[:-1], edges[1:])).astype(int).tolist())
    return chosen


def evaluate_prediction(
    environment: Environment, route: Campaign, *, truth: Sequence[FloatArray] | None = None
) -> Prediction:
    """Compare the paths that a map predicts along a route with the true ones.

    Parameters
    ----------
    truth : sequence of array (path, 3), optional
        Result of `reflected` for the true environment, if it is known already.
    """
    truth = reflected(route.environment, route) if truth is None else truth
    true, hit, false, level = _scores(truth, reflected(environment, route))
    *_, false_cut, _ = _scores(truth, reflected(cut_back(environment, faces_at_street_level(route.environment)), route))
    error = 10 * np.log10(np.maximum(level / true, MIN_POWER))
    return Prediction(
        walls=environment.reflectors.sizes["reflector"],
        power=float(np.mean(hit / true)),
        false=float(np.mean(false / true)),
        false_cut=float(np.mean(false_cut / true)),
        level=float(np.sqrt(np.mean(error**2))),
    )


def cut_back(environment: Environment, faces: FloatArray) -> Environment:
    """Cut the walls of a map back to known faces (segment, 2 ends, 2) [m]. Poles stay."""
    table = environment.reflectors
    rows, ends = [], []
    for row, (kind, (start, stop)) in enumerate(zip(table["kind"].values, table["end_points"].values, strict=True)):
        if kind != "wall":
            rows.append(row)
            ends.append((start, stop))
            continue
        share = np.linspace(0, 1, max(int(np.linalg.norm(stop - start) / CUT_STEP), 1) + 1)
        points = start + share[:, None] * (stop - start)
        real = np.flatnonzero(point_errors(points, faces).distance < ON_FACE)
        for run in np.split(real, np.flatnonzero(np.diff(real) > 1) + 1):
            if len(run) > 1:
                rows.append(row)
                ends.append((points[run[0]], points[run[-1]]))
    kept = table.isel(reflector=np.array(rows, dtype=int))
    moved = kept.assign(end_points=(kept["end_points"].dims, np.reshape(ends, (-1, 2, 2)), kept["end_points"].attrs))
    return replace(environment, reflectors=moved)


def faces_at_street_level(environment: Environment) -> FloatArray:
    """Faces (segment, 2 ends, 2) that reach down to street level [m]; a face above a passage does not."""
    table = environment.reflectors
    return table["end_points"].values[(table["kind"].values == "wall") & (table["base"].values < MAX_BASE)]


def _scores(truth: Sequence[FloatArray], predicted: Sequence[FloatArray]) -> FloatArray:
    """`_score` (4, position) of the positions that truly have a reflected path."""
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
    """Power of the true paths, of the predicted true ones, of the false predicted ones, and of all predicted ones."""
    late = (true[:, None, 0] - predicted[:, 0]) / DELAY_GATE
    turned = angle_difference(true[:, None, 1], predicted[:, 1]) / truth.AZIMUTH_GATE
    near = late**2 + turned**2 < 1
    hit = true[near.any(axis=1), 2].sum()
    false = predicted[~near.any(axis=0), 2].sum()
    return float(true[:, 2].sum()), float(hit), float(false), float(predicted[:, 2].sum())


def _shifted(place: Sequence[float], shift: Sequence[float]) -> tuple[float, float, float]:
    east, north, up = (float(a + b) for a, b in zip(place, shift, strict=True))
    return east, north, up
