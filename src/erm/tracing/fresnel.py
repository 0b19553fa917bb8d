"""Reflection coefficients of surfaces: Fresnel's equations for both polarisations, and roughness."""

import numpy as np

from erm.common.constants import c


def fresnel(cosine: np.ndarray, permittivity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fresnel reflection coefficients of a half-space in vacuum.

    With ``w = sqrt(eps - sin(theta)^2)`` (``Im w <= 0``: the transmitted wave decays for ``exp(+j 2 pi f
    t)``)::

        r_TE = (cos(theta) - w) / (cos(theta) + w)
        r_TM = (eps cos(theta) - w) / (eps cos(theta) + w)

    At normal incidence ``r_TM = -r_TE``; the sign follows from the vectors of `reflect_field`.

    Parameters
    ----------
    cosine : array (...)
        Cosine of the angle between the incident ray and the normal, in [0, 1].
    permittivity : array (...) of complex
        Relative, ``eps' - j eps''``.

    Returns
    -------
    te, tm : array (...) of complex

    References
    ----------
    ITU-R P.2040, section 2.2.2.
    """
    root = np.sqrt(permittivity - (1 - cosine**2))
    te = (cosine - root) / (cosine + root)
    tm = (permittivity * cosine - root) / (permittivity * cosine + root)
    return te, tm


def roughness_factor(cosine: np.ndarray, height_deviation: np.ndarray, frequency: float) -> np.ndarray:
    """Factor of the specular amplitude of a rough surface.

    Heights with a Gaussian distribution spread the phase of the reflected wave by ``g = 4 pi sigma_h cos(theta)
    / lambda`` radians. The mean of ``exp(j phase)`` is ``exp(-g**2 / 2)``. The rest of the power is scattered.

    Parameters
    ----------
    cosine : array (...)
        Cosine of the angle of incidence.
    height_deviation : array (...)
        Standard deviation ``sigma_h`` of the height [m].
    frequency : float
        Carrier frequency [Hz].

    References
    ----------
    W. S. Ament, "Toward a theory of reflection by a rough surface", Proc. IRE 41 (1953) 142-146.
    """
    spread = 4 * np.pi * height_deviation * cosine * frequency / c
    return np.exp(-0.5 * spread**2)


def reflect_field(
    field: np.ndarray, incident: np.ndarray, normal: np.ndarray, te: np.ndarray, tm: np.ndarray
) -> np.ndarray:
    """Field vector of a ray after reflection.

    With ``s = k x n / |k x n|`` across the plane of incidence and ``k' = k - 2 (k.n) n`` the reflected
    direction, ``E' = r_TE (E.s) s + r_TM (E.(s x k)) (s x k')``.

    Parameters
    ----------
    field : array (..., 3) of complex
        Field vectors, transverse to ``incident``.
    incident : array (..., 3)
        Unit vector ``k`` of propagation.
    normal : array (..., 3)
        Unit normal ``n``; either sign.
    te, tm : array (...) of complex
        From `fresnel`.

    Returns
    -------
    array (..., 3) of complex
        Transverse to the reflected ray.

    Notes
    -----
    At exactly normal incidence ``s`` may be any vector across ``n``, as both polarisations are reflected equally.
    """
    across = np.cross(incident, normal)
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    # within 1e-9 rad of normal incidence rounding errors hide the plane of incidence, which does not matter there
    helper = np.where(np.abs(normal[..., 2:]) < 0.5, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    spare = np.cross(normal, helper)
    spare /= np.linalg.norm(spare, axis=-1, keepdims=True)
    s = np.where(size > 1e-9, across / np.maximum(size, 1e-300), spare)
    reflected = incident - 2 * _dot(incident, normal)[..., None] * normal
    along_te = (te * _dot(field, s))[..., None] * s
    along_tm = (tm * _dot(field, np.cross(s, incident)))[..., None] * np.cross(s, reflected)
    return along_te + along_tm


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(-1)
