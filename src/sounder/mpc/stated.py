"""What the stated uncertainties of calibration, survey and antennas add to the variances of MPCs."""

import numpy as np
from numpy.typing import NDArray

from erm.common.constants import c
from sounder.instrument.description import Sounder

Real = NDArray[np.float64]


def stated_variance(sounder: Sounder, delay: Real) -> Real:
    """Variances that the MPCs of a position share, nearly, besides those of their fits.

    A path of length ``L = c delay`` comes from an image of the transmitter at this distance. With the standard
    deviation ``s`` of each coordinate of either antenna, the difference of image and receiver has ``sqrt(2) s`` along
    the path, an error of ``sqrt(2) s / c`` in its delay, and ``sqrt(2) s`` across, an error of ``sqrt(2) s / L`` in its
    angles. The zeros of azimuth and elevation add to the angles, and the back-to-back connection to the delay. The gain
    has the uncertainties of the attenuator and of the gains of both antennas.

    Parameters
    ----------
    sounder : Sounder
        Its tables ``back_to_back`` and ``survey``, and ``gain_std`` of its antennas.
    delay : array (mpc,)
        [s]

    Returns
    -------
    array (mpc, 4)
        Of delay [s2], azimuth, elevation [degree2], and gain [dB2]. All zero if nothing is stated.

    Examples
    --------
    >>> from sounder import load_sounder, shipped
    >>> from sounder.instrument.stated import Survey
    >>> described = load_sounder(shipped.calibration("sounder-132ghz.toml"))
    >>> surveyed = described.model_copy(update={"survey": Survey(position_std=0.02)})
    >>> std = np.sqrt(stated_variance(surveyed, np.array([200e-9])))[0]
    >>> print(f"{std[0] * 1e9:.3f} ns, {std[1]:.3f} degree")
    0.094 ns, 0.027 degree
    """
    connection, survey = sounder.back_to_back, sounder.survey
    between = np.sqrt(2) * survey.position_std
    across = np.degrees(between / (c * np.maximum(delay, np.finfo(float).tiny))) ** 2 if between else 0.0
    gain = connection.attenuation_std**2 + sounder.tx_antenna.gain_std**2 + sounder.rx_antenna.gain_std**2
    variance = np.empty((delay.size, 4))
    variance[:, 0] = connection.delay_std**2 + (between / c) ** 2
    variance[:, 1] = survey.heading_std**2 + across
    variance[:, 2] = survey.tilt_std**2 + across
    variance[:, 3] = gain
    return variance
