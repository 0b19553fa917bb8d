"""Sharpness of mirror images: heading and clock from how well paths of several receivers agree on common images.

A path of horizontal length ``d = sqrt((L - b)**2 - dz**2)`` and azimuth ``a`` at receiver ``r`` comes from the image
``I = r + d u(a - h)`` of the transmitter. Paths off one wall, or one chain of walls, have one image, whatever the
receiver, if heading ``h`` and clock ``b`` are right. For MPCs ``i`` of different receivers of one transmitter, the
log-likelihood ratio to images from nowhere is::

    sum_i log(1/2 + 1/2 mean_j N(I_i - I_j; C_i + C_j) / n_j)

with the covariances ``C`` of the images, and the density ``n_j`` of images that are uniform over lengths and azimuths.

No grid of headings is needed: with ``v = d exp(j a)``, two paths of one image obey
``(v_i - v_j) exp(-j h) = r_j - r_i``. The magnitudes do not depend on ``h``, so for each ``b`` every pair that agrees
in magnitude votes for one heading.
"""

from typing import NamedTuple

import numpy as np

from erm.geometry.vertical import FloatArray, angle_difference
from erm.mpcs.antenna_pairs import distinct_rows
from erm.survey.direct_paths import rank
from erm.survey.observations import IntArray, Observations

LOUDEST = 6
"""MPCs of each antenna pair that are compared; chosen for time."""
MOST_LINKS = 30
"""Antenna pairs that are compared; chosen for time."""
CLOCK_STEP, CLOCK_RANGE = 0.5, 12.0
"""Step and range of the clocks that are tried [m]: 40 ns below the shortest path that is possible; chosen."""
HEADING_STEP = 1.0
"""Width of the bins of votes for headings [degree]."""
HEADINGS_PER_CLOCK = 3
"""Headings that are looked at for each clock; chosen."""
GATE = 18.0
"""Squared normalised distance beyond which images do not agree: 1 in 8000 for two coordinates."""
HALVINGS = 5
"""Steps of refinement, each of half the width of the one before."""


class Peak(NamedTuple):
    """A pair (clock [m], heading [degree]) for which images are sharp."""

    evidence: float
    clock: float
    heading: float


class Sharpness:
    """Sharpness of the images of a table at any heading and clock.

    Parameters
    ----------
    seen : Observations
        MPCs of all antenna pairs.
    clock_spread, heading_spread : float
        Errors of single positions beyond those of the MPCs [m], [degree].
    """

    def __init__(self, seen: Observations, clock_spread: float = 0.0, heading_spread: float = 0.0) -> None:
        links = len(seen.tx)
        if links > MOST_LINKS:
            seen = seen.of_links(np.linspace(0, links - 1, MOST_LINKS).astype(int))
        loudness = np.where(np.isnan(seen.gain), -seen.length, seen.gain)
        self.seen = seen = seen.of_rows((rank(-loudness, seen.link) < LOUDEST) & seen.may_be_off_vertical_walls)
        self.length_std = np.hypot(seen.length_std, clock_spread)
        self.azimuth_std = np.deg2rad(np.hypot(seen.azimuth_std, heading_spread))
        self.climb = (seen.tx - seen.rx)[seen.link, 2]
        self.place = _complex(seen.rx[:, :2])[seen.link]
        self.range = float(np.ptp(seen.length)) + 1.0 if len(seen.link) else 1.0
        _, transmitter = distinct_rows(seen.tx)
        i, j = np.triu_indices(len(seen.link), 1)
        usable = (seen.link[i] != seen.link[j]) & (transmitter[seen.link[i]] == transmitter[seen.link[j]])
        self.i, self.j = i[usable], j[usable]
        self.partners = np.bincount(self.i, minlength=len(seen.link)) + np.bincount(self.j, minlength=len(seen.link))

    def horizontal(self, clock: float) -> FloatArray:
        """Horizontal lengths (mpc,) [m]."""
        return np.sqrt(np.maximum((self.seen.length - clock) ** 2 - self.climb**2, 1e-2))

    def agreeing(self, clock: float, blur: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Pairs whose images may agree at some heading, this heading [degree], and its weight."""
        d = self.horizontal(clock)
        v = d * np.exp(1j * np.deg2rad(self.seen.azimuth))
        towards = self.place[self.j] - self.place[self.i]
        apart = v[self.i] - v[self.j]
        along = np.abs(towards)
        std = np.sqrt(self._variance(d, self.i) + self._variance(d, self.j)) + blur
        mismatch = (np.abs(apart) - along) / std
        chosen = np.flatnonzero((np.abs(mismatch) < 3) & (along > std))
        heading = np.rad2deg(np.angle(apart[chosen] * np.conj(towards[chosen])))
        # weight: certain pairs are those whose heading is known best
        return chosen, heading, np.exp(-(mismatch[chosen] ** 2) / 2) * np.minimum(along[chosen] / std[chosen], 50.0)

    def _variance(self, d: FloatArray, rows: IntArray) -> FloatArray:
        return np.asarray(self.length_std[rows] ** 2 + (d[rows] * self.azimuth_std[rows]) ** 2)

    def evidence(
        self, clock: float, heading: float, blur: float = 0.0, turn: float = 0.0, pairs: IntArray | None = None
    ) -> float:
        """Log-likelihood ratio to images from nowhere, for a cell of clocks (``blur`` [m]) and headings (``turn``)."""
        i, j = (self.i, self.j) if pairs is None else (self.i[pairs], self.j[pairs])
        d = self.horizontal(clock)
        u = np.exp(1j * np.deg2rad(self.seen.azimuth - heading))
        image = self.place + d * u
        apart = image[i] - image[j]
        along = np.abs(self.place[i] - self.place[j])
        both = (along * np.deg2rad(turn)) ** 2 + (blur * np.abs(u[i] - u[j])) ** 2
        radial, across = self.length_std**2, (d * self.azimuth_std) ** 2
        xx = radial * u.real**2 + across * u.imag**2
        yy = radial * u.imag**2 + across * u.real**2
        xy = (radial - across) * u.real * u.imag
        a, b, c = xx[i] + xx[j] + both, xy[i] + xy[j], yy[i] + yy[j] + both
        determinant = a * c - b**2
        chi = (c * apart.real**2 - 2 * b * apart.real * apart.imag + a * apart.imag**2) / determinant
        near = chi < GATE
        i, j = i[near], j[near]
        density = np.exp(-chi[near] / 2) / (2 * np.pi * np.sqrt(determinant[near]))
        ratio = np.bincount(i, density * 2 * np.pi * d[j] * self.range, minlength=len(d))
        ratio += np.bincount(j, density * 2 * np.pi * d[i] * self.range, minlength=len(d))
        return float(np.log(0.5 + 0.5 * ratio / np.maximum(self.partners, 1)).sum())

    def search(self, latest: float, most: int = 6) -> list[Peak]:
        """Find the sharpest images, with clocks up to ``latest`` [m]."""
        if not len(self.i):
            return []
        clocks = latest - np.arange(0.0, CLOCK_RANGE, CLOCK_STEP)
        peaks = []
        for clock in clocks:
            pairs, heading, weight = self.agreeing(clock, CLOCK_STEP)
            votes = np.bincount((heading % 360 / HEADING_STEP).astype(int), weight, minlength=int(360 / HEADING_STEP))
            votes = votes + np.roll(votes, 1) + np.roll(votes, -1)
            for _ in range(HEADINGS_PER_CLOCK):
                at = int(np.argmax(votes))
                centre = (at + 0.5) * HEADING_STEP
                evidence = self.evidence(clock, centre, CLOCK_STEP / 2, HEADING_STEP, pairs)
                peaks.append(Peak(evidence, float(clock), float(angle_difference(centre, 0))))
                votes[np.arange(at - 3, at + 4) % len(votes)] = -1
        peaks.sort(reverse=True)
        refined: list[Peak] = []
        for peak in peaks:
            if len(refined) == most:
                break
            if all(not _near(peak, other, CLOCK_STEP, 3 * HEADING_STEP) for other in refined):
                refined.append(peak)
        return sorted((self.refine(peak) for peak in refined), reverse=True)

    def refine(self, peak: Peak) -> Peak:
        """Climb from a peak of the coarse search."""
        _, clock, heading = peak
        pairs, _, _ = self.agreeing(clock, 2 * CLOCK_STEP)
        blur, turn = CLOCK_STEP / 2, HEADING_STEP
        for _ in range(HALVINGS):
            tried = [
                (self.evidence(clock + x * blur, heading + y * turn, blur / 2, turn / 2, pairs), x, y)
                for x in (-1, 0, 1)
                for y in (-1, 0, 1)
            ]
            _, x, y = max(tried)
            clock, heading = clock + x * blur, heading + y * turn
            blur, turn = blur / 2, turn / 2
        return Peak(self.evidence(clock, heading), clock, float(angle_difference(heading, 0)))


def _near(one: Peak, other: Peak, clock: float, heading: float) -> bool:
    turned = float(np.abs(angle_difference(one.heading, other.heading)))
    return abs(one.clock - other.clock) <= clock and turned <= heading


def _complex(points: FloatArray) -> "np.ndarray":
    return points[:, 0] + 1j * points[:, 1]
