"""Make the synthetic files of this folder again.

``python calibration/make_synthetic.py [FOLDER]``. Nothing here was measured. Every number follows from the description
beside this script, the numbers below and fixed seeds, so two runs agree.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.maps.environment import Environment
from erm.tracing.trace import trace
from sounder.instrument.description import Scan, load_sounder
from sounder.instrument.touchstone import read_s21
from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.toml import read_toml
from sounder.twin.receiver import back_to_back, record

DESCRIPTION = Path(__file__).parent / "sounder-132ghz.toml"
HORN = read_toml(DESCRIPTION)["rx_antenna"]
PHASE_ERROR = np.radians(35.0)  # at the edge of the aperture; chosen to fill the nulls
HISTORY = "python calibration/make_synthetic.py"
TITLE = "SYNTHETIC back-to-back captures of a 132 GHz sounder: computed by make_synthetic.py, not measured"

Reals = NDArray[np.float64]


def aperture_gain(sine: Reals, width: float) -> Reals:
    """Relative gain [dB] of a cosine-tapered line aperture with a quadratic phase error.

    ``F(s) = integral over |x| < 1/2 of cos(pi x) exp(-j phi (2 x)**2) exp(2j pi w s x) dx`` with
    ``s = sin(theta)``, the width ``w`` in wavelengths and the phase ``phi`` at the edge. The phase error fills the
    nulls, as the flare of a horn does. Without it the first sidelobe is at -23 dB.
    Source: Balanis, Antenna Theory, 4th ed., sections 12.5 and 13.3.
    """
    x = (np.arange(400) + 0.5) / 400 - 0.5
    illumination = np.cos(np.pi * x) * np.exp(-1j * PHASE_ERROR * (2 * x) ** 2)
    field = np.exp(2j * np.pi * width * np.multiply.outer(sine, x)) @ illumination
    return 20 * np.log10(np.abs(field) / np.abs(illumination.sum()))


def horn_cut(angle: Reals, hpbw: float) -> Reals:
    """Principal cut [dB] of a horn of a half-power beamwidth [degree] at angles off boresight [degree].

    The gain of the aperture times the obliquity ``((1 + cos(theta)) / 2)**2``, plus a level about the described
    sidelobe floor, which stands for edge currents and the back lobe. The aperture is as wide as puts its -3.01 dB point
    at half the beamwidth.
    """
    narrow, wide = 40.0 / hpbw, 100.0 / hpbw
    half_power = np.array([np.sin(np.radians(hpbw / 2))])
    for _ in range(60):
        width = (narrow + wide) / 2
        above = aperture_gain(half_power, width)[0] > 10 * np.log10(0.5)
        narrow, wide = (width, wide) if above else (narrow, width)
    theta = np.radians(angle)
    lobe = 10 ** (aperture_gain(np.sin(theta), width) / 10) * ((1 + np.cos(theta)) / 2) ** 2
    far_out = 10 ** ((HORN["sidelobe_floor"] + 2.0 * np.cos(7 * theta)) / 10) * (np.abs(theta) > 2 * np.radians(hpbw))
    # behind the plane of the aperture the formula of the lobe does not hold
    total = 10 * np.log10(np.where(np.abs(theta) < np.pi / 2, lobe, 0) + far_out + 10 ** (-45 / 10))
    return total - total[np.argmin(np.abs(angle))]


def horn_csv() -> str:
    """Text of ``horn-132ghz.csv``."""
    angle = np.arange(-180.0, 181.0)
    cuts = [horn_cut(angle, HORN[f"hpbw_{plane}"]) for plane in ("azimuth", "elevation")]
    lines = [
        "# SYNTHETIC: computed by make_synthetic.py, not measured. A 24.5 dBi horn at 132 GHz with a",
        f"# cosine-tapered aperture; half-power beamwidths {HORN['hpbw_azimuth']:g} degree (azimuth) and "
        f"{HORN['hpbw_elevation']:g} degree (elevation).",
        "# angle off boresight [degree], gain relative to boresight [dB]",
        "angle,azimuth,elevation",
    ]
    lines += [f"{a:.0f},{x:.3f},{y:.3f}" for a, x, y in zip(angle, *cuts, strict=True)]
    return "\n".join(lines) + "\n"


def attenuator_s2p() -> str:
    """Text of ``attenuator-60db.s2p``: touchstone 1, real and imaginary parts.

    ``S21 = S12 = 10**(-A / 20) exp(-2j pi f tau)``, ``A = 60 + slope (f - f_0) + ripple cos(2 pi f t)`` dB;
    the reflections are -25 dB, with a phase that follows the length of their lines.
    """
    frequency = 131e9 + 4e6 * np.arange(501)
    loss = 60.0 + 0.8 * (frequency - 132e9) / 1e9 + 0.25 * np.cos(2 * np.pi * frequency * 1.1e-9)
    through = 10 ** (-loss / 20) * np.exp(-2j * np.pi * frequency * 1.5e-9)
    ports = [0.056 * np.exp(-2j * np.pi * frequency * late) for late in (0.21e-9, 0.26e-9)]
    lines = [
        "! SYNTHETIC: computed by make_synthetic.py, not measured.",
        "! A 60 dB waveguide attenuator with 0.8 dB/GHz of slope, 0.25 dB of ripple and 1.5 ns of delay.",
        "# GHz S RI R 50",
    ]
    for row in zip(frequency, ports[0], through, through, ports[1], strict=True):
        lines.append(f"{row[0] / 1e9:.3f} " + " ".join(f"{s.real:.9e} {s.imag:.9e}" for s in row[1:]))
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Write the horn, the attenuator, the back-to-back recording and a recording of two paths.

    The recordings are made by the twin with its default faults. The back-to-back uses the attenuator as its file has
    it. The other shows a direct path of 101.6 ns from 9.5 degree and a reflection off a wall, 139.3 ns from -44.0
    degree.
    """
    folder.mkdir(parents=True, exist_ok=True)
    attenuator = folder / "attenuator-60db.s2p"
    (folder / "horn-132ghz.csv").write_text(horn_csv(), encoding="utf-8")
    attenuator.write_text(attenuator_s2p(), encoding="utf-8")
    sounder = load_sounder(DESCRIPTION)
    b2b = back_to_back(sounder, read_s21(attenuator), snapshots=32, seed=132)
    write_back_to_back(
        replace(b2b, title=TITLE),
        folder / "back-to-back-132ghz.h5",
        history=HISTORY,
        inputs=[DESCRIPTION, attenuator],
    )
    wall, tx, rx = Environment.walls([[[-20, -12], [60, -12]]], top=10.0), (30, 5, 3), (0, 0, 1.5)
    scan = Scan(azimuth=tuple(range(-60, 21, 10)), elevation=sounder.scan.elevation)
    two_paths = record(
        trace(wall, tx, rx, sounder.carrier.frequency, max_order=1),
        sounder.model_copy(update={"scan": scan}),
        name="synthetic-two-paths",
        tx_position=tx,
        rx_position=rx,
        snapshots=2,
        los=1,
        seed=132,
    )
    write_recording(two_paths, folder / "recording-132ghz.h5", history=HISTORY)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
