"""The noise of a recording against the noise figure of the receiver."""

import numpy as np
import xarray as xr
from scipy.constants import k as boltzmann

from sounder.cir.deembedding import Deembedding
from sounder.instrument.waveform import held_template
from sounder.quality.back_to_back import RELATIVE_SCALE
from sounder.quality.line_of_sight import SIGMAS
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark

REFERENCE_TEMPERATURE = 290.0
"""Of noise figures [K]: IEEE Standard 145."""
QUIET = 0.1
"""Quantile of the noise floors over the directions that is compared: strong directions hold phase noise too. Chosen."""


def noise_power(daps: xr.Dataset, deembedding: Deembedding, recording: Recording) -> float:
    """Noise power at the port of the receive antenna, in the bandwidth of the sample rate [dBm].

    White noise of power ``P`` a sample has, after the mean over ``S`` snapshots, the correlation with the template
    ``T`` and the filter ``G``, the power ``P / S mean |T G|^2`` in every sample of the CIR.

    Parameters
    ----------
    daps : xarray.Dataset
        Its ``noise_floor``; of coherent averages.
    deembedding : Deembedding
        The filter that made it.
    recording : Recording
    """
    template = np.fft.fft(held_template(recording.sounder.sent))
    gain = np.mean(np.abs(template * deembedding.transfer) ** 2)
    quiet = float(np.nanquantile(daps["noise_floor"].values, QUIET))
    quiet -= daps.attrs.get("departure_noise", 0.0)
    samples = quiet - 10 * np.log10(gain / recording.snapshots)
    return float(samples + 20 * np.log10(recording.scale_factor))


def thermal_noise(recording: Recording, noise_figure: float) -> float:
    """``k T B F`` in the bandwidth of the sample rate [dBm].

    Examples
    --------
    >>> import sounder
    >>> from sounder import shipped
    >>> [recording] = sounder.open_recordings(shipped.calibration("recording-132ghz.h5"))
    >>> print(f"{thermal_noise(recording, 8.0):.1f} dBm")
    -75.2 dBm
    """
    bandwidth = recording.sounder.waveform.sample_rate
    return float(10 * np.log10(1e3 * boltzmann * REFERENCE_TEMPERATURE * bandwidth) + noise_figure)


def remarks_on_noise_level(daps: xr.Dataset, deembedding: Deembedding, recording: Recording) -> list[Remark]:
    """Compare the noise with the stated noise figure: a wrong scale factor or sign of the gains moves it.

    Nothing is said without a stated noise figure, with a scale of unknown unit, or for averages of power.
    """
    receiver = recording.sounder.receiver
    coherent = daps.attrs["averaging"] == "coherent"
    if (
        recording.kind != "iq"
        or receiver.noise_figure is None
        or recording.scale_factor == RELATIVE_SCALE
        or not coherent
    ):
        return []
    error = noise_power(daps, deembedding, recording) - thermal_noise(recording, receiver.noise_figure)
    bound = SIGMAS * receiver.noise_figure_std
    if abs(error) <= bound:
        return []
    detail = (
        f"the noise is {error:+.1f} dB off k T B F with the noise figure of {receiver.noise_figure:g} dB; at most "
        f"{bound:.1f} dB are likely"
    )
    return [Remark(Code.NOISE_LEVEL, figure=error, bound=bound, detail=detail)]
