"""What a raw or product file holds, and whether it is healthy; as labelled lines."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from erm.common.console import counted
from erm.common.errors import DataError
from erm.common.storage import SOFTWARE, open_group
from sounder.cir.impulse_response import CLIPPED, clipped
from sounder.instrument.description import Sounder
from sounder.instrument.waveform import identify, is_same_sequence
from sounder.recordings import native
from sounder.recordings.open import open_recordings
from sounder.recordings.recording import BackToBack, Recording

Lines = list[tuple[str, str]]


def describe_file(path: Path) -> Lines:
    """Describe a native recording, a back-to-back file, a product of ``sounder process``, or another of this software.

    Returns
    -------
    list of (label, text)

    Raises
    ------
    DataError
        The file is missing or none of these.
    """
    with native.opened(
        path, "a recording or a product; for MATLAB's format say how it is laid out with --layout"
    ) as file:
        kind = native.kind_of(path)
        product = "mpc" in file and "daps" in file
        other = None if product or kind else _other(file)
    if kind == native.BACK_TO_BACK:
        return describe_back_to_back(native.back_to_back(path))
    if product:
        return _product(path)
    if other:
        return other
    return [line for recording in open_recordings(path) for line in describe_recording(recording)]


def describe_recording(recording: Recording) -> Lines:
    """Describe a recording; reads all its samples."""
    levels, rails, zeros = [], [], 0
    for a, e in np.argwhere(recording.valid):
        captures = recording.captures(int(a), int(e))
        power = np.mean(np.abs(captures.astype(np.complex64 if captures.dtype.kind == "c" else np.float32)) ** 2)
        if power == 0:
            zeros += 1
            continue
        parts = 1 if captures.dtype.kind == "c" else 2
        levels.append(10 * np.log10(power * parts) - recording.agc_gain[a, e])
        if captures.dtype == np.int16:
            rails.append(clipped(captures))
    at_rails = sum(share > CLIPPED for share in rails)
    scale = 20 * np.log10(recording.scale_factor)
    health = [
        f"{len(recording.missing)} directions missing" if recording.missing else "no direction missing",
        f"{zeros} all zero" if zeros else "none zero",
        f"{at_rails} clipped" if at_rails else "none clipped",
    ]
    return [
        ("kind", "raw recording"),
        ("position", recording.name),
        ("line of sight", {1: "yes", 0: "no"}.get(recording.los, "not known")),
        *describe_sounder(recording.sounder),
        ("directions", f"{recording.azimuth.size} azimuths x {recording.elevation.size} elevations"),
        ("snapshots", f"{recording.snapshots} a direction"),
        ("TX position", _metres(recording.tx_position)),
        ("RX position", _metres(recording.rx_position)),
        (
            "received power",
            f"{min(levels) + scale:.1f} to {max(levels) + scale:.1f} dBm over the directions" if levels else "none",
        ),
        ("health", ", ".join(health)),
    ]


def describe_positions(recordings: Sequence[Recording]) -> tuple[Lines, list[str], list[list[str]]]:
    """Describe the positions of one file, a line each; reads all their samples.

    Returns
    -------
    common : list of (label, text)
        What is the same of all.
    header : list of str
        What is not.
    rows : list of list of str
        That of each position.
    """
    told = [dict(describe_recording(recording)) for recording in recordings]
    texts = {label: [lines[label] for lines in told] for label in told[0]}
    differ = [label for label, column in texts.items() if len(set(column)) > 1]
    common = [(label, column[0]) for label, column in texts.items() if label not in differ]
    return common, differ, [[lines[label] for label in differ] for lines in told]


def describe_back_to_back(b2b: BackToBack) -> Lines:
    """Describe a back-to-back recording, with the sequence found in it."""
    captures = b2b.captures
    mean = (captures if captures.dtype.kind == "c" else captures[..., 0] + 1j * captures[..., 1]).mean(axis=0)
    try:
        found = identify(mean.astype(complex))
        sequence = (
            f"order {found.order}, polynomial {list(found.polynomial)} {found.direction}, {found.polarity}, "
            f"{found.samples_per_chip} samples a chip; {found.margin:.1f} dB over the next"
        )
        described = b2b.sounder.waveform
        told = f"order {described.order}, polynomial {list(described.polynomial)} {described.direction}"
        agrees = (
            f"the same as the described {told}" if is_same_sequence(found, described) else f"not the described {told}"
        )
        sequence = f"{sequence}; {agrees}"
    except DataError as error:
        sequence = str(error)
    measured = "measured S21" if b2b.s21 is not None else "nominal"
    return [
        ("kind", "back-to-back recording"),
        ("title", b2b.title),
        *describe_sounder(b2b.sounder),
        ("snapshots", str(len(captures))),
        ("attenuation", f"{b2b.attenuation:g} dB ({measured})"),
        ("sequence found", sequence),
    ]


def _other(file: h5py.File) -> Lines | None:
    """What a truth or a map says of itself; None of a file of other software."""
    said = [(label, file.attrs.get(name)) for label, name in (("kind", "title"), ("made by", "history"))]
    source = str(file.attrs.get("source", ""))
    if not source.startswith(SOFTWARE.partition(" ")[0]):
        return None
    axes = {name: len(node) for name, node in file.items() if getattr(node, "is_scale", False) and name != "xyz"}
    holds = ", ".join(counted(length, name) for name, length in axes.items())
    return [*((label, str(text)) for label, text in said if text), ("holds", holds), ("software", source)]


def _product(path: Path) -> Lines:
    root, daps, mpc = (open_group(path, group) for group in ("/", "/daps", "/mpc"))
    strongest: Any = mpc.isel(mpc=0) if mpc.sizes["mpc"] else None
    return [
        ("kind", "product of sounder process"),
        ("position", str(root["position"].values[0])),
        ("line of sight", {1: "yes", 0: "no"}.get(int(root.attrs["los"]), "not known")),
        ("frequency", f"{root.attrs['frequency'] / 1e9:g} GHz"),
        ("TX position", _metres(root["tx_position"].values[0])),
        ("RX position", _metres(root["rx_position"].values[0])),
        ("directions", f"{daps.sizes['azimuth']} azimuths x {daps.sizes['elevation']} elevations"),
        ("noise floor", f"{float(daps['noise_floor'].median()):.1f} dB (median over directions)"),
        ("MPCs", str(mpc.sizes["mpc"])),
        (
            "outside the fan",
            f"{counted(mpc.attrs['paths_outside_fan'], 'path')} that only sidelobes saw, not among the MPCs",
        ),
        (
            "strongest",
            "none"
            if strongest is None
            else f"{float(strongest['delay']) * 1e9:.2f} ns, azimuth {float(strongest['azimuth']):.1f} degree, "
            f"path gain {float(strongest['path_gain']):.1f} dB",
        ),
        (
            "health",
            f"{root.attrs['missing_directions']} directions missing, "
            f"{root.attrs['problem_directions']} with zero or clipped samples",
        ),
        *(
            (name.removesuffix("s"), line)
            for name in ("failures", "notes")
            for line in json.loads(root.attrs.get(name, "[]"))
        ),
        ("made by", f"{root.attrs['source']}, {root.attrs['processing_options']}"),
    ]


def describe_sounder(sounder: Sounder) -> Lines:
    """Name, carrier and waveform of a sounder."""
    waveform = sounder.waveform
    return [
        ("sounder", f"{sounder.name}, {sounder.carrier.frequency / 1e9:g} GHz"),
        (
            "waveform",
            f"order {waveform.order}, {waveform.samples} samples at {waveform.sample_rate / 1e9:g} GS/s, "
            f"{waveform.period * 1e9:.2f} ns",
        ),
    ]


def _metres(position: np.ndarray) -> str:
    return ", ".join(f"{value:z.2f}" for value in position) + " m"
