"""Normal equations of the fits of several paths are those of their likelihood."""

import numpy as np
import pytest

from sounder.instrument.antenna_pattern import Pattern
from sounder.mpc.fit_parameters import DELAY, LEVEL, PHASE, Parameter
from sounder.mpc.pattern_slopes import Cuts, slopes
from sounder.mpc.several_paths import aligned, normal_equations, responses
from sounder.mpc.whitened_samples import BeamSamples, WindowPulse


@pytest.fixture
def case(bench):
    """Beams about three paths, 0 to 30 dB over the noise, seen by a fit that is a little off."""
    rng = np.random.default_rng(3)
    window = WindowPulse.of(bench.filter_.matched_filter, bench.filter_.noise, 18)
    cuts = Cuts.of(Pattern.of(bench.sounder.rx_antenna))
    directions = np.stack(np.meshgrid(np.arange(80.0, 121, 10), [-9.0, 0, 9]), axis=-1).reshape(-1, 2)
    noise = rng.uniform(1, 3, len(directions))
    paths = np.array([[95.3, 2.1, 3.0, 7.3, 0.0], [103.7, -4.2, 2.2, 8.1, 1.0], [99.1, 6.3, 1.0, 10.4, 4.0]])
    silent = BeamSamples(directions, noise, np.zeros((len(directions), window.pulse.shape[1]), complex))
    samples = responses(paths, silent, window, cuts).sum(axis=0)
    samples = samples * np.exp(2j * np.pi * rng.random(len(directions)))[:, None]
    samples += rng.normal(size=(*samples.shape, 2)) @ [1, 1j] / np.sqrt(2)
    return (
        paths + rng.normal(size=paths.shape) * [1, 1, 0.1, 0.1, 0.1],
        BeamSamples(directions, noise, samples),
        window,
        cuts,
    )


def test_gradient_is_the_slope_of_the_cost(case):
    """By levels and phases, of which the model is a smooth function: angles and delays are looked up in tables.

    Differences over 2e-5 are wrong by 1e-10 of what the slope changes over 1, and by the rounding of the cost.
    """
    paths, *given = case
    cost, _, gradient = normal_equations(paths[None], *given)
    smooth = np.flatnonzero(np.isin(np.arange(paths.size) % len(Parameter), (LEVEL, PHASE)))
    step = 1e-5 * np.eye(paths.size)[smooth].reshape(-1, *paths.shape)
    slope = np.subtract(*(normal_equations(paths + side, *given).cost for side in (step, -step))) / 2e-5
    rounding = paths.size * np.finfo(float).eps * abs(cost[0]) / 1e-5
    np.testing.assert_allclose(-2 * gradient[0, smooth], slope, rtol=1e-6, atol=1e-9 * np.abs(slope).max() + rounding)


def test_normal_equations_are_those_of_the_derivatives(case):
    """Written as they are meant: derivatives of the model of each beam, without what a phase of the beam absorbs."""
    paths, beams, window, cuts = case
    g, *turned = slopes(paths[:, 0], paths[:, 1], beams.directions, cuts)
    each = responses(paths, beams, window, cuts)
    pulse, slope = window.at(paths[:, DELAY])
    late = each / pulse[:, None] * slope[:, None]
    by = np.stack([*(each * (t / g)[..., None] for t in turned), each, late, 1j * each], axis=1)
    by = by.reshape(paths.size, *each.shape[1:])
    model = each.sum(axis=0)
    rotated, known = aligned(model, beams)
    turn = 1j * model / np.linalg.norm(model, axis=1, keepdims=True)
    by -= np.sum(turn.conj() * by, axis=-1, keepdims=True).real * turn
    weight = np.minimum(2 * known**2, 1)
    normal = np.einsum("b,ibk,jbk->ij", weight, by.conj(), by).real
    gradient = np.einsum("ibk,bk->i", by.conj(), known[:, None] * rotated - model).real
    made = normal_equations(paths[None], beams, window, cuts)
    np.testing.assert_allclose(made.normal[0], normal, atol=1e-9 * np.abs(normal).max())
    np.testing.assert_allclose(made.gradient[0], gradient, atol=1e-9 * np.abs(gradient).max())
