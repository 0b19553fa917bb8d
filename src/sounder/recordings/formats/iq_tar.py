"""The format ``.iq.tar`` of Rohde & Schwarz: a tar archive of a description in XML and plain samples.

Source: Rohde & Schwarz, "I/Q Data File Format (iq-tar)", FSV/A3000 I/Q Analyzer User Manual, 1178.8536.02, annex C.
"""

import tarfile
from math import sqrt
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from erm.common.errors import DataError
from erm.common.gate.limits import MAX_TEXT
from erm.common.gate.plain import PlainNumbers
from erm.common.printable import printable
from sounder.recordings.formats.content import Content

TYPES = {name: np.dtype(f"<{code}") for name, code in
         {"int8": "i1", "int16": "i2", "int32": "i4", "float32": "f4", "float64": "f8"}.items()}  # fmt: skip
PARTS = {"complex": 2, "real": 1}
LOAD = 50.0
"""Resistance that voltages stand for [ohm], by the source."""
MAX_MEMBERS = 64
"""Most members of an archive; chosen: it has three."""
ROOT = "RS_IQ_TAR_FileFormat"
WRITER_OF_BLOCKS = "Python iq.tar Writer"
"""What the Python package RsWaveform calls itself. It writes channels one after another, against the source."""


def is_format(path: Path) -> bool:
    """Whether the file is called ``.iq.tar``, or is a tar archive (POSIX: ``ustar`` at byte 257)."""
    if path.name.lower().endswith(".iq.tar"):
        return True
    with open(path, "rb") as file:
        file.seek(257)
        return file.read(5) == b"ustar"


def content(path: Path) -> Content:
    """Read the description of an archive; samples stay in the file.

    The dataset ``samples`` has the axes (sample, channel, iq), without channel where there is one of them, and without
    iq where floating-point numbers make complex ones. RsWaveform writes (channel, sample, iq). Numbers are as stored:
    times ``ScalingFactor`` they are volts, times ``scale_factor`` sqrt(mW) in 50 ohm.

    Raises
    ------
    DataError
        The archive is damaged, or its description is missing, is no XML, or contradicts the samples.
    """
    try:
        with tarfile.open(path, "r:") as archive:
            members = [member for _, member in zip(range(MAX_MEMBERS), archive, strict=False)]
            files = {member.name: member for member in members if member.isreg() and not member.sparse}
            names = [name for name in files if name.lower().endswith(".xml")]
            if len(names) != 1:
                raise DataError(f"{path}: {len(names)} descriptions (.xml) in the archive; expected one")
            if files[names[0]].size > MAX_TEXT:
                raise DataError(f"{path}: {printable(names[0])} is too large; expected at most {MAX_TEXT} bytes")
            extracted = archive.extractfile(files[names[0]])
            text = b"" if extracted is None else extracted.read()
    except DataError:
        raise
    except (tarfile.TarError, OSError, ValueError) as error:
        raise DataError(f"{path}: damaged tar archive ({error}); copy it again") from None
    described = _described(path, text)
    if (name := described["DataFilename"]) not in files:
        raise DataError(f"{path}: the description names the samples {printable(name)}, which the archive has not")
    described.setdefault("NumberOfChannels", "1")
    samples, channels = (_count(path, described, key) for key in ("Samples", "NumberOfChannels"))
    parts, dtype = PARTS.get(described["Format"]), TYPES.get(described["DataType"])
    if parts is None or dtype is None:
        raise DataError(
            f"{path}: Format {printable(described['Format'])}, DataType {printable(described['DataType'])}; expected "
            f"{' or '.join(PARTS)}, and one of {', '.join(TYPES)}"
        )
    member = files[name]
    expected = samples * channels * parts * dtype.itemsize
    if member.size != expected or member.offset_data + expected > path.stat().st_size:
        raise DataError(
            f"{path}: {printable(name)} has {member.size} bytes; the description says {expected}: {samples} samples of "
            f"{channels} channels, {described['Format']} {described['DataType']}"
        )
    shape: tuple[int, ...] = (samples, channels)
    if described.get("Name") == WRITER_OF_BLOCKS:
        shape = (channels, samples)
    if channels == 1:
        shape = (samples,)
    if parts == 2 and dtype.kind == "f":
        dtype = np.dtype(f"<c{2 * dtype.itemsize}")
    elif parts == 2:
        shape = (*shape, 2)
    volts = _number(path, described, "ScalingFactor") if "ScalingFactor" in described else 1.0
    attributes: dict[str, Any] = {**described, "ScalingFactor": volts, "scale_factor": volts * sqrt(1e3 / LOAD)}
    attributes["sample_rate"] = _number(path, described, "Clock")
    if "CenterFrequency" in described:
        attributes["frequency"] = _number(path, described, "CenterFrequency")
    return Content(
        "Rohde & Schwarz iq-tar",
        {"samples": PlainNumbers(path, dtype, shape, member.offset_data)},
        attributes,
    )


def _described(path: Path, text: bytes) -> dict[str, str]:
    """Texts of the description by the names of their elements."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise DataError(f"{path}: the description declares entities, which are not read")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise DataError(f"{path}: the description is no XML ({error}); export the file again") from None
    if root.tag != ROOT:
        raise DataError(f"{path}: the description is a {printable(root.tag)}; expected {ROOT}")
    found = {child.tag: (child.text or "").strip() for child in root if not len(child)}
    for element in root.iter("CenterFrequency"):
        found["CenterFrequency"] = (element.text or "").strip()
    needed = ("Samples", "Clock", "Format", "DataType", "DataFilename")
    if absent := [name for name in needed if not found.get(name)]:
        raise DataError(f"{path}: the description has no {', '.join(absent)}; export the file again")
    return found


def _count(path: Path, described: dict[str, str], key: str) -> int:
    text = described[key]
    if not text.isdecimal() or not int(text):
        raise DataError(f"{path}: {key} is {printable(text)}; expected a whole number above 0")
    return int(text)


def _number(path: Path, described: dict[str, str], key: str) -> float:
    try:
        value = float(described[key])
    except ValueError:
        value = np.nan
    if not 0 < value < np.inf:
        raise DataError(f"{path}: {key} is {printable(described[key])}; expected a positive number")
    return value
