"""Reflectors as a DXF drawing for CAD programs, metres, z up; needs the extra ``cad``."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from erm.common.optional import require_library
from erm.common.storage import atomic_path
from erm.maps.environment import Environment
from erm.maps.formats.surfaces import extrude, spans


def write(environment: Environment, path: Path, *, height: float, margin: float) -> None:
    """Write a drawing in metres; ``height`` and ``margin`` are those of `erm.maps.formats.surfaces.extrude`.

    On the layer ``walls`` lines at the foot of each wall, on ``poles`` circles that are extruded to the pole's
    height, on ``wall_faces``, ``ground`` and ``ceiling`` 3-D faces.
    """
    ezdxf = library(path)
    with _no_time_of_day(ezdxf):
        drawing = ezdxf.new("R2010", units=ezdxf.units.M)
        for colour, layer in enumerate(("walls", "wall_faces", "poles", "ground", "ceiling"), start=1):
            drawing.layers.add(layer, color=colour)
        space = drawing.modelspace()
        table = environment.reflectors
        base, top = spans(environment, height)
        for index, ends in enumerate(table.end_points.values.tolist()):
            first, second = ([*end, base[index]] for end in ends)
            if table.kind.values[index] == "pole":
                attributes = {"layer": "poles", "thickness": top[index] - base[index]}
                space.add_circle(first, table.radius.values[index], dxfattribs=attributes)
            else:
                space.add_line(first, second, dxfattribs={"layer": "walls"})
        for surface in extrude(environment, height=height, margin=margin):
            if surface.kind != "pole":
                layer = "wall_faces" if surface.kind == "wall" else surface.kind
                space.add_3dface(surface.vertices.tolist(), dxfattribs={"layer": layer})
        with atomic_path(path) as temporary:
            drawing.saveas(temporary)


@contextmanager
def _no_time_of_day(ezdxf: ModuleType) -> Iterator[None]:
    """Keep date and random identifiers out of the file: the same map gives the same bytes."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def library(path: Path) -> ModuleType:
    """Return ezdxf, or raise a DataError that says what brings it."""
    return require_library("ezdxf", "cad", f"{path}: DXF", "choose .obj or .geojson")
