"""Surfaces as Wavefront OBJ, metres, z up. Each surface is one object."""

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from erm.common.atomic import atomic_path
from erm.common.storage import SOFTWARE
from erm.maps.formats.surfaces import Surface


def write(surfaces: Sequence[Surface], path: Path) -> None:
    """Write objects ``wall_0``, ``pole_1`` ... ``ground``, ``ceiling`` with their material, to the micrometre."""
    lines = [f"# {SOFTWARE}; metres, z up"]
    start = 1  # OBJ counts the vertices of the whole file from 1
    for surface in surfaces:
        lines.append(f"o {surface.kind}_{surface.index}" if surface.index >= 0 else f"o {surface.kind}")
        lines.append(f"usemtl {quote(surface.material)}")  # a space would end the name
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in surface.vertices]
        lines += ["f {} {} {}".format(*corners) for corners in surface.faces + start]
        start += len(surface.vertices)
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii")
