"""Remarks about a back-to-back recording, and the recording without what is certainly wrong with it."""

from dataclasses import dataclass, replace

import numpy as np

from sounder.cir.amplitudes import rail, within_range
from sounder.instrument.description import Sounder
from sounder.quality import back_to_back as check
from sounder.quality.line_of_sight import SIGMAS
from sounder.recordings.recording import BackToBack
from sounder.remark import Code, Remark

LEAST_GROUP_DELAY = -0.1
"""Least group delay of an attenuator over the resolution, one over the bandwidth [1]: a passive device has none below
0; a tenth is for errors of the measured phase."""
STATED_LOSS_ERROR = 3.0
"""How far stated attenuation and measured S21 may differ [dB]; chosen."""


@dataclass(frozen=True)
class CheckedBackToBack:
    """A back-to-back recording without its slipped snapshots, and what is wrong with it."""

    usable: BackToBack
    remarks: list[Remark]


def check_back_to_back(b2b: BackToBack, sounder: Sounder, *, trust_all: bool = False) -> CheckedBackToBack:
    """Check a back-to-back recording against what is known in advance of it.

    Snapshots that start at another sample than most are left out, unless they are trusted. A recording that cannot be
    correlated at all, of another length or with samples that are not finite, is not checked here: it is refused when it
    is used. Responses are not checked.

    Parameters
    ----------
    b2b : BackToBack
    sounder : Sounder
        Description of the recordings that it calibrates.
    trust_all : bool
        Keep slipped snapshots.

    Examples
    --------
    >>> from sounder import shipped
    >>> from sounder.recordings.native import back_to_back
    >>> b2b = back_to_back(shipped.calibration("back-to-back-132ghz.h5"))
    >>> check_back_to_back(b2b, b2b.sounder).remarks
    []
    """
    captures = b2b.captures
    if (
        b2b.kind != "iq"
        or captures.shape[1] != sounder.waveform.samples
        or not within_range(captures)
        or not captures.any()
    ):
        return CheckedBackToBack(b2b, [])
    response = check.Response.of(captures, sounder)
    remarks = []
    if slipped := check.slipped_snapshots(response):
        at = [number for number, _ in slipped]
        detail = (
            f"{len(slipped)} of {len(captures)} back-to-back snapshots start at another sample than the others "
            f"(snapshot {at[0]}: {slipped[0][1]:+d} samples)"
        )
        share = len(slipped) / len(captures)
        remarks.append(Remark(Code.BACK_TO_BACK_SLIPPED, snapshot=at[0], figure=share, bound=0.0, detail=detail))
        if not trust_all:
            b2b = replace(b2b, captures=np.delete(captures, at, axis=0))
            response = check.Response.of(b2b.captures, sounder)
    remarks += [*_linearity(b2b, sounder, response), *_levels(b2b, sounder, response), *_attenuator(b2b, sounder)]
    return CheckedBackToBack(b2b, remarks)


def _linearity(b2b: BackToBack, sounder: Sounder, response: check.Response) -> list[Remark]:
    """Samples at a limit, products of compression, other paths."""
    share, most = rail(b2b.captures, check.TESTS)
    if share > most:
        detail = f"{100 * share:.2g} % of the back-to-back samples have one and the same largest value"
        return [Remark(Code.BACK_TO_BACK_LIMITED, figure=share, bound=most, detail=detail)]
    level, most = check.compression_level(response, sounder)
    if level > most:
        detail = f"the back-to-back holds products of compression at {level:.1f} dB"
        return [Remark(Code.BACK_TO_BACK_COMPRESSED, figure=level, bound=most, detail=detail)]
    level, most = check.outside_level(response)
    if level > most:
        detail = f"the back-to-back holds another path at {level:.1f} dB, later or earlier than cables make"
        return [Remark(Code.BACK_TO_BACK_PATHS, figure=level, bound=most, detail=detail)]
    level, samples = check.reflection_level(response)
    if level > check.REFLECTION_LEVEL:
        delay = samples / sounder.waveform.sample_rate
        detail = f"the back-to-back holds a reflection of {level:.1f} dB, {delay * 1e9:.1f} ns after its path"
        return [Remark(Code.BACK_TO_BACK_PATHS, figure=level, bound=check.REFLECTION_LEVEL, detail=detail)]
    return []


def _levels(b2b: BackToBack, sounder: Sounder, response: check.Response) -> list[Remark]:
    """Level and delay against what the description states."""
    remarks = []
    error = check.level_error(b2b, sounder, response)
    connection = sounder.back_to_back
    most = SIGMAS * float(np.hypot(sounder.transmitter.power_std, connection.attenuation_std))
    if error is not None and abs(error) > most:
        detail = (
            f"the back-to-back is {error:+.1f} dB off transmitter.power less {check.loss(b2b, sounder):.1f} dB of the "
            f"attenuator; at most {most:.1f} dB are likely"
        )
        remarks.append(Remark(Code.BACK_TO_BACK_LEVEL, figure=error, bound=most, detail=detail))
    if connection.delay is not None:
        rate = sounder.waveform.sample_rate
        late = check.peak_delay(response) / rate - connection.delay
        late = (late + sounder.waveform.period / 2) % sounder.waveform.period - sounder.waveform.period / 2
        most = SIGMAS * float(np.hypot(connection.delay_std, PEAK_ERROR / rate))
        if abs(late) > most:
            detail = (
                f"the back-to-back peaks {late * 1e9:+.2f} ns ({late * rate:+.2f} samples) off back_to_back.delay; at "
                f"most {most * 1e9:.2f} ns are likely"
            )
            remarks.append(Remark(Code.BACK_TO_BACK_DELAY, figure=late, bound=most, detail=detail))
    return remarks


PEAK_ERROR = 0.1
"""Error of the delay of a peak that is interpolated between samples [sample]: a parabola through three samples of a
Hann-windowed pulse errs by less than 0.06."""


def _attenuator(b2b: BackToBack, sounder: Sounder) -> list[Remark]:
    """Measured S21 of the attenuator: passive, causal, and of the stated loss."""
    if b2b.s21 is None:
        if b2b.attenuation < 0:
            detail = f"the attenuation is {b2b.attenuation:g} dB, which is gain"
            return [Remark(Code.ATTENUATOR, figure=b2b.attenuation, bound=0.0, detail=detail)]
        return []
    measured = check.loss(b2b, sounder)
    if measured < 0 or abs(measured - b2b.attenuation) > STATED_LOSS_ERROR:
        detail = f"the S21 of the attenuator has a loss of {measured:.1f} dB, stated are {b2b.attenuation:g} dB"
        return [Remark(Code.ATTENUATOR, figure=measured - b2b.attenuation, bound=STATED_LOSS_ERROR, detail=detail)]
    delay, least = check.group_delay(b2b, sounder), LEAST_GROUP_DELAY / sounder.bandwidth
    if delay is not None and delay < least:
        detail = f"the S21 of the attenuator has a group delay of {delay * 1e9:.2f} ns: it is conjugated"
        return [Remark(Code.ATTENUATOR, figure=delay * 1e9, bound=least * 1e9, detail=detail)]
    return []
