"""The direct path of a position with line of sight: it is where geometry says, and as strong as free space says."""

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from erm.common.constants import c
from sounder.instrument.antenna_pattern import Pattern
from sounder.instrument.description import Sounder
from sounder.mpc.extract import LOCATED
from sounder.recordings.recording import Recording
from sounder.remark import Code, Remark

SIGMAS = 4.0
"""Standard deviations that a direct path may be off: one of four Gaussian figures is in 4000 positions. Beside paths
that are not resolved the errors have longer tails, which leaves a false remark in about a thousand."""
POSITION_STD = 0.03
"""Error of the coordinates of an antenna if none is stated [m]: of a total station, or of a good satellite receiver."""
HEADING_STD, TILT_STD = 1.5, 1.5
"""Errors of the zeros of azimuth and of elevation if none are stated [degree]: of a compass, or of a mast."""
LEVEL_STD = 2.0
"""Error of the gain if none is stated [dB]: of attenuator, antennas, and reflections that are not resolved."""
LEAST_SNR = 20.0
"""Signal-to-noise ratio in its best beam above which a direct path must be found [dB]."""

Real = NDArray[np.float64]


@dataclass(frozen=True)
class DirectPath:
    """The direct path as geometry has it: delay [s], azimuth, elevation [degree], path gain [dB]."""

    delay: float
    azimuth: float
    elevation: float
    path_gain: float

    @classmethod
    def between(cls, tx: Real, rx: Real, frequency: float) -> "DirectPath":
        """Direct path between two places (3,) [m], with the gain of free space (Friis, 1946)."""
        east, north, up = tx - rx
        distance = float(np.linalg.norm(tx - rx))
        return cls(
            distance / c,
            float(np.degrees(np.arctan2(north, east)) % 360),
            float(np.degrees(np.arcsin(up / distance))),
            float(-20 * np.log10(4 * np.pi * distance * frequency / c)),
        )


def remarks_on_line_of_sight(recording: Recording, mpc: xr.Dataset, daps: xr.Dataset) -> list[Remark]:
    """Compare the direct path of a position with line of sight with geometry and free space.

    An MPC is the direct path if delay, azimuth, elevation and gain are all within `SIGMAS` standard deviations: those
    of the MPC, and usual ones of survey and calibration where the description states none. If there is no such MPC,
    the one that agrees best tells what is wrong: its delay, its direction, or its level. If none agrees in two of the
    three, no direct path was found.

    Nothing is said where the direct path is too weak to be found in its best beam, where a beam that has it in its
    main lobe is missing, or where it arrives so far outside the scan that only sidelobes see it.

    Parameters
    ----------
    recording : Recording
    mpc, daps : xarray.Dataset
        Groups of its product.

    Returns
    -------
    list of Remark
        At most one.
    """
    sounder = recording.sounder
    direct = DirectPath.between(recording.tx_position, recording.rx_position, sounder.carrier.frequency)
    if recording.los != 1 or not _is_seen(direct, sounder, daps):
        return []
    deviation, bound = _deviations(direct, mpc, sounder)
    late, off, weak = (np.abs(deviation) / bound)[:, [0, 1, 3]].T
    off = np.fmax(off, np.abs(deviation[:, 2]) / bound[:, 2])
    wrong = np.stack([late > 1, off > 1, weak > 1])
    if not wrong.size or wrong.sum(axis=0).min() > 1:
        where = f"{direct.delay * 1e9:.2f} ns, azimuth {direct.azimuth:.1f}, elevation {direct.elevation:.1f} degree"
        detail = f"no direct path is found at {where}, {direct.path_gain:.1f} dB, though los says line of sight"
        return [Remark(Code.LOS_ABSENT, detail=detail)]
    if wrong.sum(axis=0).min() == 0:
        return []
    best = np.flatnonzero(wrong.sum(axis=0) == 1)
    best = best[np.argmax(mpc["path_gain"].values[best])]
    which = int(np.argmax(wrong[:, best]))
    if which == 0:
        figure, most = deviation[best, 0], bound[best, 0]
        samples = figure * sounder.waveform.sample_rate
        detail = (
            f"the direct path is {_signed(figure * 1e9)} ns ({_signed(samples)} samples, {_signed(figure * c)} m) off "
            f"the distance of the antennas; at most {most * 1e9:.2f} ns are likely"
        )
        return [Remark(Code.LOS_DELAY, figure=figure, bound=most, detail=detail)]
    if which == 2:
        figure, most = deviation[best, 3], bound[best, 3]
        detail = f"the direct path is {_signed(figure)} dB off free space; at most {most:.1f} dB are likely"
        return [Remark(Code.LOS_LEVEL, figure=figure, bound=most, detail=detail)]
    axis = 1 if abs(deviation[best, 1]) > bound[best, 1] else 2
    figure, most = deviation[best, axis], bound[best, axis]
    detail = (
        f"the direct path comes from {_signed(figure)} degree off its {('azimuth', 'elevation')[axis - 1]}; at most "
        f"{most:.1f} degree are likely"
    )
    return [Remark(Code.LOS_DIRECTION, figure=figure, bound=most, detail=detail)]


def _deviations(direct: DirectPath, mpc: xr.Dataset, sounder: Sounder) -> tuple[Real, Real]:
    """Deviations of MPCs from the direct path, and their bounds (mpc, 4): delay, azimuth, elevation, gain."""
    period = sounder.waveform.period
    names = ("delay", "azimuth", "elevation", "path_gain")
    deviation = np.stack([mpc[name].values - getattr(direct, name) for name in names], axis=1)
    deviation[:, 0] = (deviation[:, 0] + period / 2) % period - period / 2
    deviation[:, 1] = (deviation[:, 1] + 180) % 360 - 180
    std = np.stack([mpc[f"{name}_std"].values for name in names], axis=1)
    survey, connection = sounder.survey, sounder.back_to_back
    between = 0.0 if survey.position_std else np.sqrt(2) * POSITION_STD
    across = np.degrees(between / (c * direct.delay))
    usual = np.array(
        [
            between / c,
            np.hypot(0.0 if survey.heading_std else HEADING_STD, across),
            np.hypot(0.0 if survey.tilt_std else TILT_STD, across),
            0.0 if connection.attenuation_std else LEVEL_STD,
        ]
    )
    return deviation, SIGMAS * np.hypot(std, usual)


def _is_seen(direct: DirectPath, sounder: Sounder, daps: xr.Dataset) -> bool:
    """Whether the direct path must be found: above the sidelobes of a beam, and above the noise."""
    pattern = Pattern.of(sounder.rx_antenna)
    azimuth, elevation = daps["azimuth"].values[:, None], daps["elevation"].values[None, :]
    beam = pattern.beam_gain(np.array(direct.azimuth), np.array(direct.elevation), azimuth, elevation)
    floor = daps["noise_floor"].values
    inside = beam >= _least_beam(sounder, pattern)
    if pattern.directive and not (inside.any() and np.isfinite(floor[inside]).all()):
        return False
    return bool(np.nanmax(direct.path_gain + pattern.gain + beam - floor) > LEAST_SNR)


def _least_beam(sounder: Sounder, pattern: Pattern) -> float:
    """Gain relative to boresight below which sidelobes are not told from the main lobe [dB]."""
    sidelobes = max(pattern.sidelobe_level, pattern.floor) + sounder.rx_antenna.margin_above
    return float(sidelobes + LOCATED)


def _signed(value: float) -> str:
    return f"{value:+.3g}"
