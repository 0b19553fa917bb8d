"""What the stated uncertainties of calibration, survey and antennas add to the variances of MPCs."""

import numpy as np
from numpy.typing import NDArray

from erm.common.constants import c
from sounder.instrument.description import Sounder
from sounder.mpc.beams import Beams
from sounder.mpc.directions import DB_PER_NEPER
from sounder.mpc.pattern_slopes import slopes
from sounder.mpc.uncertainty import best_beams

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


def pattern_covariance(
    found: NDArray[np.record], group: NDArray[np.int64], beams: Beams, recorded: NDArray[np.bool_]
) -> Real:
    """Covariance that the stated errors of the antenna's pattern make.

    In beam ``b`` a path has the magnitude ``m_b = a g_b``. An error ``e_b`` of the pattern's amplitude, of standard
    deviation ``gain_error`` and independent from beam to beam, and one ``w`` of the beamwidth, the same in all beams,
    change it by ``m_b (e_b + 2 x_b w)``, where the lobe is ``x_b = -ln g_b`` under its peak. With the derivatives
    ``J_b`` of ``m_b`` by azimuth, elevation and ``ln a``, and ``A = sum_b J_b J_b^T``, the least-squares fit moves by
    ``A^-1 sum_b J_b m_b (e_b + 2 x_b w)``. The amplitude drops out: what is not known of the antenna does not become
    less for a stronger path. What the residuals of a fit show of these errors is in its variance already.

    Parameters
    ----------
    found : array of `sounder.kernels.extraction.records.PATH` (mpc,)
        Arrivals or departures.
    group : array (mpc,)
        Number of the group that was fitted together, -1 for others. The fits of groups hold these errors already.
    beams : Beams
        Of the antenna at this end.
    recorded : array (beam,)
        Whether the beam was recorded.

    Returns
    -------
    array (mpc, 3, 3)
        Of azimuth, elevation [degree] and gain [dB]. Zero if nothing is stated, and of an angle that the scan does not
        determine.
    """
    gain_error, width_error = beams.antenna.gain_error or 0.0, beams.antenna.beamwidth_error or 0.0
    covariance = np.zeros((len(found), 3, 3))
    if not found.size or not beams.pattern.directive or not (gain_error or width_error):
        return covariance
    beam, weight = best_beams(10 ** (beams.gains(found["azimuth"], found["elevation"]) / 10) * recorded)
    free = np.flatnonzero([beams.azimuth.size > 1, beams.elevation.size > 1, True])
    shown = found["azimuth_variance"] * (1 - 1 / np.fmax(1.0, found["misfit"]))
    for p in np.flatnonzero(group < 0):
        path, near = found[p], beam[p, weight[p] > 0]
        g, *angles = slopes(np.array(path["azimuth"]), np.array(path["elevation"]), beams.directions[near], beams.cuts)
        columns = np.stack([*angles, g])[free]
        inverse = np.linalg.pinv(columns @ columns.T, rcond=1e-9, hermitian=True)
        apart = inverse @ (columns * g * gain_error)
        together = inverse @ columns @ (g * -2 * np.log(g) * width_error)
        made = apart @ apart.T + np.outer(together, together)
        hidden = np.clip(1 - np.nan_to_num(shown[p] / made[0, 0]), 0, 1) if free[0] == 0 and made[0, 0] > 0 else 1.0
        covariance[p][np.ix_(free, free)] = hidden * made
    scale = np.array([1.0, 1.0, DB_PER_NEPER])
    return covariance * scale[:, None] * scale
