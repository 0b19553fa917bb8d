"""Omnidirectional power delay profile (PDP) by synthesis: what ideal isotropic antennas would have received."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sounder.cir.deembedding import Deembedding

LABEL = "synthesis from MPCs, antennas removed"
"""What this PDP is, for labels."""

Real = NDArray[np.float64]


def synthesize_pdp(delay: Real, path_gain: Real, filter_: Deembedding) -> Real:
    """Add the powers of the pulses of all MPCs.

    ``P(t) = sum_i G_i |p(t - t_i)|^2`` with the path gains ``G_i``, the delays ``t_i`` and the pulse ``p`` of the
    sounder, whose peak is 1. Powers are added, as in the mean over the phases of the MPCs.

    Each path has the gain that its fit gives without antennas, wherever it comes from. A sum or a maximum of beams has
    too little power of paths above or below the scan, by what the antenna loses toward them. The synthesis has neither
    noise nor paths under the threshold.

    Parameters
    ----------
    delay : array (mpc,)
        [s]
    path_gain : array (mpc,)
        [dB]
    filter_ : Deembedding
        The filter that made the CIRs; of its pulse.

    Returns
    -------
    array (sample,)
        Power [1] over one period of the sequence: delays are taken modulo it. 0 without MPCs.

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> recordings, b2b = [shipped.calibration("recording-132ghz.h5")], shipped.calibration("back-to-back-132ghz.h5")
    >>> [job], _ = sounder.gather(recordings, calibration=b2b)
    >>> filter_ = sounder.calibrate(job.b2b, job.recording)
    >>> pdp = synthesize_pdp(np.array([100e-9]), np.array([-104.0]), filter_)  # a sample lies at 100 ns
    >>> print(f"{10 * np.log10(pdp.max()):.1f} dB at {pdp.argmax() / filter_.sample_rate * 1e9:.0f} ns")
    -104.0 dB at 100 ns
    """
    size = filter_.weight.size
    frequency = np.fft.fftfreq(size)
    spectrum = filter_.weight * size / filter_.weight.sum()
    power = np.zeros(size)
    for when, gain in zip(delay * filter_.sample_rate, 10 ** (path_gain / 10), strict=True):
        power += gain * np.abs(np.fft.ifft(spectrum * np.exp(-2j * np.pi * frequency * when))) ** 2
    return power


def with_synthesis(daps: xr.Dataset, mpcs: xr.Dataset, filter_: Deembedding) -> xr.Dataset:
    """Replace the PDP of a DAPS by its synthesis from MPCs.

    Parameters
    ----------
    daps : xarray.Dataset
        From :func:`sounder.cir.power_spectrum.daps`.
    mpcs : xarray.Dataset
        From :func:`sounder.mpc.extract.extract_mpcs`.
    filter_ : Deembedding

    Returns
    -------
    xarray.Dataset
        ``pdp`` is replaced [dB]; it is -inf without MPCs. Attribute ``omnidirectional``: ``synthesis``.
    """
    power = synthesize_pdp(mpcs["delay"].values, mpcs["path_gain"].values, filter_)
    with np.errstate(divide="ignore"):
        decibels = 10 * np.log10(power)
    attributes = {"units": "dB", "long_name": f"omnidirectional power delay profile: {LABEL}"}
    return daps.assign(pdp=("delay", decibels, attributes)).assign_attrs(omnidirectional="synthesis")
