"""Reflectors as a DXF drawing for CAD programs, metres, z up; needs the extra ``cad``."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np

from erm.common.atomic import atomic_path
from erm.common.optional import require_library
from erm.geometry.vertical import FloatArray, azimuth_of
from erm.maps.environment import Environment
from erm.maps.formats.surfaces import extrude, finite_edges
from erm.maps.georeference import place_in_system


def write(environment: Environment, path: Path, *, height: float, margin: float, crs: str | None = None) -> None:
    """Write a drawing in metres; ``height`` and ``margin`` are options of `erm.maps.formats.surfaces.extrude`.

    Layers: ``walls`` has a line at the base of each wall and an arc at that of a curved face; ``poles`` has circles
    that are extruded to the height of the pole; ``wall_faces``, ``ground`` and ``ceiling`` have 3-D faces.

    Coordinates are local, or easting and northing in ``crs``; heights are local. The system is in the drawing's
    properties, and in a file of the suffix ``.prj`` beside it, where GIS programs look for it. The radii
    of poles stay local.
    """
    ezdxf = library(path)
    with _fixed_metadata(ezdxf):
        drawing = ezdxf.new("R2010", units=ezdxf.units.M)
        if crs is not None:
            drawing.header.custom_vars.append("coordinate system", crs)
        for colour, layer in enumerate(("walls", "wall_faces", "poles", "ground", "ceiling"), start=1):
            drawing.layers.add(layer, color=colour)
        space = drawing.modelspace()
        table = environment.reflectors

        def placed(points: FloatArray) -> FloatArray:
            return place_in_system(points, crs, environment.georeference)

        base, top = finite_edges(environment, height)
        for index, ends in enumerate(placed(table.end_points.values)):
            first, second = ([*end, base[index]] for end in ends.tolist())
            if table.kind.values[index] == "arc":
                centre = placed(table.centre.values[index])
                turns = azimuth_of(ends - centre).tolist()
                size = float(np.hypot(*(ends[0] - centre)))
                space.add_arc([*centre.tolist(), base[index]], size, *turns, dxfattribs={"layer": "walls"})
            elif table.kind.values[index] == "pole":
                attributes = {"layer": "poles", "thickness": top[index] - base[index]}
                space.add_circle(first, table.radius.values[index], dxfattribs=attributes)
            else:
                space.add_line(first, second, dxfattribs={"layer": "walls"})
        for surface in extrude(environment, height=height, margin=margin):
            if surface.kind != "pole":
                layer = "wall_faces" if surface.kind in ("wall", "arc") else surface.kind
                corners = np.concatenate([placed(surface.vertices[:, :2]), surface.vertices[:, 2:]], axis=-1)
                for face in corners.reshape(-1, 4, 3).tolist():
                    space.add_3dface(face, dxfattribs={"layer": layer})
        with atomic_path(path) as temporary:
            drawing.saveas(temporary)
    if crs is not None:
        pyproj = require_library("pyproj", "gis", crs, "use local metres")
        with atomic_path(path.with_suffix(".prj")) as temporary:
            temporary.write_text(pyproj.CRS.from_user_input(crs).to_wkt("WKT1_ESRI"), encoding="utf-8")


@contextmanager
def _fixed_metadata(ezdxf: ModuleType) -> Iterator[None]:
    """Write no date and no random identifiers: the same map gives the same bytes."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def library(path: Path) -> ModuleType:
    """Import ezdxf, or raise a DataError that says how to install it."""
    return require_library("ezdxf", "cad", f"{path}: DXF", "choose .obj or .geojson")
