"""Pulses of instruments whose captures are responses."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.instrument.periodic import Periodic
from sounder.instrument.waveform import held_template
from sounder.instrument.waveform_description import Waveform
from sounder.recordings.recording import BackToBack, Captures, Kind


def ideal_pulse(source: Path, sounder: Sounder, kind: Kind, window: str | None) -> BackToBack | None:
    """Back-to-back of an instrument that adds nothing: responses of it are calibrated already.

    Parameters
    ----------
    source : Path
        File of the responses.
    sounder : Sounder
    kind : {"iq", "cir", "ctf"}
        Of the captures. IQ captures cannot be calibrated already, impulse responses only if their window is known.
    window : str or None
        Window over frequency, by its name in `scipy.signal`, that the impulse responses were made with.

    Returns
    -------
    BackToBack or None
        Transfer functions of 1, or the impulse response of the window with a peak of 1.
    """
    samples = sounder.waveform.samples
    if kind == "ctf":
        captures = np.ones(samples, np.complex64)
    elif kind == "cir" and window is not None:
        from scipy.signal import get_window  # slow to import

        weight = np.fft.ifftshift(get_window(window, samples))
        captures = (np.fft.ifft(weight) * samples / weight.sum()).astype(np.complex64)
    else:
        return None
    return BackToBack(source, sounder, captures[None], 1.0, 0.0, None, False, "No back-to-back: calibrated", kind)


def correlated(captures: Captures, sequence: Waveform | Periodic, source: Path) -> NDArray[np.complexfloating]:
    """Impulse responses (snapshot, sample) of IQ captures: the mean over samples of captures times the held chips.

    A path of amplitude ``a`` gives a peak of height ``a``.

    Raises
    ------
    DataError
        The captures have not the length of the sequence.
    """
    plain = captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]
    length = plain.shape[1]
    if sequence.samples != length:
        raise DataError(
            f"{source}: {length} samples per capture, but the described sequence has {sequence.samples}; "
            "describe the one that is to be correlated with under [sounder.waveform] of the layout"
        )
    template = np.conj(np.fft.fft(held_template(sequence)))
    return np.fft.ifft(np.fft.fft(plain) * template / length)


def cut_around_peak(captures: Captures, samples: int) -> NDArray[np.complexfloating] | Captures:
    """Impulse responses (snapshot, sample) of a length, cut around the common peak; delays are modulo this length.

    Impulse responses that were cut after some delay are shorter than those of the back-to-back, whose pulse is short.
    """
    length = captures.shape[1]
    if length <= samples:
        return captures
    plain = captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]
    peak = int(np.argmax(np.sum(np.abs(plain) ** 2, axis=0)))
    taken = peak - samples // 2 + np.arange(samples)
    cut = np.empty((len(plain), samples), plain.dtype)
    cut[:, taken % samples] = plain[:, taken % length]
    return cut
