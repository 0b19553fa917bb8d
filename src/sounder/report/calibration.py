"""Response of the back-to-back recording over the band."""

from typing import Any

import numpy as np

from erm.common.errors import DataError
from sounder.cir.impulse_response import calibrate
from sounder.processing.recording_summary import describe_back_to_back
from sounder.recordings.recording import BackToBack
from sounder.report.numbers import rounded


def back_to_back(b2b: BackToBack) -> dict[str, Any]:
    """What a back-to-back recording says of the instrument.

    Returns
    -------
    dict
        ``facts``, labels and texts; ``frequency`` from the carrier [MHz] and ``response`` [dB], the gain of the chain
        that de-embedding takes out, relative to its mean over the band; both empty if it cannot be used.
    """
    facts = [list(line) for line in describe_back_to_back(b2b)]
    try:
        made = calibrate(b2b, b2b)
    except DataError as error:
        return {"facts": [*facts, ["not usable", str(error)]], "frequency": [], "response": []}
    frequency = np.fft.fftfreq(made.transfer.size, 1 / made.sample_rate)
    # where the window of the band is near its edge it rules the filter, not the chain
    inside = (made.weight > made.weight.max() / 2) & (np.abs(made.transfer) > 0)
    order = np.argsort(frequency[inside])
    response = made.weight[inside] / np.abs(made.transfer[inside])
    level = 20 * np.log10(response / np.sqrt(np.mean(response**2)))
    return {
        "facts": facts,
        "frequency": rounded(frequency[inside][order] / 1e6, 2),
        "response": rounded(level[order], 2),
    }
