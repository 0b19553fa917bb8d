"""Content and data quality of a recording or a back-to-back recording, as labelled lines."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from erm.common.console import counted
from erm.common.errors import DataError
from sounder.instrument.description import Sounder
from sounder.instrument.waveform import identify, is_same_sequence
from sounder.processing.summary_texts import Lines, line_of_sight, metres
from sounder.recordings.recording import CLIPPED_SHARE, BackToBack, Recording, clipped_share


def describe_recording(recording: Recording) -> Lines:
    """Describe a recording. All its samples are read."""
    levels, zeros, clipped = [], 0, 0
    beams = recording.departures
    for beam, (a, e) in product(beams, np.argwhere(recording.valid)):
        captures = beam.captures(int(a), int(e))
        power = np.mean(np.abs(captures.astype(np.complex64 if captures.dtype.kind == "c" else np.float32)) ** 2)
        if power == 0:
            zeros += 1
            continue
        parts = 1 if captures.dtype.kind == "c" else 2  # I and Q apart: the mean is over twice as many numbers
        levels.append(10 * np.log10(power * parts) - beam.agc_gain[a, e])
        clipped += clipped_share(captures) > CLIPPED_SHARE
    scale = 20 * np.log10(recording.scale_factor)
    health = [
        f"{counted(len(recording.missing), 'direction')} missing" if recording.missing else "no direction missing",
        f"{zeros} all zero" if zeros else "none zero",
        f"{clipped} clipped" if clipped else "none clipped",
    ]
    return [
        ("kind", "raw recording"),
        ("position", recording.name),
        ("line of sight", line_of_sight(recording.los)),
        *describe_sounder(recording.sounder),
        ("directions", _directions(recording.azimuth.size, recording.elevation.size)),
        *[("TX directions", _directions(recording.tx_azimuth.size, recording.tx_elevation.size)) for _ in beams[1:2]],
        ("snapshots", f"{recording.snapshots} per direction"),
        ("TX position", metres(recording.tx_position)),
        ("RX position", metres(recording.rx_position)),
        (
            "received power",
            f"{min(levels) + scale:.1f} to {max(levels) + scale:.1f} dBm over the directions" if levels else "none",
        ),
        ("health", ", ".join(health)),
    ]


def _directions(azimuths: int, elevations: int) -> str:
    return f"{azimuths} azimuths x {elevations} elevations"


def describe_positions(recordings: Sequence[Recording]) -> tuple[Lines, list[str], list[list[str]]]:
    """Describe the positions of one file, in a line each. All their samples are read.

    Returns
    -------
    common : list of (label, text)
        What all positions have in common.
    header : list of str
        Labels of what differs.
    rows : list of list of str
        One a position.
    """
    described = [dict(describe_recording(recording)) for recording in recordings]
    texts = {label: [lines[label] for lines in described] for label in described[0]}
    header = [label for label, column in texts.items() if len(set(column)) > 1]
    common = [(label, column[0]) for label, column in texts.items() if label not in header]
    return common, header, [[lines[label] for label in header] for lines in described]


def _sequence(b2b: BackToBack) -> str:
    """Which m-sequence a back-to-back recording holds."""
    captures = b2b.captures
    if b2b.kind != "iq":
        return "none, as these are responses"
    mean = (captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]).mean(axis=0)
    try:
        found = identify(mean.astype(complex))
        described = b2b.sounder.sequence
    except DataError as error:
        return str(error)
    expected = f"order {described.order}, polynomial {list(described.polynomial)} {described.direction}"
    same = is_same_sequence(found, described)
    return (
        f"order {found.order}, polynomial {list(found.polynomial)} {found.direction}, {found.polarity}, "
        f"{found.samples_per_chip} samples per chip; {found.margin:.1f} dB above the next best; "
        f"{'agrees with the description:' if same else 'differs from the description:'} {expected}"
    )


def describe_back_to_back(b2b: BackToBack) -> Lines:
    """Describe a back-to-back recording and the sequence that is found in it."""
    measured = "measured S21" if b2b.s21 is not None else "nominal"
    return [
        ("kind", "back-to-back recording"),
        ("title", b2b.title),
        *describe_sounder(b2b.sounder),
        ("snapshots", str(len(b2b.captures))),
        ("attenuation", f"{b2b.attenuation:g} dB ({measured})"),
        ("sequence found", _sequence(b2b)),
    ]


def describe_sounder(sounder: Sounder) -> Lines:
    """Name, carrier and waveform of a sounder."""
    waveform = sounder.waveform
    return [
        ("sounder", f"{sounder.name}, {sounder.carrier.frequency / 1e9:g} GHz"),
        (
            "waveform",
            f"{waveform.summary}, {waveform.samples} samples at {waveform.sample_rate / 1e9:g} GS/s, "
            f"{waveform.period * 1e9:.2f} ns",
        ),
    ]
