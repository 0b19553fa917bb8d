"""Make the synthetic calibration files of this folder again: ``python calibration/make_synthetic.py [FOLDER]``.

Nothing here was measured. Every number follows from the constants below and from fixed seeds, so two runs agree.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HPBW = {"azimuth": 10.0, "elevation": 9.0}
PHASE_ERROR = np.radians(35.0)
FAR_OUT = -40.0

Reals = NDArray[np.float64]


def aperture_gain(sine: Reals, width: float) -> Reals:
    """Relative gain [dB] of a cosine-tapered line aperture with a quadratic phase error.

    ``F(s) = integral over |x| < 1/2 of cos(pi x) exp(-j phi (2 x)**2) exp(2j pi w s x) dx`` with ``s = sin(theta)``, the
    width ``w`` in wavelengths and the phase ``phi`` at the edge, which fills the nulls as the flare of a horn does.
    Without it the first sidelobe lies at -23 dB. Source: Balanis, Antenna Theory, 4th ed., sections 12.5 and 13.3.
    """
    x = (np.arange(400) + 0.5) / 400 - 0.5
    illumination = np.cos(np.pi * x) * np.exp(-1j * PHASE_ERROR * (2 * x) ** 2)
    field = np.exp(2j * np.pi * width * np.multiply.outer(sine, x)) @ illumination
    return 20 * np.log10(np.abs(field) / np.abs(illumination.sum()))


def horn_cut(angle: Reals, hpbw: float) -> Reals:
    """Principal cut [dB] of a horn of a given half-power beamwidth [degree] over the angle off boresight [degree].

    The aperture's gain times the obliquity ``((1 + cos(theta)) / 2)**2``, plus a far-out level of -40 dB that stands for
    the edge currents and the back lobe. The width is the one whose -3.01 dB point lies at half the beamwidth.
    """
    narrow, wide = 40.0 / hpbw, 100.0 / hpbw
    half_power = np.array([np.sin(np.radians(hpbw / 2))])
    for _ in range(60):
        width = (narrow + wide) / 2
        above = aperture_gain(half_power, width)[0] > 10 * np.log10(0.5)
        narrow, wide = (width, wide) if above else (narrow, width)
    theta = np.radians(angle)
    lobe = 10 ** (aperture_gain(np.sin(theta), width) / 10) * ((1 + np.cos(theta)) / 2) ** 2
    far_out = 10 ** ((FAR_OUT + 2.0 * np.cos(7 * theta)) / 10) * (np.abs(theta) > 2 * np.radians(hpbw))
    # behind the aperture's plane the lobe formula mirrors the front and means nothing
    total = 10 * np.log10(np.where(np.abs(theta) < np.pi / 2, lobe, 0) + far_out + 10 ** (-45 / 10))
    return total - total[np.argmin(np.abs(angle))]


def horn_csv() -> str:
    """Text of ``horn-132ghz.csv``."""
    angle = np.arange(-180.0, 181.0)
    cuts = [horn_cut(angle, HPBW[plane]) for plane in ("azimuth", "elevation")]
    lines = [
        "# SYNTHETIC: computed by make_synthetic.py, not measured. A 24.5 dBi horn at 132 GHz: cosine-tapered aperture,",
        f"# half-power beamwidths {HPBW['azimuth']:g} degree (azimuth) and {HPBW['elevation']:g} degree (elevation).",
        "# angle off boresight [degree], gain relative to boresight [dB]",
        "angle,azimuth,elevation",
    ]
    lines += [f"{a:.0f},{x:.3f},{y:.3f}" for a, x, y in zip(angle, *cuts, strict=True)]
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Write every file."""
    (folder / "horn-132ghz.csv").write_text(horn_csv(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
