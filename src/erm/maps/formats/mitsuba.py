"""Surfaces as a scene of Mitsuba 3 for the ray tracer Sionna RT: an XML file, and a PLY mesh beside it a material.

Sionna RT knows a material by the id of its ``bsdf``: ``mat-itu_concrete`` and its like are looked up in ITU-R
P.2040 at the frequency of the simulation, anything else must be a ``radio-material`` of constant permittivity and
conductivity. Both are taken for slabs of 0.1 m, which at millimetre waves and above let as little through as the
half-spaces of `erm.tracing.trace`.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import pi
from pathlib import Path
from xml.etree import ElementTree

from scipy.constants import epsilon_0

from erm.common.storage import SOFTWARE, atomic_path
from erm.maps.formats import ply
from erm.maps.formats.surfaces import Surface
from erm.maps.materials import LIBRARY, Material

# GHz at which Sionna RT 2 has a row of ITU-R P.2040 for the name; it refuses to simulate at others
ITU_BANDS: Mapping[str, tuple[tuple[float, float], ...]] = {
    "concrete": ((1, 100), (110, 330)),
    "brick": ((1, 40), (110, 330)),
    "plasterboard": ((1, 400),),
    "wood": ((0.001, 400),),
    "glass": ((0.1, 450),),
    "marble": ((1, 60), (100, 400)),
    "metal": ((1, 100),),
}


def write(surfaces: Sequence[Surface], materials: Mapping[str, Material], frequency: float, path: Path) -> None:
    """Write the scene whole or not at all.

    All files take their places after the last has been written, the XML after the meshes it names.

    Parameters
    ----------
    surfaces : sequence of Surface
    materials : mapping of name to Material
        At least those of the surfaces.
    frequency : float
        At which materials that Sionna RT does not know, or not there, are made constant [Hz].
    path : path
        The XML file; the meshes are called ``STEM-MATERIAL.ply``.
    """
    scene = ElementTree.Element("scene", version="2.1.0")
    scene.append(ElementTree.Comment(f" {SOFTWARE}; metres, z up; constant materials are those at {frequency:g} Hz "))
    used = sorted({surface.material for surface in surfaces})
    stems = _file_names(used)
    with ExitStack() as files:
        document = files.enter_context(atomic_path(path))  # entered first, so moved last
        for name in used:
            mesh = path.with_name(f"{path.stem}-{stems[name]}.ply")
            text = ply.text_of([surface for surface in surfaces if surface.material == name], tagged=False)
            files.enter_context(atomic_path(mesh)).write_text(text, encoding="ascii")
            bsdf = _bsdf(materials[name], frequency)
            scene.append(bsdf)
            # Sionna RT drops the prefixes mesh- and mat- and wants what is left to differ.
            shape = ElementTree.SubElement(scene, "shape", type="ply", id=f"mesh-faces-{name}")
            ElementTree.SubElement(shape, "string", name="filename", value=mesh.name)
            ElementTree.SubElement(shape, "boolean", name="face_normals", value="true")
            ElementTree.SubElement(shape, "ref", name="bsdf", id=bsdf.attrib["id"])
        ElementTree.indent(scene)
        ElementTree.ElementTree(scene).write(document, encoding="utf-8", xml_declaration=True)


def _file_names(materials: Sequence[str]) -> dict[str, str]:
    """For each material a name that every file system and URL takes, no two the same."""
    names: dict[str, str] = {}
    for material in materials:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", material)
        names[material] = f"{plain}-{len(names)}" if plain.lower() in map(str.lower, names.values()) else plain
    return names


def _bsdf(material: Material, frequency: float) -> ElementTree.Element:
    """A material by its ITU name where Sionna RT knows it, else by its constants at the frequency."""
    name = material.name
    bands = ITU_BANDS.get(name, ()) if material == LIBRARY.get(name) else ()
    if any(low <= frequency / 1e9 <= high for low, high in bands):
        # Sionna RT goes by the id alone; what is inside lets Mitsuba itself load the scene.
        bsdf = ElementTree.Element("bsdf", type="twosided", id=f"mat-itu_{name}")
        diffuse = ElementTree.SubElement(bsdf, "bsdf", type="diffuse")
        ElementTree.SubElement(diffuse, "rgb", name="reflectance", value="0.5 0.5 0.5")
        return bsdf
    permittivity = material.relative_permittivity(frequency)
    constants = {
        "relative_permittivity": permittivity.real,
        "conductivity": -permittivity.imag * 2 * pi * frequency * epsilon_0,
    }
    # Sionna RT refuses its own names for other materials, and takes any that starts with itu for its own.
    bsdf = ElementTree.Element("bsdf", type="radio-material", id=f"mat-{frequency / 1e9:g}GHz-{name}")
    for property_, value in constants.items():
        ElementTree.SubElement(bsdf, "float", name=property_, value=f"{value:.6g}")
    return bsdf
