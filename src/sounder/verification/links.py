"""Delay and gain of a link of known length, direct or by a corner reflector."""

import numpy as np

from erm.common.constants import c
from sounder.cir.deembedding import Deembedding
from sounder.cir.impulse_response import impulse_responses
from sounder.mpc.extract import extract_mpcs
from sounder.recordings.recording import Recording
from sounder.verification.description import Artefact


def expected_link(artefact: Artefact, frequency: float) -> tuple[float, float]:
    """Delay [s] and path gain [dB] of a link of known distance ``d``.

    Line of sight: ``d / c`` and ``(lambda / (4 pi d))^2`` (Friis, 1946). Corner reflector: ``2 d / c`` and
    ``sigma lambda^2 / ((4 pi)^3 d^4)``, with the radar cross section ``sigma = 4 pi a^4 / (3 lambda^2)`` of a
    triangular trihedral with inner edges ``a`` on its axis (Knott, Radar Cross Section, 2nd ed., 2004, section 6.4).

    Examples
    --------
    >>> link = Artefact(name="yard", kind="link", recordings=("a.h5",), distance=30.0)
    >>> delay, gain = expected_link(link, 132e9)
    >>> print(f"{delay * 1e9:.2f} ns, {gain:.2f} dB")
    100.07 ns, -104.40 dB
    """
    distance, wavelength = artefact.distance or 0.0, c / frequency
    if artefact.side is None:
        return distance / c, float(20 * np.log10(wavelength / (4 * np.pi * distance)))
    section = 4 * np.pi * artefact.side**4 / (3 * wavelength**2)
    return 2 * distance / c, float(10 * np.log10(section * wavelength**2 / ((4 * np.pi) ** 3 * distance**4)))


def measured_link(recording: Recording, deembedding: Deembedding, delay: float) -> tuple[float, float, float, float]:
    """Delay [s] and gain [dB] of the strongest MPC near a delay, with their standard deviations.

    Near is within five resolution cells; NaN if there is none.
    """
    sounder = recording.sounder
    cir, _ = impulse_responses(recording, deembedding)
    mpc = extract_mpcs(cir, deembedding, sounder, distance=delay * c, time=recording.time)
    period = sounder.waveform.period
    late = (mpc["delay"].values - delay + period / 2) % period - period / 2
    near = np.flatnonzero(np.abs(late) < 5 / sounder.bandwidth)
    if not near.size:
        return (np.nan,) * 4
    best = near[np.argmax(mpc["path_gain"].values[near])]
    values = (mpc[name].values[best] for name in ("delay_std", "path_gain", "path_gain_std"))
    delay_std, gain, gain_std = map(float, values)
    return delay + float(late[best]), delay_std, gain, gain_std
