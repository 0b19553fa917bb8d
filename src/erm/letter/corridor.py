"""The letter's corridor: which of its walls are on the map, and which a transmitter inside shows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from erm.letter import published
from erm.letter.captures import Campaign, Captures, Change
from erm.letter.routes import Study, study
from erm.letter.truth import is_single_wall_bounce, rays_of
from erm.maps.environment import Environment

ROUTE = "Route 2"
TX_INSIDE = (70.0, -58.0, 4.0)  # m; in the corridor, east of the route. Chosen; not derived
REDUCED_POWER = Change(power=-15.0)  # dB; at 14 to 22 m the receiver then gets no more power than on the street
EAST, HALF_LENGTH = 50.0, 15.0  # m; easting of the stretch of the corridor whose walls count, and half its length
MAX_OFFSET, MAX_ANGLE = 1.0, 5.0  # m, degree; a wall of the map within these is the letter's wall
SIDES = ("teaching building", "south corridor wall")
PRINTED_WIDTH = published.CORRIDOR_WALLS[SIDES[1]] - published.CORRIDOR_WALLS[SIDES[0]]


def from_inside(campaign: Campaign, captures: Captures, *, progress: Callable[[], None] | None = None) -> Study:
    """Study route 2 again with a transmitter in the corridor, where both walls face it."""
    links = [replace(link, tx=TX_INSIDE) for link in campaign.links if link.name in published.TABLE_2[ROUTE]]
    return study(campaign.at(links), captures, REDUCED_POWER, progress=progress)


def walls(environment: Environment) -> dict[str, float]:
    """Northing [m] of the corridor's walls that are on a map, by the letter's names."""
    table = environment.reflectors
    middle, normal = table["end_points"].values.mean(axis=1), table["normal"].values
    level = np.abs(np.sin(np.radians(normal))) > np.cos(np.radians(MAX_ANGLE))
    beside = (table["kind"].values == "wall") & level & (np.abs(middle[:, 0] - EAST) < HALF_LENGTH)
    found = {}
    for name in SIDES:
        near = np.flatnonzero(beside & (np.abs(middle[:, 1] + published.CORRIDOR_WALLS[name]) < MAX_OFFSET))
        if near.size:
            found[name] = float(middle[near[0], 1])
    return found


def seen_by(campaign: Campaign) -> dict[str, int]:
    """Number of positions with a single bounce off each of the corridor's two walls."""
    rays = rays_of(campaign)
    single = is_single_wall_bounce(campaign, rays) & (np.abs(rays.vertex[:, 0] - EAST) < HALF_LENGTH)
    return {
        name: len(np.unique(rays.link[single & (np.abs(rays.vertex[:, 1] + published.CORRIDOR_WALLS[name]) < 1e-6)]))
        for name in SIDES
    }


def describe(studied: Study) -> str:
    """Describe the corridor on a map, beside the letter's ordinates and the true number of paths."""
    found, seen = walls(studied.environment), seen_by(studied.campaign)
    words = [
        f"{name} {f'at {-found[name]:.3f} m' if name in found else 'missing'} "
        f"({published.CORRIDOR_WALLS[name]:.2f} m printed; {seen[name]} positions have a single bounce off it)"
        for name in SIDES
    ]
    width = f"; {width_of(studied.environment):.3f} m apart ({PRINTED_WIDTH:.2f} printed)" if len(found) == 2 else ""
    return ", ".join(words) + width


def width_of(environment: Environment) -> float:
    """Width of the corridor on a map [m]; NaN unless both walls are on it."""
    found = walls(environment)
    return abs(found[SIDES[0]] - found[SIDES[1]]) if len(found) == 2 else float("nan")
