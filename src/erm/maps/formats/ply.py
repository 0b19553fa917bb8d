"""Surfaces as a PLY mesh, metres, z up."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.storage import SOFTWARE
from erm.maps.formats.surfaces import Surface

HEADER = """ply
format ascii 1.0
comment {software}; metres, z up
element vertex {vertices}
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
{reflector}end_header
"""


def write(surfaces: Sequence[Surface], path: Path) -> None:
    """Write one mesh. The face property ``reflector`` is the index of the surface."""
    with atomic_path(path) as temporary:
        temporary.write_text(mesh_text(surfaces, tagged=True), encoding="ascii")


def mesh_text(surfaces: Sequence[Surface], *, tagged: bool) -> str:
    """Mesh as PLY text, to the micrometre; ``tagged`` faces have the property ``reflector``."""
    vertices, faces = joined_mesh(surfaces)
    tags = np.concatenate([np.zeros(0, int), *(np.full(len(surface.faces), surface.index) for surface in surfaces)])
    head = HEADER.format(
        software=SOFTWARE,
        vertices=len(vertices),
        faces=len(faces),
        reflector="property int reflector\n" if tagged else "",
    )
    corners = [f"{x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in vertices]
    triangles = [f"3 {a} {b} {c}" for a, b, c in faces]
    if tagged:
        triangles = [f"{triangle} {tag}" for triangle, tag in zip(triangles, tags, strict=True)]
    return head + "".join(corners) + "".join(f"{triangle}\n" for triangle in triangles)


def joined_mesh(surfaces: Sequence[Surface]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (vertex, 3) and faces (face, 3) of all surfaces as one mesh."""
    starts = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    vertices = [np.zeros((0, 3)), *(surface.vertices for surface in surfaces)]
    faces = [np.zeros((0, 3), int)]
    faces += [surface.faces + start for surface, start in zip(surfaces, starts[:-1], strict=True)]
    return np.concatenate(vertices), np.concatenate(faces)
