"""SigMF: plain samples (``.sigmf-data``) and their metadata in JSON (``.sigmf-meta``).

Source: The GNU Radio Foundation, "Signal Metadata Format Specification", version 1.2.
"""

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.files import read_bytes, require_file
from erm.common.gate.limits import MAX_TEXT
from erm.common.gate.nesting import parse_json
from erm.common.gate.plain import PlainNumbers
from erm.common.printable import printable
from sounder.recordings.formats.content import Content

META, DATA = ".sigmf-meta", ".sigmf-data"
DATATYPE = re.compile(r"([cr])([fiu])(8|16|32|64)(_le|_be)?")


def is_format(path: Path) -> bool:
    """Whether the file is metadata or samples of SigMF."""
    return path.suffix.lower() in (META, DATA)


def metadata(path: Path) -> dict[str, Any]:
    """Read the JSON object of a ``.sigmf-meta`` file.

    Raises
    ------
    DataError
        The file is missing or is no metadata.
    """
    require_file(path, "the metadata of SigMF")
    try:
        described: dict[str, Any] = dict(parse_json(read_bytes(path, "metadata of SigMF", limit=MAX_TEXT).decode()))
        captures = described.get("captures") or [{}]
        return {**described, "global": dict(described["global"]), "captures": [dict(capture) for capture in captures]}
    except DataError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(f"{path}: no metadata of SigMF ({error}); expected JSON with the members of SigMF") from None


def samples(path: Path) -> PlainNumbers:
    """Describe the samples of a recording, which stay in the file: axes (sample, channel, iq).

    Channel is left out where there is one of them, iq where floating-point numbers make complex ones.

    Raises
    ------
    DataError
        A file is missing or malformed, or the samples are not those that the metadata describe.
    """
    data, meta = path.with_suffix(DATA), path.with_suffix(META)
    described = metadata(meta)
    require_file(data, "the samples of SigMF")
    of_all, first = described["global"], described["captures"][0]
    kind = DATATYPE.fullmatch(str(of_all.get("core:datatype")))
    if kind is None or (kind[3] != "8" and kind[4] is None) or (kind[2] == "f") > (kind[3] in ("32", "64")):
        found = printable(str(of_all.get("core:datatype")))
        raise DataError(f"{meta}: core:datatype is {found}; expected one such as ci16_le or cf32_le")
    order = ">" if kind[4] == "_be" else "<"
    width = int(kind[3]) // 8
    header, trailing = first.get("core:header_bytes", 0), of_all.get("core:trailing_bytes", 0)
    channels = of_all.get("core:num_channels", 1)
    if not all(isinstance(value, int) and value >= 0 for value in (header, trailing, channels)) or not channels:
        raise DataError(f"{meta}: core:num_channels, header_bytes or trailing_bytes is no whole number")
    if any(capture.get("core:header_bytes") for capture in described["captures"][1:]):
        raise DataError(f"{meta}: captures have headers between them, which are not read; write one capture a file")
    is_complex, is_float = kind[1] == "c", kind[2] == "f"
    item = width * (2 if is_complex else 1) * channels
    stored = data.stat().st_size - header - trailing
    if stored <= 0 or stored % item:
        raise DataError(f"{data}: {stored} bytes of samples; expected a multiple of {item}, by {meta.name}")
    _require_hash(data, meta, of_all.get("core:sha512"))
    shape: tuple[int, ...] = (stored // item,) if channels == 1 else (stored // item, channels)
    if is_complex and is_float:
        return PlainNumbers(data, np.dtype(f"{order}c{2 * width}"), shape, header)
    return PlainNumbers(data, np.dtype(f"{order}{kind[2]}{width}"), (*shape, 2) if is_complex else shape, header)


def content(path: Path) -> Content:
    """Read the metadata; the dataset ``samples`` is that of :func:`samples`.

    Members of ``global`` and of the first capture are attributes, without ``core:``; further captures are not told
    apart.
    """
    row = samples(path)
    described = metadata(path.with_suffix(META))
    attributes = {
        str(name).removeprefix("core:"): value
        for name, value in {**described["global"], **described["captures"][0]}.items()
        if isinstance(value, (int, float, str))
    }
    partner = path.with_suffix(DATA if path.suffix.lower() == META else META)
    return Content("SigMF", {"samples": row}, attributes, (partner,))


def _require_hash(data: Path, meta: Path, stated: Any) -> None:
    """Compare samples with their hash, if the metadata state one."""
    if stated is None:
        return
    with open(data, "rb") as file:
        found = hashlib.file_digest(file, "sha512").hexdigest()
    if found != str(stated).lower():
        raise DataError(f"{data}: the samples are not those of core:sha512 in {meta.name}; copy both files again")
