"""The bound is what a maximum-likelihood estimator reaches, and what closed forms say where there are some."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import least_squares

from sounder.instrument.antenna_description import Antenna
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.waveform import held_template
from sounder.mpc.cramer_rao import UNITS, Band, cramer_rao
from sounder.mpc.directions import beam_directions, beam_gains

C = 299792458.0
HORN = Pattern.of(Antenna(gain=24.5, hpbw_azimuth=10, hpbw_elevation=9))
LOBE = replace(HORN, floor=-300.0)
CIRCLE, FAN = np.arange(0.0, 360, 10), np.array([-9.0, 0, 9])
CHIP = Band.held_chip(600e6)


def paths(*rows, phase=None):
    """Paths of delay [s], azimuth, elevation [degree] and SNR [dB] each."""
    columns = zip(("delay", "azimuth", "elevation", "snr"), np.transpose(rows), strict=True)
    table = xr.Dataset({name: ("mpc", column) for name, column in columns})
    return table if phase is None else table.assign(phase=(("mpc", "direction"), phase))


def std(*args, **options):
    """Bounds (parameter, path)."""
    found = cramer_rao(*args, **options)
    return np.array([found[f"{name}_std"].values for name in UNITS])


@pytest.mark.parametrize(("snr", "millimetres"), [(20, 17), (30, 5.3), (40, 1.7)])
def test_range_to_centimetres(snr, millimetres):
    """One direction, chips of 600 MHz: 17, 5 and 1.7 mm; ``1 / (2 pi B sqrt(2 snr))``, ``B`` = 191 MHz / sqrt(0.90)."""
    omni = Pattern.of(Antenna(gain=0, pattern="flat"))
    bound = std(paths((1e-7, 0, 0, snr)), [0.0], [0.0], omni, CHIP)
    assert bound[0, 0] * C * 1e3 == pytest.approx(millimetres, rel=0.02)
    assert bound[0, 0] == pytest.approx(1 / (2 * np.pi * CHIP.rms * np.sqrt(2 * 10 ** (snr / 10))), rel=1e-9)
    # sinc^2 over its main lobe: mean square of f is chip_rate^2 / (2 pi^2) times 2 over 0.9028, the energy in it
    assert pytest.approx(600e6 / np.pi / np.sqrt(0.9028), rel=1e-3) == CHIP.rms


def test_rectangular_band():
    """RMS bandwidth ``W / sqrt(12)``."""
    band = Band.rectangular(1e9)
    assert band.rms == pytest.approx(1e9 / np.sqrt(12), rel=1e-5)
    assert band.window_loss == pytest.approx(0.0, abs=1e-9)


def test_azimuth_of_a_gaussian_lobe():
    """``g = exp(-k x^2)`` on a fine grid of step ``h``: ``var = 1 / (2 snr k S)``, ``S = sum g^2 = sqrt(pi / 2k) / h``.

    For ``sum (dg/dx)^2 = 4 k^2 sum x^2 g^2 = k S``, the second moment of ``g^2`` being ``1 / 4k``; the amplitude's own
    slope is even in ``x``, that of azimuth odd, so they do not disturb each other.
    """
    k = 12 * np.log(10) / 20 / 10**2
    step = 2.5
    for azimuth in (0.0, 1.0, 121.25):
        path = paths((1e-7, azimuth, 0, 30))
        grid = np.arange(0, 360, step)
        boresight = 10 ** ((30 - beam_gains([azimuth], [0.0], beam_directions(grid, [0.0]), LOBE).max()) / 10)
        bound = std(path, grid, [0.0], LOBE, CHIP)[:, 0]
        assert bound[1] == pytest.approx(1 / np.sqrt(2 * boresight * k * np.sqrt(np.pi / 2 / k) / step), rel=1e-3)
        assert np.isnan(bound[2])  # one elevation tells none


@pytest.mark.parametrize(("snr", "degrees"), [(20, 0.5), (30, 0.16)])
@pytest.mark.slow
def test_azimuth_to_a_tenth_of_the_beam(snr, degrees):
    """A 10 degree horn every 10 degrees, over the directions between two beams: 0.5 degree at 20 dB, 0.16 at 30."""
    azimuth = np.linspace(0, 5, 11)
    bound = [std(paths((1e-7, turn, 0, snr)), CIRCLE, FAN, HORN, CHIP)[1, 0] for turn in azimuth]
    assert np.median(bound) == pytest.approx(degrees, rel=0.05)


def test_delay_gains_from_all_beams():
    """Halfway between two beams that see it alike, and two rows 12 dB down: ``sum g^2 = 2 (1 + 2 / 16)`` and more."""
    one = std(paths((1e-7, 5, 0, 20)), CIRCLE, FAN, HORN, CHIP)[:, 0]
    best = 1 / (2 * np.pi * CHIP.rms * np.sqrt(200))
    assert one[0] == pytest.approx(best / np.sqrt(2 * 1.125), rel=0.05)


def test_elevation_and_gain_are_lost_above_the_fan():
    """Row to row ``ln g`` changes linearly with elevation: where the second row sinks into the noise, all is lost.

    With the pattern's floor known, the gain would follow from the sidelobes; so here the lobe is all there is.
    """
    inside = std(paths((1e-7, 5, 0, 20)), CIRCLE, FAN, LOBE, CHIP)[:, 0]
    above = std(paths((1e-7, 5, 18, 20)), CIRCLE, FAN, LOBE, CHIP)[:, 0]
    assert (above[2:] > 4 * inside[2:]).all()
    assert above[1] < 1.5 * inside[1]


def test_turning_the_scan_and_shifting_delays_change_nothing():
    rng = np.random.default_rng(3)
    phase = rng.uniform(0, 2 * np.pi, (2, 36, 3))
    two = [(1e-7, 42.0, 1.0, 30), (1.01e-7, 49.0, -2.0, 27)]
    bound = std(paths(*two, phase=phase.reshape(2, -1)), CIRCLE, FAN, HORN, CHIP)
    turned = [(delay + 3e-7, azimuth + 130, *rest) for delay, azimuth, *rest in two]
    phase = np.roll(phase, 13, axis=1).reshape(2, -1)
    np.testing.assert_allclose(std(paths(*turned, phase=phase), CIRCLE, FAN, HORN, CHIP), bound, rtol=1e-5)


def test_the_carrier_is_a_matter_of_phase():
    """``exp(-2j pi (f + f0) tau)``: frequencies counted from elsewhere turn each path by ``2 pi f0 tau``."""
    rng = np.random.default_rng(6)
    two, f0 = [(1.0e-7, 42.0, 1.0, 30), (1.011e-7, 44.0, -2.0, 27)], 0.4e9
    phase = np.repeat(rng.uniform(0, 2 * np.pi, (2, 1)), 108, axis=1)
    moved = phase + 2 * np.pi * f0 * np.array([[two[0][0]], [two[1][0]]])
    band = replace(CHIP, frequency=CHIP.frequency + f0)
    for phases in ("own", "shared"):
        bound = std(paths(*two, phase=phase), CIRCLE, FAN, HORN, CHIP, phases=phases)
        there = std(paths(*two, phase=moved), CIRCLE, FAN, HORN, band, phases=phases)
        np.testing.assert_allclose(there, bound, rtol=1e-5)


def test_twenty_decibels_are_a_factor_of_ten():
    rng = np.random.default_rng(4)
    phase = rng.uniform(0, 2 * np.pi, (2, 108))
    bounds = [
        std(paths((1e-7, 42, 1, snr), (1.01e-7, 49, -2, snr), phase=phase), CIRCLE, FAN, HORN, CHIP) for snr in (20, 40)
    ]
    np.testing.assert_allclose(bounds[0], 10 * bounds[1], rtol=1e-6)


@pytest.mark.parametrize("phases", ["own", "shared"])
def test_a_neighbour_never_helps_and_far_away_does_not_harm(phases):
    rng = np.random.default_rng(5)
    alone = std(paths((1e-7, 42, 1, 30)), CIRCLE, FAN, HORN, CHIP)[:, 0]
    for late, aside in [(0.3e-9, 0.0), (0.3e-9, 10.0), (1.67e-9, 0.0), (4e-9, 5.0)]:
        turn = rng.uniform(0, 2 * np.pi, (2, 108))
        two = paths((1e-7, 42, 1, 30), (1e-7 + late, 42 + aside, 1, 30), phase=turn)
        assert (std(two, CIRCLE, FAN, HORN, CHIP, phases=phases)[:, 0] >= alone * (1 - 1e-6)).all()
    far = paths((1e-7, 42, 1, 30), (5e-7, 42, 1, 30))
    np.testing.assert_allclose(std(far, CIRCLE, FAN, HORN, CHIP, phases=phases)[:, 0], alone, rtol=1e-3)


def test_two_paths_of_one_delay():
    """A complex number a direction has no room for two unknown phases; it has if directions share them."""
    two = paths((1e-7, 40, 1, 30), (1e-7, 50, 1, 30), phase=np.full((2, 108), [[0.0], [1.0]]))
    own = std(two, CIRCLE, FAN, HORN, CHIP)
    assert np.isinf(own[1:]).all()
    shared = std(two, CIRCLE, FAN, HORN, CHIP, phases="shared")
    assert np.isfinite(shared).all()


def test_band_of_an_instrument(bench_maker):
    """From SNR in the impulse response to the bound is what the receiver's noise and the sent spectrum say."""
    bench = bench_maker(seed=5)
    band = Band.of(bench.filter_)
    sent = np.abs(bench.sent) ** 2 * (bench.filter_.weight > 0)
    sent[0] = 0  # the back-to-back holds no DC
    template = np.fft.fft(held_template(bench.sounder.waveform))
    tx = 10 ** (bench.sounder.tx_antenna.gain / 10)
    # noise of power s2 a sample: sum |T G|^2 / N s2 in the impulse response, N s2 a bin of the spectrum
    snr = sent.size / np.sum(np.abs(template * bench.filter_.transfer) ** 2)
    np.testing.assert_allclose(snr * band.density, sent * tx / sent.size, rtol=0.02, atol=1e-5 * snr)
    assert 0 < band.window_loss < 1  # the ripple of this one moves its spectrum off the window
    mean = np.average(bench.frequency, weights=sent)
    assert band.rms == pytest.approx(np.sqrt(np.average((bench.frequency - mean) ** 2, weights=sent)), rel=0.01)


SCAN = np.array([30.0, 40, 50, 60]), np.array([-4.0, 5])
# neither centred nor even, so that what is true of even spectra alone would show
NARROW = Band(0.2e9 + np.linspace(-0.5e9, 0.5e9, 12), np.linspace(0.5, 1.5, 12) / 12)


def spectra(truth, phase, pattern=HORN):
    """Noiseless data (direction, frequency): the model of the bound, written out."""
    look_azimuth, look_elevation = (grid.ravel() for grid in np.meshgrid(*SCAN, indexing="ij"))
    total = 0
    for (delay, azimuth, elevation, amplitude), turn in zip(truth, phase, strict=True):
        g = 10 ** (pattern.beam_gain(azimuth, elevation, look_azimuth, look_elevation) / 20)
        shape = np.sqrt(NARROW.density) * np.exp(-2j * np.pi * NARROW.frequency * delay)
        total = total + (np.exp(amplitude + 1j * turn) * g)[:, None] * shape
    return total


def most_likely(data, truth, phase, *, shared):
    """Least squares over all parameters and phases, from the truth: maximum likelihood in white noise."""
    count, beams = len(truth), data.shape[0]
    unit = np.array([1e-10, 1.0, 1.0, 0.1])
    between = phase[:, :1] - phase[:1, :1]
    turns = np.concatenate([phase[0], between[1:, 0]]) if shared else phase.ravel()

    def split(x):
        rows = truth + x[: 4 * count].reshape(count, 4) * unit
        free = turns + x[4 * count :]
        if not shared:
            return rows, free.reshape(count, beams)
        return rows, free[:beams] + np.concatenate([[0.0], free[beams:]])[:, None]

    def parts(z):
        return np.concatenate([z.real, z.imag])

    def residual(x):
        return parts((spectra(*split(x)) - data).ravel())

    def slopes(x):
        columns = [(residual(x + 1e-4 * e) - residual(x - 1e-4 * e)) / 2e-4 for e in np.eye(x.size)[: 4 * count]]
        rows, free = split(x)
        each = [1j * spectra(rows[p : p + 1], free[p : p + 1]) for p in range(count)]  # by the phases
        turned = [sum(each)] if shared else each
        columns += [parts((own * (np.arange(beams) == b)[:, None]).ravel()) for own in turned for b in range(beams)]
        if shared:
            columns += [parts(own.ravel()) for own in each[1:]]
        return np.stack(columns, axis=-1)

    fit = least_squares(residual, np.zeros(4 * count + turns.size), slopes, method="lm", ftol=1e-6)
    return split(fit.x)[0] - truth


@pytest.mark.parametrize(
    ("late", "aside", "shared"),
    [(None, None, False), (1.67e-9, 0.0, False), (0.8e-9, 8.0, False), (0.0, 15.0, True)],
)
@pytest.mark.slow
def test_maximum_likelihood_reaches_the_bound(late, aside, shared):
    """One path, two a chip apart in one beam, two in neighbouring beams: the errors' deviation is the bound.

    That of 80 errors is uncertain by 1 / sqrt(160) = 8 %; four of that either way, over parameters and cases.
    """
    rng = np.random.default_rng(7)
    truth = np.array([[20e-9, 38.0, 2.0, np.log(200.0)]])
    if late is not None:
        truth = np.vstack([truth, [truth[0, 0] + late, truth[0, 1] + aside, 1.0, np.log(150.0)]])
    phase = rng.uniform(0, 2 * np.pi, (len(truth), 8))
    if shared:
        phase = phase[:1] + np.arange(len(truth))[:, None] * 1.9
    clean = spectra(truth, phase)
    errors = []
    for _ in range(80):
        noise = rng.standard_normal((*clean.shape, 2)) @ [1, 1j] / np.sqrt(2)
        errors.append(most_likely(clean + noise, truth, phase, shared=shared))
    best = beam_gains(truth[:, 1], truth[:, 2], beam_directions(*SCAN), HORN).max(axis=1)
    rows = [(*row[:3], row[3] * 20 / np.log(10) + gain) for row, gain in zip(truth, best, strict=True)]
    bound = std(paths(*rows, phase=phase), *SCAN, HORN, NARROW, phases="shared" if shared else "own")
    measured = np.sqrt(np.mean(np.square(errors), axis=0)).T * [[1], [1], [1], [20 / np.log(10)]]
    ratio = measured / bound
    assert (np.abs(ratio - 1) < 4 / np.sqrt(160)).all(), ratio


def test_a_clock_that_wanders_adds_its_walk():
    """Delays ``d_b = tau + D_b + n_b``: ``var(tau) = 1 / (1^T (diag(v) + C)^-1 1)``; angles know nothing of it."""
    step, path = 1e-12, (1e-7, 33.0, 4.0, 40.0)
    still, wandering = (std(paths(path), CIRCLE, FAN, HORN, CHIP, drift=drift) for drift in (0.0, step))
    np.testing.assert_allclose(wandering[1:], still[1:])
    power = 10 ** (beam_gains([33.0], [4.0], beam_directions(CIRCLE, FAN), HORN)[0] / 10)
    alone = still[0, 0] ** 2 * power.sum() / power  # each direction by itself
    when = np.array([e * CIRCLE.size + a for a in range(CIRCLE.size) for e in range(FAN.size)])
    walk = step**2 * np.minimum.outer(when, when)
    together = np.linalg.solve(np.diag(alone) + walk, np.ones(when.size)).sum()
    assert wandering[0, 0] == pytest.approx(together**-0.5, rel=1e-9)
    assert wandering[0, 0] > 1.3 * still[0, 0]
