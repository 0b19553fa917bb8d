"""Delays of paths whose pulses overlap, from all links together.

Cancellation fits each path to what the others leave in the links about its own. Of two paths within a resolution cell,
what one leaves in the links of the other depends on their phases there. But their delays are common to all links.

In link ``l`` the whitened samples are ``y_l = S a_l + n_l``, with the pulses ``S`` (sample, path) at the delays, noise
of variance ``N_l``, and amplitudes ``a_l`` of unknown phase, of which the patterns ``g_lp`` say the size: they have the
prior variance ``v_lp = (m A_p g_lp)^2``, with the margin ``m`` of the patterns. Given the delays, the best amplitudes
are

``a_l = (S^H S + N_l / v_l)^-1 S^H y_l``,

and with these eliminated (variable projection), delays minimise the squares that are left, by Gauss-Newton steps. A
path that the patterns do not put into a link takes nothing there.

References
----------
Kaufman, BIT 15 (1975) 49-57.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sounder.mpc.scan import Scan
from sounder.mpc.uncertainty import MAIN_LOBE
from sounder.mpc.whitened_samples import PADDING, WindowPulse

STEPS = 20
"""Most steps of a fit; it ends before where a step is under a thousandth of a sample."""
LEAST_MOVE = 1e-3
"""Move that ends a fit [sample]."""

Real = NDArray[np.float64]
Complex = NDArray[np.complexfloating]
Integers = NDArray[np.int64]
Paths = NDArray[np.record]


def refine_delays(found: Paths, power: Real, removed: Complex, residual: Complex, scan: Scan) -> Paths:
    """Fit the delays of paths whose pulses overlap again, together.

    Parameters
    ----------
    found : array of `sounder.kernels.extraction.records.PATH` (mpc,)
    power : array (mpc, link)
        From `sounder.mpc.uncertainty.beam_power`.
    removed : array complex (mpc, link)
        Amplitude that cancellation removed for each path from each link.
    residual : array complex (link, delay)
        The CIRs without the paths.
    scan : Scan

    Returns
    -------
    array of `PATH` (mpc,)
        With new delays.
    """
    found = found.copy()
    for members in _groups(found, scan):
        late = scan.delay_after(found["delay"][members], found["delay"][members[0]])
        first = int(np.floor(found["delay"][members[0]] + late.min())) - PADDING
        window = scan.window_pulse(int(np.ceil(np.ptp(late))) + 2 * PADDING + 2)
        start = scan.delay_after(found["delay"][members], first)
        links = scan.recorded
        samples = residual[np.ix_(links, (first + np.arange(window.whitener.shape[1])) % scan.period)].astype(complex)
        left = samples @ window.whitener.T
        own = removed[np.ix_(members, links)]
        noise = scan.noise[links] + np.mean(np.abs(left) ** 2)  # what the fits left, all links together, counts too
        prior = (scan.pattern_margin * found["amplitude"][members, None]) ** 2 * power[np.ix_(members, links)]
        fit = _Fit(left + own.T @ window.at(start)[0], noise, prior.T, window)
        moved = fit.best(start, scan.resolution)
        found["delay"][members] = (first + moved) % scan.period
    return found


def _groups(found: Paths, scan: Scan) -> Iterator[Integers]:
    """Paths in order of delay, of which each is within the main lobe of the pulse of the next."""
    order = np.argsort(found["delay"])
    apart = np.diff(found["delay"][order]) > MAIN_LOBE * scan.resolution
    for members in np.split(order, np.flatnonzero(apart) + 1):
        if members.size > 1:
            yield members


class _Fit(NamedTuple):
    """Whitened samples (link, combination), noise (link,), and prior variances of amplitudes (link, path)."""

    samples: Complex
    noise: Real
    prior: Real
    window: WindowPulse

    def best(self, delay: Real, reach: float) -> Real:
        """Delays (path,) that leave least, within ``reach`` of the first ones [sample]."""
        start, cost, damping = delay, *self.squares(delay)[:1], 1e-3
        for _ in range(STEPS):
            _, gradient, normal = self.squares(delay)
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
            trial = np.clip(delay + step, start - reach, start + reach)
            better = self.squares(trial)[0]
            if better < cost:
                moved, delay, cost, damping = np.abs(trial - delay).max(), trial, better, damping / 10
                if moved < LEAST_MOVE:
                    break
            else:
                damping *= 10
        return delay

    def squares(self, delay: Real) -> tuple[float, Real, Real]:
        """Squares that delays leave, and right side and matrix of the normal equations of a step."""
        pulse, slope = (np.asarray(table) for table in self.window.at(delay))
        inner = pulse.conj() @ pulse.T
        seen = self.samples @ pulse.conj().T
        ridge = self.noise[:, None] / np.maximum(self.prior, np.finfo(float).tiny)
        inverse = np.linalg.inv(inner + ridge[:, :, None] * np.eye(delay.size))
        amplitude = np.einsum("lpq,lq->lp", inverse, seen)
        weight = 1 / self.noise
        cost = float(
            weight @ (np.sum(np.abs(self.samples) ** 2, axis=1) - np.sum(seen.conj() * amplitude, axis=1).real)
        )
        rest = self.samples - amplitude @ pulse
        gradient = weight @ (amplitude.conj() * (rest @ slope.conj().T)).real
        cross = slope.conj() @ pulse.T
        curved = slope.conj() @ slope.T - np.einsum("pi,lij,qj->lpq", cross, inverse, cross.conj())
        normal = np.einsum("l,lp,lq,lpq->pq", weight, amplitude.conj(), amplitude, curved).real
        return cost, gradient, normal
