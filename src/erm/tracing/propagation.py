"""Complex amplitude of a known path: spreading, reflection, roughness, polarisation, phase."""

from typing import Literal

import numpy as np

from erm.common.constants import c
from erm.tracing.fresnel import fresnel, reflect_field, roughness_factor

Polarization = Literal["vertical", "horizontal"]


def path_coefficients(
    route: np.ndarray,
    normal: np.ndarray,
    permittivity: np.ndarray,
    height_deviation: np.ndarray,
    frequency: float,
    *,
    polarization: Polarization = "vertical",
    spreading: np.ndarray | None = None,
) -> np.ndarray:
    """Baseband amplitudes of paths between isotropic antennas, for the time convention ``exp(+j 2 pi f t)``.

    With path length ``L`` and polarisation vectors ``p`` of the antennas::

        h = lambda / (4 pi L) * (p_rx . E) * exp(-j 2 pi f L / c)

    ``E`` starts as ``p_tx``. Each reflection changes it (`reflect_field`) by the Fresnel coefficients of the face times
    its roughness factor.

    Parameters
    ----------
    route : array (path, bounce + 2, 3)
        Corners from transmitter to receiver, with both [m].
    normal : array (path, bounce, 3)
        Unit normals of the faces, of either sign.
    permittivity : array (path, bounce) of complex
        Relative permittivity ``eps' - j eps''``.
    height_deviation : array (path, bounce)
        Standard deviation of the surface height [m].
    frequency : float
        Carrier frequency [Hz].
    polarization : {"vertical", "horizontal"}
        Polarisation of both antennas.
    spreading : array (path,), optional
        Replaces ``L`` in the first factor [m], where a curved face spreads the wave.

    Returns
    -------
    array (path,) of complex
    """
    legs = np.diff(route, axis=1)
    leg = np.linalg.norm(legs, axis=-1)
    ray = legs / leg[..., None]
    length = leg.sum(-1)
    field = antenna_vector(ray[:, 0], polarization).astype(complex)
    for bounce in range(normal.shape[1]):
        incident, n = ray[:, bounce], normal[:, bounce]
        cosine = np.abs((incident * n).sum(-1))
        te, tm = fresnel(cosine, permittivity[:, bounce])
        roughness = roughness_factor(cosine, height_deviation[:, bounce], frequency)
        field = reflect_field(field, incident, n, roughness * te, roughness * tm)
    received = (field * antenna_vector(ray[:, -1], polarization)).sum(-1)
    amplitude = c / frequency / (4 * np.pi * (length if spreading is None else spreading))
    return amplitude * received * np.exp(-2j * np.pi * frequency * (length / c))


def antenna_vector(ray: np.ndarray, polarization: Polarization) -> np.ndarray:
    """Polarisation vectors (path, 3) of an antenna for directions of propagation (path, 3).

    Vertical is the unit vector of increasing zenith angle. It is the same for a direction and its opposite, so one
    formula is valid for departure and arrival. Horizontal is the unit vector of increasing azimuth of the direction of
    propagation. The factor of a direct path is positive.
    """
    azimuth = np.arctan2(ray[:, 1], ray[:, 0])
    if polarization == "horizontal":
        return np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(len(ray))], axis=-1)
    level = np.hypot(ray[:, 0], ray[:, 1])
    return np.stack([ray[:, 2] * np.cos(azimuth), ray[:, 2] * np.sin(azimuth), -level], axis=-1)
