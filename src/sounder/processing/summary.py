"""Content and data quality of a file, as labelled lines.

Products and maps are read with h5py alone: `sounder info` must not wait for the libraries that made them.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from erm.common.console import counted
from erm.common.errors import DataError
from erm.common.storage import SOFTWARE, open_hdf5
from sounder.processing.summary_texts import Lines, line_of_sight, metres
from sounder.quality.table import read_remarks, rows
from sounder.remark import lines as remark_lines

Table = tuple[Sequence[str], Iterable[Sequence[object]]]
"""Header and rows."""

HEADER = ("what", "value")
MAX_DESCRIBED_IN_FULL = 3
"""Positions of a file that are described in full; more are described in a line each. Chosen; not derived."""


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
    expected = "a recording or a product; for a MATLAB file describe its layout with --layout"
    with open_hdf5(path, expected) as file:
        if "mpc" in file and "daps" in file:
            return _product(file)
        if "kind" not in file.attrs and (other := _other(file)):
            return other
    from sounder.processing import recording_summary as recordings
    from sounder.recordings import native
    from sounder.recordings.open import open_recordings

    if native.kind_of(path) == native.BACK_TO_BACK:
        return recordings.describe_back_to_back(native.back_to_back(path))
    return [line for recording in open_recordings(path) for line in recordings.describe_recording(recording)]


def describe_foreign_file(
    path: Path, layout: Path, sounder: Path | None = None, *, in_full: bool = False
) -> tuple[list[Table], list[str]]:
    """Describe the positions of a foreign file, and the back-to-back it holds.

    Parameters
    ----------
    path, layout, sounder : Path
        As for :func:`sounder.processing.jobs.gather`.
    in_full : bool
        Describe each position in full, also where there are more than :data:`MAX_DESCRIBED_IN_FULL`.

    Returns
    -------
    tables : list of (header, rows)
    failures : list of str
        One line for each problem of positions that cannot be used.

    Raises
    ------
    DataError
        The file, the layout or the description cannot be used.
    """
    from sounder.processing import recording_summary
    from sounder.processing.jobs import failure_lines, open_file

    found, b2b = open_file(path, layout=layout, sounder=sounder)
    recordings = [item for item in found if not isinstance(item, DataError)]
    tables: list[Table] = []
    if len(recordings) > MAX_DESCRIBED_IN_FULL and not in_full:
        common, header, rows = recording_summary.describe_positions(recordings)
        tables += [(HEADER, [*common, ("positions", str(len(rows)))]), (header, rows)]
    else:
        tables += [(HEADER, recording_summary.describe_recording(recording)) for recording in recordings]
    if b2b is not None:
        tables.append((HEADER, recording_summary.describe_back_to_back(b2b)))
    return tables, failure_lines(path, found)


def remarks_of(path: Path) -> list[dict[str, Any]]:
    """Remarks in a product, one by one with plain values; none for other files."""
    with open_hdf5(path) as file:
        return rows(file["quality"], str(file["position"].asstr()[0])) if "quality" in file else []


def _product(file: h5py.File) -> Lines:
    path, daps, mpc = file.filename, file["daps"], file["mpc"]
    try:
        attributes: dict[str, Any] = dict(file.attrs)
        lines = [
            ("kind", "product of sounder process"),
            ("position", str(file["position"].asstr()[0])),
            ("line of sight", line_of_sight(int(attributes["los"]))),
            ("frequency", f"{attributes['frequency'] / 1e9:g} GHz"),
            ("TX position", metres(file["tx_position"][0])),
            ("RX position", metres(file["rx_position"][0])),
            ("directions", f"{daps['azimuth'].size} azimuths x {daps['elevation'].size} elevations"),
            ("noise floor", f"{np.nanmedian(daps['noise_floor'][()]):.1f} dB (median over directions)"),
            ("MPCs", str(mpc["delay"].size)),
            (
                "outside the scan",
                f"{counted(mpc.attrs['paths_outside_fan'], 'path')} seen by sidelobes only; not among the MPCs",
            ),
            ("strongest", _strongest(mpc)),
            (
                "health",
                f"{counted(attributes['missing_directions'], 'direction')} missing, "
                f"{attributes['problem_directions']} with zero or clipped samples",
            ),
        ]
        remarks = read_remarks(file["quality"])
        recorded = int(attributes["recorded_directions"])
        for label, which in (("failure", True), ("note", False)):
            lines += [(label, line) for line in remark_lines(remarks, recorded, failures=which)]
        lines.append(("made by", f"{attributes['source']}, {attributes['processing_options']}"))
    except KeyError as error:
        raise DataError(f"{path}: the product is incomplete ({error}); process the recording again") from None
    return lines


def _strongest(mpc: h5py.Group) -> str:
    if not mpc["delay"].size:
        return "none"
    delay, azimuth, gain = (float(mpc[name][0]) for name in ("delay", "azimuth", "path_gain"))
    return f"{delay * 1e9:.2f} ns, azimuth {azimuth:.1f} degree, path gain {gain:.1f} dB"


def _other(file: h5py.File) -> Lines | None:
    """What a truth file or a map says about itself; None for a file of other software."""
    source = str(file.attrs.get("source", ""))
    if not source.startswith(SOFTWARE.partition(" ")[0]):
        return None
    labelled = [(label, file.attrs.get(name)) for label, name in (("kind", "title"), ("made by", "history"))]
    axes = {name: len(node) for name, node in file.items() if getattr(node, "is_scale", False) and name != "xyz"}
    holds = ", ".join(counted(length, name) for name, length in axes.items())
    return [*((label, str(text)) for label, text in labelled if text), ("holds", holds), ("software", source)]
