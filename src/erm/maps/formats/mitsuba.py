"""Surfaces as a scene of Mitsuba 3 for the ray tracer Sionna RT: an XML file and one PLY mesh per material.

Sionna RT identifies a material by the id of its ``bsdf``. It looks up ``mat-itu_concrete`` and similar ids in ITU-R
P.2040 at the frequency of the simulation. Any other material is a ``radio-material`` of constant permittivity,
conductivity and scattering coefficient. Sionna RT treats both as slabs: one that loses little reflects off its back as
well, which changes its gain by several dB from that of the half-spaces of `erm.trace`. What goes by its constants is
therefore made thick and lossy enough to be a half-space.
"""

import re
from cmath import sqrt
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from math import expm1, log, pi
from pathlib import Path
from xml.etree import ElementTree

from scipy.constants import c, epsilon_0

from erm.common.atomic import atomic_path
from erm.common.errors import OptionError
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


LEAST_LOSS = 0.01
"""Imaginary part of the index of slabs that stand for half-spaces: 0.001 dB of the reflection off an index of 1.6. Less
is lost in the square roots of Sionna RT, which has single precision."""
BACK = 1e-3
"""Amplitude of what comes back from the far side of such a slab: its reflection is right to 0.1 %, or 0.01 dB."""


def write(
    surfaces: Sequence[Surface],
    materials: Mapping[str, Material],
    frequency: float,
    path: Path,
    *,
    scattering: float = 0.0,
) -> None:
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
    scattering : float
        Scattering coefficient of materials whose roughness is not known; see `constants`.

    Raises
    ------
    OptionError
        A material reflects too much to scatter that much.
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
            bsdf = _bsdf(materials[name], frequency, scattering)
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


def _bsdf(material: Material, frequency: float, scattering: float) -> ElementTree.Element:
    """Material by its ITU name if Sionna RT knows it at the frequency, else by its constants."""
    name = material.name
    bands = ITU_BANDS.get(name, ()) if material == LIBRARY.get(name) else ()
    if not scattering and any(low <= frequency / 1e9 <= high for low, high in bands):
        # Sionna RT uses the id only; the content lets Mitsuba itself load the scene
        bsdf = ElementTree.Element("bsdf", type="twosided", id=f"mat-itu_{name}")
        diffuse = ElementTree.SubElement(bsdf, "bsdf", type="diffuse")
        ElementTree.SubElement(diffuse, "rgb", name="reflectance", value="0.5 0.5 0.5")
        return bsdf
    # Sionna RT refuses its own names for other materials, and claims all names that start with itu
    bsdf = ElementTree.Element("bsdf", type="radio-material", id=f"mat-{frequency / 1e9:g}GHz-{name}")
    for property_, value in constants(material, frequency, scattering).items():
        ElementTree.SubElement(bsdf, "float", name=property_, value=f"{value:.6g}")
    return bsdf


def constants(material: Material, frequency: float, scattering: float = 0.0) -> dict[str, float]:
    """Constants of a slab of Sionna RT that reflects as a half-space of the material, and scatters.

    A wave that enters the slab of thickness ``d`` comes back with the amplitude ``exp(-4 pi d n'' / lambda)``. ``n''``
    is :data:`LEAST_LOSS` or more, and ``d`` such that this is :data:`BACK`.

    A rough face scatters the share ``1 - exp(-g cos(theta)^2)``, ``g = (4 pi sigma_h / lambda)^2``, of what it would
    reflect. Sionna RT has one coefficient ``S`` for all angles. Its square is the share that is scattered of what falls
    in from all directions alike::

        S^2 = 1 - (1 - exp(-g)) / g

    Where the roughness is not known, ``S`` is ``scattering``. A refractive index that was measured is that of the
    specular reflection alone, which Sionna RT multiplies by ``sqrt(1 - S^2)``. The index is raised until the reflection
    at normal incidence is the measured one again.

    Parameters
    ----------
    material : Material
    frequency : float
        [Hz]
    scattering : float
        0 to 1, amplitude.

    Returns
    -------
    dict
        ``relative_permittivity``, ``conductivity`` [S/m], ``thickness`` [m], ``scattering_coefficient``.

    Examples
    --------
    >>> constants(Material("measured", 2.3 + 0j), 132e9, 0.4)["scattering_coefficient"]
    0.4
    >>> round(constants(LIBRARY["plaster"], 132e9)["scattering_coefficient"], 3)
    0.527
    """
    index = sqrt(material.relative_permittivity(frequency))
    g = (4 * pi * material.height_deviation * frequency / c) ** 2
    if g:
        scattering = (1 + expm1(-g) / g) ** 0.5
    elif scattering and material.refractive_index is not None:
        kept = (1 - scattering**2) ** 0.5
        reflected = (index - 1) / (index + 1)
        if abs(reflected) >= kept:
            most = (1 - abs(reflected) ** 2) ** 0.5
            raise OptionError(
                f"material {material.name}: scattering {scattering:g}; "
                f"more was seen to be reflected than that leaves, expected less than {most:.2f}"
            )
        index = (1 + reflected / kept) / (1 - reflected / kept)
    index = complex(index.real, min(index.imag, -LEAST_LOSS))
    permittivity = index**2
    return {
        "relative_permittivity": permittivity.real,
        "conductivity": -permittivity.imag * 2 * pi * frequency * epsilon_0,
        "thickness": log(BACK) * c / (4 * pi * frequency * index.imag),
        "scattering_coefficient": scattering,
    }
