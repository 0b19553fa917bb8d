"""The command ``erm export``: a map in another format, and its place on earth."""

from pathlib import Path
from typing import Annotated

import typer

from erm.cli.arguments import MapFile
from erm.common.errors import DataError, OptionError
from erm.common.messages import note
from erm.common.outputs import protect_inputs
from erm.maps.formats import DRAWING_FREQUENCY, DRAWING_HEIGHT, DRAWING_MARGIN


def export(
    environment: MapFile,
    out: Annotated[
        Path,
        typer.Option(help="Map (.h5, .geojson, .gpkg, .csv) or drawing (.dxf, .ply, .obj, .xml).", show_default=False),
    ],
    origin: Annotated[
        tuple[float, float] | None,
        typer.Option(help="Latitude and longitude of the local origin, WGS 84 [degree].", show_default=False),
    ] = None,
    origin_height: Annotated[float, typer.Option(help="Height of the origin above the ellipsoid [m].")] = 0.0,
    heading: Annotated[
        float, typer.Option(help="Bearing of the local north, clockwise from true north [degree].")
    ] = 0.0,
    crs: Annotated[
        str | None,
        typer.Option(
            help=".gpkg and .dxf of a map with an origin: coordinate system, such as EPSG:25832 or 'ETRS89 / UTM zone "
            "32N'. Default: WGS 84 for .gpkg, local metres for .dxf.",
            show_default=False,
        ),
    ] = None,
    height: Annotated[
        float,
        typer.Option(min=0.0, help="Drawings: height above the ground of walls that have no known upper edge [m]."),
    ] = DRAWING_HEIGHT,
    margin: Annotated[
        float, typer.Option(min=0.0, help="Drawings: how far ground and ceiling extend beyond the walls [m].")
    ] = DRAWING_MARGIN,
    frequency: Annotated[
        float,
        typer.Option(
            min=1e6,
            max=1e13,
            help=".xml only: frequency at which unknown materials of the ray tracer are computed [Hz].",
        ),
    ] = DRAWING_FREQUENCY,
    scattering: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help=".xml only: scattering coefficient of faces whose roughness is not known, less than 1.",
        ),
    ] = 0.0,
) -> None:
    """Write a map in another format, or set its place on earth.

    A map with an origin is written as GeoJSON and GeoPackage in WGS 84, or in another system by --crs. All map
    formats keep the origin. A .gpkg has layers of walls, poles and arcs; from a .h5 map also of reflection points, TX
    and RX. The .xml is a scene for Sionna RT (Mitsuba 3).
    """
    from dataclasses import replace

    from erm.maps.formats import read_map, read_measured, require_format, write_map
    from erm.maps.georeference import Georeference, remark_on_system
    from erm.maps.reflectors import counted_reflectors

    if origin is None and (origin_height or heading):
        raise typer.BadParameter("--origin-height and --heading need --origin LATITUDE LONGITUDE")
    protect_inputs((out,), (environment,))
    require_format(out)
    try:
        georeference = None if origin is None else Georeference(*origin, origin_height, heading)
    except DataError as error:
        raise OptionError(error) from None
    place = read_map(environment)
    if georeference is not None:
        place = replace(place, georeference=georeference)
    mpcs, positions = read_measured(environment)
    write_map(
        place,
        out,
        mpcs=mpcs,
        positions=positions,
        height=height,
        margin=margin,
        frequency=frequency,
        scattering=scattering,
        crs=crs,
    )
    if crs and place.georeference and (remark := remark_on_system(crs, place.georeference)):
        note(f"note: {remark}")
    meshes = f"; meshes: {out.stem}-*.ply" if out.suffix.lower() == ".xml" else ""
    print(f"{out}: {counted_reflectors(place.reflectors['kind'].values.tolist())}{meshes}")
