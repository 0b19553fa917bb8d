"""Recordings as SigMF: samples in the order azimuth, elevation, snapshot, and what a recording needs in the metadata.

What SigMF has no word for is in the extension ``sounder``; each direction is an annotation.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.gate.plain import PlainNumbers
from erm.common.storage import SOFTWARE
from sounder.instrument.description import Sounder
from sounder.recordings.formats.sigmf import DATA, META, content, is_format, metadata, samples
from sounder.recordings.recording import Captures, Recording, check, line_of_sight

__all__ = ["content", "is_format", "recordings", "write"]

EXTENSION = "sounder:recording"
VERSION = "1.2.0"
"""Of the specification of SigMF."""
GRIDS = ("agc_gain", "valid", "time")
"""What a recording has for each direction."""


def recordings(path: Path, sounder: Sounder | None = None) -> list[Recording]:
    """Open a recording that was written here.

    Raises
    ------
    DataError
        The metadata describe no directions and positions, or contradict themselves.
    """
    meta, data = path.with_suffix(META), path.with_suffix(DATA)
    held = metadata(meta)["global"].get(EXTENSION)
    if held is None:
        raise DataError(f"{path}: SigMF without directions and positions; describe them with --layout FILE")
    row = samples(path)
    try:
        described = sounder or Sounder.from_tables(held["sounder"], f"{meta}: {EXTENSION}")
        azimuth, elevation = (np.array(held[name], float) for name in ("azimuth", "elevation"))
        directions = (azimuth.size, elevation.size)
        snapshots, length = int(held["snapshots"]), described.waveform.samples
        agc, valid, time = (None if held[name] is None else np.array(held[name], float) for name in GRIDS)
        tx, rx = (np.array(held[name], float).reshape(3) for name in ("tx_position", "rx_position"))
        scale, los, name = float(held["scale_factor"]), line_of_sight(held["los"], meta), str(held["position"])
    except DataError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{meta}: {EXTENSION} is not as this software writes it ({error})") from None
    full = (*directions, snapshots, length, 2)
    if (
        row.dtype != np.dtype("<i2")
        or row.size != np.prod(full)
        or any(grid is not None and grid.shape != directions for grid in (agc, valid, time))
    ):
        raise DataError(f"{data}: {row.dtype} {row.shape}; expected int16 samples of {full}, by {meta.name}")
    iq = PlainNumbers(data, row.dtype, full, row.offset)

    def read(a: int, e: int, wanted: slice) -> Captures:
        captures: Captures = iq[a, e, wanted]
        return captures

    recording = Recording(
        name, path, described, azimuth, elevation, snapshots, tx, rx, scale,
        np.zeros(directions) if agc is None else agc,
        np.ones(directions, bool) if valid is None else valid != 0,
        los, time, read, inputs=(meta if path == data else data,),
    )  # fmt: skip
    check(recording, length)
    return [recording]


def write(recording: Recording, target: Path, *, history: str) -> None:
    """Write the samples and the metadata of a recording, direction by direction.

    Parameters
    ----------
    recording : Recording
    target : Path
        ``.sigmf-meta`` or ``.sigmf-data``; both are written.
    history : str
        The command that makes them.

    Raises
    ------
    DataError
        The captures are not IQ samples in int16.
    """
    meta, data = target.with_suffix(META), target.with_suffix(DATA)
    directions, each = recording.valid.shape, recording.snapshots * recording.sounder.waveform.samples
    digest = hashlib.sha512()
    with atomic_path(data) as temporary, open(temporary, "wb") as file:
        for a, e in np.ndindex(directions):
            captures = recording.captures(a, e) if recording.valid[a, e] else np.zeros((each, 2), np.int16)
            if captures.dtype != np.int16 or recording.kind != "iq":
                what = f"{captures.dtype} {recording.kind}"
                raise DataError(f"{recording.source}: captures are {what}; expected IQ samples in int16")
            block = captures.astype("<i2").tobytes()
            file.write(block)
            digest.update(block)
    held: dict[str, Any] = {name: getattr(recording, name) for name in GRIDS}
    held = {name: None if grid is None else np.asarray(grid, float).tolist() for name, grid in held.items()}
    held |= {name: getattr(recording, name).tolist() for name in ("azimuth", "elevation", "tx_position", "rx_position")}
    held |= {name: getattr(recording, name) for name in ("snapshots", "scale_factor", "los")}
    held |= {"position": recording.name, "sounder": json.loads(recording.sounder.model_dump_json())}
    annotations = [
        {
            "core:sample_start": k * each,
            "core:sample_count": each,
            "core:label": f"azimuth {azimuth:g} elevation {elevation:g}",
        }
        for k, (azimuth, elevation) in enumerate((a, e) for a in recording.azimuth for e in recording.elevation)
    ]
    document = {
        "global": {
            "core:datatype": "ci16_le",
            "core:sample_rate": recording.sounder.waveform.sample_rate,
            "core:version": VERSION,
            "core:description": f"Raw captures of {recording.name}, made by {history}",
            "core:hw": recording.sounder.name,
            "core:recorder": SOFTWARE,
            "core:sha512": digest.hexdigest(),
            "core:extensions": [{"name": "sounder", "version": "1.0.0", "optional": True}],
            EXTENSION: held,
        },
        "captures": [{"core:sample_start": 0, "core:frequency": recording.sounder.carrier.frequency}],
        "annotations": annotations,
    }
    with atomic_path(meta) as temporary:
        temporary.write_text(json.dumps(document, indent=1), encoding="utf-8")
