"""Section of the page on the reconstruction: maps of the routes, and of the corridor from inside."""

from dataclasses import replace

import numpy as np

from erm.common.page import Page
from erm.evaluation.explain import reflector_names
from erm.evaluation.outline import evaluate_walls
from erm.figures import mark_width, plot_map
from erm.geometry.vertical import FloatArray
from erm.letter import corridor, published, routes
from erm.maps.outline import outline_of

SHOWN = ((("Route 1", "Route 2"), "routes_1_2"), (("Route 3", "Route 4"), "routes_3_4"))
ARROW_EASTING = 62.0  # m; of the arrow across the corridor in the figure


def reconstruction(page: Page, studied: routes.Study, inside: routes.Study) -> None:
    """Fig. 4a: maps of routes 1 and 2, and 3 and 4; and the corridor from inside."""
    page.add(
        "## Reconstruction (Fig. 4a)",
        "Walls and poles from the captures of all positions together. The number in a name is the row of the reflector "
        "in the table of the map, which holds walls and poles.",
    )
    outline = outline_of(studied.campaign.environment)
    names = reflector_names(studied.environment)
    accepted, wall = studied.table["accepted"].values, studied.table["wall"].values
    of_route = {route: studied.of(list(positions)) for route, positions in published.TABLE_2.items()}
    table = studied.environment.reflectors
    length = np.linalg.norm(np.diff(table["end_points"].values, axis=1)[:, 0], axis=-1)
    page.table(
        ["reflector", "normal [°]", "offset [m]", "length [m]", *(f"points of {route.lower()}" for route in of_route)],
        [
            [name, *row, *(int(np.count_nonzero(chosen & (wall == i))) for chosen in of_route.values())]
            for i, (name, *row) in enumerate(
                zip(
                    names,
                    table["normal"].values.tolist(),
                    table["offset"].values.tolist(),
                    length.tolist(),
                    strict=True,
                )
            )
        ],
    )
    for pair, name in SHOWN:
        part = studied.table.isel(mpc=np.flatnonzero(of_route[pair[0]] | of_route[pair[1]]))
        used = np.unique(part["wall"].values[part["accepted"].values])
        shown = replace(studied.environment, reflectors=table.isel(reflector=used))
        axes = plot_map(shown, table=part, outline=outline, names=[names[i] for i in used])
        counts = ", ".join(
            f"{np.count_nonzero(accepted & of_route[r] & studied.on_walls)} on walls and "
            f"{np.count_nonzero(accepted & of_route[r] & ~studied.on_walls)} on poles from {r.lower()}"
            for r in pair
        )
        corridor_text = ""
        if corridor.ROUTE in pair:
            north, south = (-published.CORRIDOR_WALLS[side] for side in corridor.SIDES)
            axes.set_xlim(right=ARROW_EASTING + 20)  # the arrow's label stands beside it
            mark_width(axes, np.array([ARROW_EASTING, north]), np.array([ARROW_EASTING, south]), "14.9 m")
            corridor_text = f" The corridor of the letter (arrow) on the map: {corridor.describe(studied)}."
        page.figure(
            name,
            axes,
            f"{' and '.join(pair)}: {len(used)} reflectors from {int(part.accepted.sum())} reflection points "
            f"({counts}) at {len(np.unique(part['position'].values))} positions of the RX, over the known outline. "
            f"The reflectors are those of the map of all positions.{corridor_text}",
        )
    _corridor(page, inside, outline)


def _corridor(page: Page, inside: routes.Study, outline: FloatArray) -> None:
    """Experiment that shows the other wall of the corridor."""
    seen = " and ".join(
        f"{count} of them have a single bounce off the {name}"
        for name, count in corridor.seen_by(inside.campaign).items()
    )
    page.add(
        "The corridor's north wall faces south, away from TX1. From TX1 it gives no single bounce, so it cannot be on "
        "the map. To show that this is the only reason, the positions of route 2 are measured again with the "
        f"transmitter in the corridor and {-corridor.REDUCED_POWER.power:g} dB less power, because it is nearer; "
        f"{seen}."
    )
    axes = plot_map(inside.environment, table=inside.table, outline=outline, names=reflector_names(inside.environment))
    found = corridor.walls(inside.environment)
    if len(found) == len(corridor.SIDES):
        north, south = (np.array([ARROW_EASTING, northing]) for northing in found.values())
        mark_width(axes, north, south, f"{corridor.width_of(inside.environment):.2f} m")
    page.figure(
        "corridor",
        axes,
        f"The corridor from inside: {inside.environment.reflectors.sizes['reflector']} reflectors from "
        f"{int(inside.table.accepted.sum())} reflection points at {len(inside.campaign.links)} positions; "
        f"{evaluate_walls(inside.environment, outline)['false']} of the walls are false. On the map: "
        f"{corridor.describe(inside)}.",
    )
