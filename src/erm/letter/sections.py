"""What the page says of each of the letter's studies: text and tables around numbers computed elsewhere."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from erm.evaluate import summary
from erm.explain import DIRECT, GROUND, explain, names_of, sectors
from erm.figures import plot_error_cdf, plot_map
from erm.geometry import FloatArray
from erm.letter import published, routes
from erm.letter.captures import Campaign, Captures
from erm.letter.page import Page
from erm.letter.truth import is_single_wall_bounce, rays_of
from erm.outline import outline_of
from erm.study_figures import plot_letter_points, plot_sectors

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

ERRORS = ("min", "max", "mean", "std", "rmse")
HEADS = ["min [m]", "max [m]", "mean [m]", "std [m]", "RMSE [m]"]
OVERLAID = (("Route 1", "RX2_L", "RX9_L"), ("Route 2", "RX2_N", "RX3_N"))
SHOWN = ((("Route 1", "Route 2"), "routes_1_2"), (("Route 3", "Route 4"), "routes_3_4"))
CORRIDOR_EAST, CORRIDOR_REACH = 50.0, 15.0  # m
ROUTE_BAR, TIMES_BAR = 0.05, 20.0  # m; ratio


def opening(page: Page) -> None:
    """Say what the page is, and how the letter must be read."""
    page.add(
        "# The letter, reproduced and overtaken",
        "Every number of *Environment Reconstruction with Multi-targets Reflectors-merged Sensing Method Based on "
        "THz Single-sided Channel Characteristics* (Chang et al.) that this software can compute stands here beside "
        "its own. Captures are synthetic: traced paths, carried through a twin of the instrument with its noise and "
        "faults, and processed from the raw samples alone.",
        "How the print must be read:",
        "- **What the letter calls RMSE is the standard deviation** of the error: an RMSE cannot be below the mean. "
        "True RMSE stands in its own column here.\n"
        "- **Its formula of D_Error has three slips**: a plus sign for a minus, `b_a` for `b_L`, and no square root. "
        "The distance is `|y - a x - b| / sqrt(1 + a^2)`; the printed points give the printed errors only so. (Its "
        "face `L(x) = a_L x + a_L` likewise reads `a x + b`.)\n"
        "- **Its equations are planar** but take the slant length of the path. With heights of 28.4 and 1.4 m that "
        "alone moves the reflection points by metres.\n"
        '- The plaster\'s "correlation length 0.15, height standard deviation 1.7" are read as swapped, in mm.',
    )


def set_ups(page: Page, simulation: Campaign, measurement: Campaign) -> None:
    """Tables 1 and 2: the shipped configurations beside the printed values."""
    page.add("## Set-ups (Tables 1 and 2)")
    page.table(
        ["parameter", "simulation, printed", "here", "measurement, printed", "here"],
        [
            [name, *(value for pair in zip(printed, ours, strict=True) for value in pair)]
            for name, printed in published.TABLE_1.items()
            for ours in [(simulation.parameters[name], measurement.parameters[name])]
        ],
    )
    page.add(
        "The letter's simulation has an omnidirectional receiver, whose azimuths of arrival come from the ray "
        "tracer. A capture holds no azimuth unless an antenna turns, so the captures of the room are those of the "
        "measurement's horn, moved to 300 GHz; the transmitter is omnidirectional, 0 dBi, as printed."
    )
    distance = {link.name: link.distance for link in measurement.links}
    off = {
        route: max(abs(distance[name] - printed) for name, printed in positions.items() if name in distance)
        for route, positions in published.TABLE_2.items()
    }
    page.table(
        ["route", "positions", "printed distances [m]", "largest difference here [m]"],
        [
            [route, len(positions), f"{min(positions.values())}–{max(positions.values())}", off[route]]
            for route, positions in published.TABLE_2.items()
        ],
    )


def reconstruction(page: Page, studied: routes.Study) -> None:
    """Fig. 4a: maps of routes 1 and 2, and 3 and 4."""
    page.add(
        "## Reconstruction (Fig. 4a)",
        "Walls and poles from the captures of all positions together. No single bounce can come off the faces north "
        "of the corridor: they look south, away from TX1.",
    )
    outline = outline_of(studied.campaign.environment)
    names = names_of(studied.environment)
    for pair, name in SHOWN:
        chosen = studied.of([position for route in pair for position in published.TABLE_2[route]])
        table = studied.table.isel(mpc=np.flatnonzero(chosen))
        used = np.unique(table["wall"].values[table["accepted"].values])
        shown = replace(studied.environment, reflectors=studied.environment.reflectors.isel(reflector=used))
        count = len(np.unique(table["position"].values))
        page.figure(
            name,
            plot_map(shown, table=table, outline=outline, names=[names[i] for i in used]),
            f"{' and '.join(pair)}: {len(used)} reflectors from {int(table.accepted.sum())} reflection points at "
            f"{count} positions of the RX, over the known outline.{_corridor(studied) if 'Route 2' in pair else ''}",
        )


def errors(page: Page, studied: routes.Study, by_route: Mapping[str, Mapping[str, FloatArray]]) -> None:
    """Fig. 4b and Table 3."""
    page.add(
        "## Errors (Fig. 4b, Table 3)",
        "The distance of each reflection point to the line of the face that reflected it. (a) is recomputed from the "
        "points that the letter prints; (b), (c) and (d) are the same MPCs of the twin's captures, by the letter's "
        "planar equations, by ours, and on our merged walls. The letter's environment is not ours, so (a) and (b) "
        "need not agree: what (b) shows is the part of such an error that the planar reading makes by itself.",
    )
    known = published.errors()
    rows: list[list[object]] = []
    for route, methods in by_route.items():
        column = published.COLUMN_OF_ROUTE[route]
        printed = published.TABLE_3[column]
        label = route if column == route else f"{route} ({column.lower()})"
        rows.append([label, "the letter, as printed", None, printed["min"], printed["max"], printed["mean"]])
        rows[-1] += [printed["RMSE"], None]
        if column in known:
            rows.append([label, "(a) from the printed points", *_error_cells(known[column])])
        for letter, (method, values) in zip("bcd", methods.items(), strict=True):
            rows.append([label, f"({letter}) {method}", *_error_cells(values)])
    page.table(["route", "method", "points", *HEADS], rows)
    page.add(
        "The points of Porch and Canyon are not printed, so (a) does not exist for them. Route 1's largest error is "
        "3.77 m from the printed points; the letter prints 3.76."
    )
    page.table(
        [
            "route",
            "merged RMSE [m]",
            f"wanted: at most {ROUTE_BAR} m",
            "times better than planar",
            f"at least {TIMES_BAR:g}",
        ],
        [
            [route, rmse, _verdict(rmse <= ROUTE_BAR), times, _verdict(times >= TIMES_BAR)]
            for route, (rmse, times) in routes.bars(by_route).items()
        ],
    )
    false = ", ".join(f"{route} {count}" for route, count in routes.false_by_route(studied).items())
    page.add(f"Accepted MPCs that are no single bounces off a wall: {false}.")
    page.add(
        "The letter selects by Eq. 4, twice the smallest reflection loss of the scenario. On the same captures, with "
        "its own equations, that leaves:"
    )
    page.table(
        ["route", "points", *HEADS],
        [[route, *_error_cells(values)] for route, values in routes.letter_selection(studied).items()],
    )
    page.figure(
        "letter_points",
        plot_letter_points(),
        f"The letter's {len(published.ROUTE_1_POINTS)} printed points of route 1 and "
        f"{len(published.ROUTE_2_ORDINATES)} printed ordinates of route 2, with the faces they are judged by.",
    )
    joined = {
        method: np.concatenate([methods[method] for methods in by_route.values()])
        for method in (routes.PLANAR, routes.SINGLE, routes.MERGED)
    }
    page.figure(
        "route_cdf",
        plot_error_cdf({"printed points, routes 1 and 2": np.concatenate(list(known.values()))} | joined),
        "Distance to the face: the letter's printed points, and the MPCs of routes 1 to 4 by three methods.",
    )


def daps(page: Page, studied: routes.Study, captures: Captures) -> None:
    """Fig. 3: two pairs of DAPS with computed sectors."""
    import matplotlib.pyplot as plt

    page.add(
        "## DAPS (Fig. 3)",
        "Sectors are computed: each MPC is given to the path through the reconstructed map that is nearest to it in "
        "delay and azimuth, and the MPCs that bounced off one reflector make its sector. W are walls and P poles, "
        "named as in the maps below; in brackets, how many MPCs. The direct path counts with the ground bounce under "
        "it. What the map does not explain has no sector.",
    )
    for route, first, second in OVERLAID:
        pair = (first, second)
        chosen = np.flatnonzero(studied.of(pair))
        table = studied.table.isel(mpc=chosen)
        labels = explain(table, studied.environment)
        once = np.array(["" if "+" in label else DIRECT if label == GROUND else label for label in labels])
        arcs = sectors(table["azimuth"].values, once)
        figure = plt.figure(figsize=(7.4, 5.4), layout="constrained")
        axes = captures.draw_daps([(name, studied.daps[name]) for name in pair], _polar(figure))
        plot_sectors(arcs, axes)
        known = int(np.count_nonzero(labels != ""))
        twice = int(np.count_nonzero((once == "") & (labels != "")))
        page.figure(
            f"daps_{first}_{second}",
            figure,
            f"{route}: DAPS of {first} and {second}; of their {len(labels)} MPCs the map explains {known}, {twice} of "
            "them by more than one bounce and without a sector.",
        )


def _error_cells(values: FloatArray) -> list[object]:
    found = summary(values)
    return [int(found["count"]), *(found[name] for name in ERRORS)]


def _corridor(studied: routes.Study) -> str:
    """What the map has of the corridor's two walls, in the letter's ordinates."""
    table = studied.environment.reflectors
    middle, normal = table["end_points"].values.mean(axis=1), table["normal"].values
    rays = rays_of(studied.campaign)
    single = is_single_wall_bounce(studied.campaign, rays)
    level = np.abs(np.sin(np.radians(normal))) > np.cos(np.radians(5))
    told, found = [], []
    for name in ("teaching building", "south corridor wall"):
        south = published.CORRIDOR_WALLS[name]
        beside = np.abs(middle[:, 0] - CORRIDOR_EAST) < CORRIDOR_REACH
        near = np.flatnonzero(level & beside & (np.abs(middle[:, 1] + south) < 1))
        on_it = single & (np.abs(rays.vertex[:, 1] + south) < 1e-6)
        on_it &= np.abs(rays.vertex[:, 0] - CORRIDOR_EAST) < CORRIDOR_REACH
        found += [-float(middle[i, 1]) for i in near[:1]]
        where = f"at {found[-1]:.2f} m" if near.size else "not there"
        told.append(f"{name} {where} ({south} printed; {len(np.unique(rays.link[on_it]))} positions had a path off it)")
    width = f" It is {abs(found[1] - found[0]):.2f} m wide." if len(found) == 2 else ""
    return f" Walls of the corridor, 14.9 m apart in the letter, in the map: {'; '.join(told)}.{width}"


def _polar(figure: "Figure") -> "PolarAxes":
    return cast("PolarAxes", figure.add_subplot(projection="polar"))


def _verdict(holds: bool) -> str:
    return "holds" if holds else "**missed**"
