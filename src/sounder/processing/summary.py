"""Content and data quality of a file, as labelled lines.

Products and maps are read without xarray: `sounder info` must not wait for the libraries that made them.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.console import counted
from erm.common.errors import DataError
from erm.common.gate.hdf5 import Dataset, Group, is_hdf5, open_hdf5
from erm.common.printable import printable
from erm.common.storage import SOFTWARE
from sounder.processing.summary_texts import Lines, line_of_sight, metres
from sounder.quality.table import read_remarks, rows
from sounder.recordings.formats.content import Content
from sounder.recordings.formats.find import content_of
from sounder.remark import lines as remark_lines

Table = tuple[Sequence[str], Iterable[Sequence[object]]]
"""Header and rows."""

DEPARTURE = "departure_azimuth"
"""Column of MPCs of a double-directional scan."""
HEADER = ("what", "value")
MAX_DESCRIBED_IN_FULL = 3
"""Positions of a file that are described in full; more are described in a line each. Chosen; not derived."""


def describe_file(path: Path, sounder: Path | None = None) -> Lines:
    """Describe a native recording, a back-to-back file, a product of ``sounder process``, or another of this software.

    Parameters
    ----------
    path : Path
    sounder : Path, optional
        Description of what may be in plain samples.

    Returns
    -------
    list of (label, text)

    Raises
    ------
    DataError
        The file is missing or none of these.
    """
    expected = f"a recording or a product; describe a MATLAB file with --layout, plain samples in {path.name}.toml"
    if path.is_file() and not is_hdf5(path) and (content := content_of(path)) is not None:
        return [*_content(content), *_codes(content, sounder)]
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


def _content(content: Content) -> Lines:
    """What a layout can refer to in a file of plain samples."""
    arrays = [(name, f"{array.dtype} {tuple(array.shape)}") for name, array in content.items()]
    attributes = [(f"attribute {name}", printable(f"{value}")) for name, value in content.attrs.items()]
    return [("kind", content.kind), *arrays, *attributes]


def _codes(content: Content, sounder: Path | None) -> Lines:
    """Codes in plain samples, of the kind that a description names: of GPS, all satellites."""
    if sounder is None:
        return []
    from sounder.instrument.acquisition import acquire
    from sounder.instrument.codes import GPS_DELAYS
    from sounder.instrument.description import load_sounder
    from sounder.instrument.periodic import Periodic
    from sounder.instrument.waveform import held_template

    waveform = load_sounder(sounder).sent
    row = np.asarray(next(iter(content.values()))[()])
    row = row @ [1, 1j] if row.dtype.kind in "iu" else row
    if row.ndim != 1 or row.size < waveform.samples:
        raise DataError(f"{sounder}: a period has {waveform.samples} samples; the file holds {row.shape}")
    templates = {waveform.summary: held_template(waveform).astype(complex)}
    if isinstance(waveform, Periodic) and waveform.kind == "gps_ca":
        satellites = (waveform.model_copy(update={"prn": prn}) for prn in range(1, len(GPS_DELAYS) + 1))
        templates = {f"PRN {one.prn}": one.sampled for one in satellites}
    found = acquire(row, templates, waveform.sample_rate)
    texts = [f"{one.name}, {one.level:.1f} dB over the median, {one.offset:+.0f} Hz" for one in found]
    return [("code found", text) for text in texts or ["none"]]


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
    from sounder.processing.jobs import Explained, failure_lines, open_file

    found, b2b = open_file(path, Explained(layout=layout, sounder=sounder))
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
        try:
            return rows(file.group("quality"), file.dataset("position").texts()[0]) if "quality" in file else []
        except (KeyError, IndexError, ValueError, TypeError) as error:
            raise _incomplete(file, error) from None


def _product(file: Group) -> Lines:
    attributes = file.attrs
    try:
        daps, mpc = file.group("daps"), file.group("mpc")
        outside = int(mpc.attrs.number("paths_outside_fan"))
        lines = [
            ("kind", "product of sounder process"),
            ("position", file.dataset("position").texts()[0]),
            ("line of sight", line_of_sight(int(attributes.number("los")))),
            ("frequency", f"{attributes.number('frequency') / 1e9:g} GHz"),
            ("TX position", metres(file.dataset("tx_position").numbers()[0])),
            ("RX position", metres(file.dataset("rx_position").numbers()[0])),
            ("directions", f"{daps.dataset('azimuth').size} azimuths x {daps.dataset('elevation').size} elevations"),
            *_tx_directions(daps),
            ("noise floor", _noise_floor(daps.dataset("noise_floor").numbers())),
            ("MPCs", str(mpc.dataset("delay").size)),
            (
                "outside the scan",
                f"{counted(outside, 'path')} seen by sidelobes only; not among the MPCs",
            ),
            ("strongest", _strongest(mpc)),
            (
                "health",
                f"{counted(int(attributes.number('missing_directions')), 'direction')} missing, "
                f"{int(attributes.number('problem_directions'))} with zero or clipped samples",
            ),
        ]
        remarks = read_remarks(file.group("quality"))
        recorded = int(attributes.number("recorded_directions"))
        for label, which in (("failure", True), ("note", False)):
            lines += [(label, printable(line)) for line in remark_lines(remarks, recorded, failures=which)]
        lines.append(("made by", ", ".join(attributes.label(name, "?") for name in ("source", "processing_options"))))
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise _incomplete(file, error) from None
    return lines


def _incomplete(file: Group, error: Exception) -> DataError:
    reason = str(error).removeprefix(f"{file.path}: ")
    return DataError(f"{file.path}: the product is incomplete ({reason}); process the recording again")


def _strongest(mpc: Group) -> str:
    if not mpc.dataset("delay").size:
        return "none"
    delay, azimuth, gain = (float(mpc.dataset(name).numbers()[0]) for name in ("delay", "azimuth", "path_gain"))
    left = f" from {float(mpc.dataset(DEPARTURE).numbers()[0]):.1f} at departure" if DEPARTURE in mpc else ""
    return f"{delay * 1e9:.2f} ns, azimuth {azimuth:.1f} degree{left}, path gain {gain:.1f} dB"


def _noise_floor(floor: np.ndarray) -> str:
    """Median over the directions that have one."""
    known = floor[~np.isnan(floor)]
    return f"{np.median(known):.1f} dB (median over directions)" if known.size else "of no direction"


def _tx_directions(daps: Group) -> Lines:
    """How many directions the transmit antenna was pointed at, where these are several."""
    if "tx_azimuth" not in daps:
        return []
    sizes = [daps.dataset(f"tx_{axis}").size for axis in ("azimuth", "elevation")]
    return [("TX directions", f"{sizes[0]} azimuths x {sizes[1]} elevations")]


def _other(file: Group) -> Lines | None:
    """What a truth file or a map says about itself; None for a file of other software."""
    source = file.attrs.label("source", "")
    if not source.startswith(SOFTWARE.partition(" ")[0]):
        return None
    labelled = [(label, file.attrs.label(name, "")) for label, name in (("kind", "title"), ("made by", "history"))]
    axes = {name: node.size for name, node in file.items() if isinstance(node, Dataset) and node.is_scale}
    axes.pop("xyz", None)
    holds = ", ".join(counted(length, name) for name, length in axes.items())
    return [*((label, text) for label, text in labelled if text), ("holds", holds), ("software", source)]
