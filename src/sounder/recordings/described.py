"""Description of the sounder of a foreign file, after the keys of its layout."""

from typing import Any

import numpy as np

from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.instrument.periodic import Periodic
from sounder.instrument.waveform_description import Waveform
from sounder.recordings.axes import lengths
from sounder.recordings.foreign_file import ForeignFile
from sounder.recordings.layout import Layout, Numbers, Reference
from sounder.recordings.sweep import sweep_tables


def described(file: ForeignFile, layout: Layout, sounder: Sounder) -> tuple[Sounder, Waveform | Periodic | None]:
    """Describe the sounder of a file, after the keys of the layout replaced those of ``sounder``.

    Returns
    -------
    sounder : Sounder
        Of the captures. If they are responses, frequencies or a sample rate in the layout replace the waveform.
    sequence : Waveform, Periodic or None
        What impulse responses were correlated with, where it is described, or a back-to-back is to be correlated.
    """

    def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
        result = dict(base)
        for key, value in over.items():
            if isinstance(value, dict) and value.keys() & {"dataset", "attribute", "of"}:
                reference = Reference.from_tables(value, f"{file.path}: the layout's [sounder]: {key}")
                label = f"sounder: {key}"
                named = key == "name"
                result[key] = file.text(reference, label) if named else file.numbers(reference, label).tolist()
            elif isinstance(value, dict):
                known = result.get(key)
                result[key] = merged(known if isinstance(known, dict) else {}, value)
            else:
                result[key] = value
        return result

    source = f"{file.path}: the layout's [sounder]"
    base = sounder.model_dump()
    for name in ("tx_antenna", "rx_antenna"):
        if "pattern" in layout.sounder.get(name, {}):  # what is known of another pattern does not apply
            base[name] = {"gain": base[name]["gain"]}
    if "kind" in layout.sounder.get("waveform", {}):  # another waveform altogether
        base["waveform"] = {}
    tables = merged(base, layout.sounder)
    if set(layout.sounder.get("carrier", {})) == {"frequency"}:  # the oscillator of another carrier does not apply
        tables["carrier"] = {"frequency": tables["carrier"]["frequency"]}
    thru = layout.back_to_back
    told = "waveform" in layout.sounder and "points" not in layout.sounder["waveform"]
    correlated = layout.captures.kind == "cir" and thru is not None and (told or thru.kind == "iq")
    kind = Periodic if "kind" in tables["waveform"] else Waveform
    sequence = kind.from_tables(tables["waveform"], f"{source}: waveform") if correlated else None
    tables |= _of_responses(file, layout, sequence)
    if "waveform" in layout.sounder or layout.captures.kind != "iq":  # the bandwidth of another waveform does not apply
        own = layout.sounder.get("processing", {}).get("bandwidth")
        tables["processing"] = {**tables["processing"], "bandwidth": own}
    return Sounder.from_tables(tables, source), sequence


def is_descending(file: ForeignFile, frequency: Numbers | None) -> bool:
    """Whether the frequencies of transfer functions are in descending order."""
    if frequency is None:
        return False
    values = np.atleast_1d(file.numbers(frequency, "frequency"))
    return bool(values[0] > values[-1])


def require_same_frequencies(
    file: ForeignFile, frequency: Numbers | None, sounder: Sounder, *, carrier: bool = True
) -> None:
    """Refuse a back-to-back that was measured at other frequencies than the captures.

    ``carrier`` is whether the carrier of the sounder is in the middle of them.
    """
    if frequency is None:
        return
    own = sweep_tables(np.atleast_1d(file.numbers(frequency, "back_to_back.frequency")).astype(float), file.path)
    same = not carrier or np.isclose(own["carrier"]["frequency"], sounder.carrier.frequency)
    if own["waveform"]["points"] != sounder.waveform.samples or not same:
        raise DataError(
            f"{file.path}: the back-to-back has {own['waveform']['points']} frequencies around "
            f"{own['carrier']['frequency'] / 1e9:g} GHz, the captures have {sounder.waveform.samples} around "
            f"{sounder.carrier.frequency / 1e9:g} GHz; measure both at the same frequencies"
        )


def _of_responses(file: ForeignFile, layout: Layout, sequence: Waveform | Periodic | None) -> dict[str, Any]:
    """Tables of the description that follow from the frequencies or from the sample rate of responses."""
    block = layout.captures
    if block.frequency is not None:
        found = sweep_tables(
            np.atleast_1d(file.numbers(block.frequency, "captures.frequency")).astype(float), file.path
        )
        if "carrier" in layout.sounder:  # the sweep is that of an intermediate frequency
            del found["carrier"]
    elif block.sample_rate is not None:
        points = lengths(file, block)["sample"]
        rate = file.scale(block.sample_rate, "captures.sample_rate")
        found = {"waveform": {"points": points, "step": rate / points}}
        if sequence is not None and sequence.chip_rate is not None:
            found["waveform"]["chip_rate"] = sequence.chip_rate
    else:
        return {}
    return found
