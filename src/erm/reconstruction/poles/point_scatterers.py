"""Points that throw paths to every receiver: what they predict, how they are fitted, how thick they are."""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.reconstruction.model.loss import weighted_quantiles
from erm.reconstruction.model.paths import IntArray, Paths, Rays
from erm.reconstruction.model.ragged import Ragged, first_of_each, sums
from erm.reconstruction.search.images import GATE

DEPTH = 0.05  # m; a path ends on the pole's surface, not in its centre
THINNEST, THICKEST = 0.005, 1.0  # m; radius of a perfectly reflecting one: of wood as thick as an arm to a pillar
ALIKE = 3.0  # dB; scatter of radii from the losses of one pole's paths
ROUNDS = 8  # of gathering and fitting
STEPS = 10  # of a fit, at most
SETTLED = 1e-9  # m; steps shorter than this are rounding


class Start(NamedTuple):
    """About where a pole stands, how thick it is, and which paths are off it."""

    centre: FloatArray  # (2,) m
    radius: float  # m
    members: IntArray


class Points(NamedTuple):
    """Places with their covariances."""

    place: FloatArray  # (point, 2) m
    covariance: FloatArray  # (point, 2, 2) m2

    def take(self, points: IntArray) -> "Points":
        """Return some of them."""
        return Points(self.place[points], self.covariance[points])


def settle(paths: Paths, starts: Points, around: Ragged, min_support: int) -> tuple[Points, Ragged, Ragged]:
    """Let points gather the paths around that agree with them, and fit them to these, until they no longer change.

    Returns
    -------
    points : Points
    members : Ragged
        Paths of each, one a link, ascending; none where fewer than ``min_support`` agree.
    seen : Ragged
        Paths that were gathered on the way: what became of the others makes no difference.
    """
    place, covariance = starts.place.copy(), starts.covariance.copy()
    count = len(place)
    going = np.arange(count)
    before = Ragged(np.empty(0, dtype=np.int64), np.zeros(count + 1, dtype=np.int64))
    owners: list[IntArray] = []
    rows: list[IntArray] = []
    last: list[tuple[IntArray, IntArray]] = []  # owners and rows of what points ended with
    for turn in range(ROUNDS):
        gathered = _gathered(paths, Points(place[going], covariance[going]), around.take(going))
        owners.append(going[gathered.owner])
        rows.append(gathered.rows)
        enough = gathered.sizes >= min_support
        settled = gathered.same(before)[enough]
        going, before = going[enough], gathered.take(np.flatnonzero(enough))
        if len(going) == 0:
            break
        place[going], covariance[going] = _fit(paths, place[going], before)
        ends = settled | (turn == ROUNDS - 1)
        own = before.take(np.flatnonzero(ends))
        last.append((going[ends][own.owner], own.rows))
        going, before = going[~ends], before.take(np.flatnonzero(~ends))
        if len(going) == 0:
            break
    members = Ragged.gathered([one for one, _ in last], [own for _, own in last], count)
    return Points(place, covariance), members, Ragged.gathered(owners, rows, count)


def poles_of(paths: Paths, points: Points, members: Ragged) -> list[Start | None]:
    """Poles whose surfaces are at points; None where the losses of the paths tell no radius of a pole."""
    one, of = paths.take(members.rows), members.owner
    radii = radii_of(one, points.place[of])[0]
    weight = 1 / (one.loss_std**2 + ALIKE**2)
    middle = weighted_quantiles(10 * np.log10(radii), weight, members.start, 0.5)
    # gains beyond the fan are all wrong alike, so their errors are not averaged
    error = sums(weight * one.loss_std, members.start) / sums(weight, members.start)
    thinnest, thickest = 10 ** ((middle - error) / 10), 10 ** ((middle + error) / 10)
    wrong = (thickest < THINNEST) | (thinnest > THICKEST)
    radius = np.clip(10 ** (middle / 10), THINNEST, THICKEST)
    # a fitted point is on the surface, on the side of the antennas
    antennas = sums((one.tx[:, :2] + one.rx[:, :2]) / 2, members.start) / members.sizes[:, None]
    inward = points.place - antennas
    centre = points.place + radius[:, None] * inward / np.linalg.norm(inward, axis=-1, keepdims=True)
    return [None if wrong[i] else Start(centre[i], float(radius[i]), own) for i, own in enumerate(members)]


def misfit(paths: Rays, place: FloatArray, covariance: FloatArray) -> FloatArray:
    """Chi-squared (path,) of paths against a point of some covariance, or each against one (path, 2)."""
    length, azimuth, by_length, by_azimuth = _residuals(paths, place)
    length_std, azimuth_std = errors(paths)
    a, b, d = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    (le, ln), (ae, an) = by_length, by_azimuth
    of_east, of_north = le * a + ln * b, le * b + ln * d
    own = of_east * le + of_north * ln + length_std**2
    mixed = of_east * ae + of_north * an
    other = ae * ae * a + 2 * ae * an * b + an * an * d + azimuth_std**2
    return (length**2 * other - 2 * length * azimuth * mixed + azimuth**2 * own) / (own * other - mixed**2)


def errors(paths: Rays) -> tuple[FloatArray, FloatArray]:
    """Standard errors (path,) of length and azimuth of a path off a pole."""
    return np.hypot(paths.length_std, DEPTH), paths.azimuth_std


def radii_of(paths: Paths, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radius (path,) of a perfectly reflecting pole that loses what each path lost, and the heights of the bounces.

    `erm.tracing.cylinders.pole_spreading` solved for ``a``: with ``q`` the power lost, ``a = 2 s1 s2 cos(el)**2 /
    (cos(theta) L (q - 1))``. A pole that does not reflect perfectly comes out too thin.
    """
    first, second = place - paths.tx[:, :2], place - paths.rx[:, :2]
    d1, d2 = np.hypot(*first.T), np.hypot(*second.T)
    height = paths.rx[:, 2] + (paths.tx[:, 2] - paths.rx[:, 2]) * d2 / (d1 + d2)
    length = np.hypot(d1 + d2, paths.tx[:, 2] - paths.rx[:, 2])
    level = (d1 + d2) / length
    between = np.sum(first * second, axis=-1) / (d1 * d2)
    cosine = np.sqrt((1 + np.clip(between, -0.999, 1)) / 2) * level
    lost = 10 ** (paths.loss / 10)
    s1, s2 = d1 / level, d2 / level
    return 2 * s1 * s2 * level**2 / (cosine * length * np.maximum(lost - 1, 1e-9)), height


def _gathered(paths: Paths, points: Points, around: Ragged) -> Ragged:
    """Paths around points that agree with them, the best of each link, ascending."""
    of, rows = around.owner, around.rows
    chi2 = misfit(paths.rays.take(rows), points.place[of], points.covariance[of])
    inside = np.flatnonzero(chi2 < GATE)
    of, rows = of[inside], rows[inside]
    key = of * (paths.link.max(initial=0) + 1) + paths.link[rows]
    rank = np.lexsort((rows, chi2[inside], key))
    best = rank[first_of_each(key[rank])]
    best = best[np.lexsort((rows[best], of[best]))]
    return Ragged.of_pairs(of[best], rows[best], len(around))


def _fit(paths: Paths, place: FloatArray, members: Ragged) -> tuple[FloatArray, FloatArray]:
    """Weighted least-squares points (point, 2) of lists of paths, and their covariances."""
    place, covariance = place.copy(), np.empty((len(place), 2, 2))
    going = np.arange(len(place))
    for _ in range(STEPS):
        own = members.take(going)
        rays = paths.rays.take(own.rows)
        terms = np.zeros((5, len(own.rows)))
        length, azimuth, by_length, by_azimuth = _residuals(rays, place[going][own.owner])
        for value, (east, north), std in zip((length, azimuth), (by_length, by_azimuth), errors(rays), strict=True):
            weight = 1 / std**2
            terms += weight * np.stack([east * east, east * north, north * north, east * value, north * value])
        a, b, d, u, v = np.add.reduceat(terms, own.start[:-1], axis=1)
        determinant = a * d - b * b
        covariance[going] = np.stack([d, -b, -b, a], axis=-1).reshape(-1, 2, 2) / determinant[:, None, None]
        step = np.stack([d * u - b * v, a * v - b * u], axis=-1) / determinant[:, None]
        place[going] += step
        going = going[np.abs(step).max(axis=1) >= SETTLED]
        if len(going) == 0:
            break
    return place, covariance


def _residuals(
    paths: Rays, place: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Measured minus predicted length and azimuth of paths by way of a point, and the slopes (east, north) of both.

    Seen from above the path is ``|tx - p| + |p - rx|`` long, and unfolded at a vertical face it climbs evenly.
    """
    tx_east, tx_north = place[..., 0] - paths.tx_east, place[..., 1] - paths.tx_north
    rx_east, rx_north = place[..., 0] - paths.rx_east, place[..., 1] - paths.rx_north
    d1, d2 = np.sqrt(tx_east**2 + tx_north**2), np.sqrt(rx_east**2 + rx_north**2)
    slant = np.sqrt((d1 + d2) ** 2 + paths.climb**2)
    east, north = rx_east / d2, rx_north / d2
    steep = (d1 + d2) / slant
    by_length = (tx_east / d1 + east) * steep, (tx_north / d1 + north) * steep
    by_azimuth = np.rad2deg(-north / d2), np.rad2deg(east / d2)
    aside = angle_difference(paths.azimuth, np.rad2deg(np.arctan2(rx_north, rx_east)))
    return paths.length - slant, aside, by_length, by_azimuth
