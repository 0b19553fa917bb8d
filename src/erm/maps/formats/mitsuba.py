"""Surfaces as a scene of Mitsuba 3 for the ray tracer Sionna RT: an XML file and one PLY mesh per material.

Sionna RT identifies a material by the id of its ``bsdf``. It looks up ``mat-itu_concrete`` and similar ids in ITU-R
P.2040 at the frequency of the simulation. Any other material must be a ``radio-material`` of constant permittivity and
conductivity. Sionna RT treats both as slabs of 0.1 m; at millimetre waves and above these transmit as little as the
half-spaces of `erm.trace`.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import pi
from pathlib import Path
from xml.etree import ElementTree

from scipy.constants import epsilon_0

from erm.common.atomic import atomic_path
from erm.common.storage import SOFTWARE
from erm.maps.formats import ply
from erm.maps.formats.surfaces import Surface
from erm.maps.materials import LIBRARY, Material

ITU_BANDS: Mapping[str, tuple[tuple[float, float], ...]] = {
    "concrete": ((1, 100), (110, 330)),
    "brick": ((1, 40), (110, 330)),
    "plasterboard": ((1, 400),),
    "wood": ((0.001, 400),),
    "glass": ((0.1, 450),),
    "marble": ((1, 60), (100, 400)),
    "metal": ((1, 100),),
}
"""Frequency ranges of the rows of ITU-R P.2040 in Sionna RT 2, which refuses other frequencies [GHz]."""


def write(surfaces: Sequence[Surface], materials: Mapping[str, Material], frequency: float, path: Path) -> None:
    """Write the scene completely or not at all.

    All files are renamed to their names after the last one was written; the XML is the last to be renamed.

    Parameters
    ----------
    surfaces : sequence of Surface
    materials : mapping of name to Material
        Materials of the surfaces, or more.
    frequency : float
        Materials that Sionna RT does not know at this frequency get their constants at it [Hz].
    path : path
        The XML file. The meshes are named ``STEM-MATERIAL.ply``.
    """
    scene = ElementTree.Element("scene", version="2.1.0")
    scene.append(ElementTree.Comment(f" {SOFTWARE}; metres, z up; constant materials are those at {frequency:g} Hz "))
    used = sorted({surface.material for surface in surfaces})
    stems = _file_names(used)
    with ExitStack() as files:
        document = files.enter_context(atomic_path(path))  # entered first, so renamed last
        for name in used:
            mesh = path.with_name(f"{path.stem}-{stems[name]}.ply")
            text = ply.mesh_text([surface for surface in surfaces if surface.material == name], tagged=False)
            files.enter_context(atomic_path(mesh)).write_text(text, encoding="ascii")
            bsdf = _bsdf(materials[name], frequency)
            scene.append(bsdf)
            # Sionna RT removes the prefixes mesh- and mat- and requires different remaining ids
            shape = ElementTree.SubElement(scene, "shape", type="ply", id=f"mesh-faces-{name}")
            ElementTree.SubElement(shape, "string", name="filename", value=mesh.name)
            ElementTree.SubElement(shape, "boolean", name="face_normals", value="true")
            ElementTree.SubElement(shape, "ref", name="bsdf", id=bsdf.attrib["id"])
        ElementTree.indent(scene)
        ElementTree.ElementTree(scene).write(document, encoding="utf-8", xml_declaration=True)


def _file_names(materials: Sequence[str]) -> dict[str, str]:
    """Different names of the materials, valid in every file system and URL."""
    names: dict[str, str] = {}
    for material in materials:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", material)
        names[material] = f"{plain}-{len(names)}" if plain.lower() in map(str.lower, names.values()) else plain
    return names


def _bsdf(material: Material, frequency: float) -> ElementTree.Element:
    """Material by its ITU name if Sionna RT knows it at the frequency, else by its constants."""
    name = material.name
    bands = ITU_BANDS.get(name, ()) if material == LIBRARY.get(name) else ()
    if any(low <= frequency / 1e9 <= high for low, high in bands):
        # Sionna RT uses the id only; the content lets Mitsuba itself load the scene
        bsdf = ElementTree.Element("bsdf", type="twosided", id=f"mat-itu_{name}")
        diffuse = ElementTree.SubElement(bsdf, "bsdf", type="diffuse")
        ElementTree.SubElement(diffuse, "rgb", name="reflectance", value="0.5 0.5 0.5")
        return bsdf
    permittivity = material.relative_permittivity(frequency)
    constants = {
        "relative_permittivity": permittivity.real,
        "conductivity": -permittivity.imag * 2 * pi * frequency * epsilon_0,
    }
    # Sionna RT refuses its own names for other materials, and claims all names that start with itu
    bsdf = ElementTree.Element("bsdf", type="radio-material", id=f"mat-{frequency / 1e9:g}GHz-{name}")
    for property_, value in constants.items():
        ElementTree.SubElement(bsdf, "float", name=property_, value=f"{value:.6g}")
    return bsdf
