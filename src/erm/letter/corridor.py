"""The letter's corridor: what of it the map holds, and what a transmitter inside would show."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from erm.letter import published
from erm.letter.captures import Campaign, Captures, Change
from erm.letter.routes import Study, study
from erm.letter.truth import is_single_wall_bounce, rays_of
from erm.maps.environment import Environment

ROUTE = "Route 2"
INSIDE = (70.0, -58.0, 4.0)  # m; in the corridor, further east than the route
CLOSER = Change(power=-15.0)  # dB; at 14 to 22 m the receiver gets no more than it does on the street
EAST, REACH = 50.0, 15.0  # m; where along the corridor walls are looked for
NEAR, LEVEL = 1.0, 5.0  # m, degree; of the letter's wall
SIDES = ("teaching building", "south corridor wall")
PRINTED_WIDTH = published.CORRIDOR_WALLS[SIDES[1]] - published.CORRIDOR_WALLS[SIDES[0]]


def from_inside(campaign: Campaign, captures: Captures, *, progress: Callable[[], None] | None = None) -> Study:
    """Study route 2 once more, with a transmitter in the corridor: both walls face it."""
    links = [replace(link, tx=INSIDE) for link in campaign.links if link.name in published.TABLE_2[ROUTE]]
    return study(campaign.at(links), captures, CLOSER, progress=progress)


def walls(environment: Environment) -> dict[str, float]:
    """Northing of each of the corridor's two walls that a map holds, by the letter's name [m]."""
    table = environment.reflectors
    middle, normal = table["end_points"].values.mean(axis=1), table["normal"].values
    level = np.abs(np.sin(np.radians(normal))) > np.cos(np.radians(LEVEL))
    beside = (table["kind"].values == "wall") & level & (np.abs(middle[:, 0] - EAST) < REACH)
    found = {}
    for name in SIDES:
        near = np.flatnonzero(beside & (np.abs(middle[:, 1] + published.CORRIDOR_WALLS[name]) < NEAR))
        if near.size:
            found[name] = float(middle[near[0], 1])
    return found


def seen_by(campaign: Campaign) -> dict[str, int]:
    """Number of positions that have a single bounce off each of the corridor's two walls."""
    rays = rays_of(campaign)
    single = is_single_wall_bounce(campaign, rays) & (np.abs(rays.vertex[:, 0] - EAST) < REACH)
    return {
        name: len(np.unique(rays.link[single & (np.abs(rays.vertex[:, 1] + published.CORRIDOR_WALLS[name]) < 1e-6)]))
        for name in SIDES
    }


def told(studied: Study) -> str:
    """What a map has of the corridor, beside the letter's ordinates and the paths there were."""
    found, seen = walls(studied.environment), seen_by(studied.campaign)
    words = [
        f"{name} {f'at {-found[name]:.3f} m' if name in found else 'not there'} "
        f"({published.CORRIDOR_WALLS[name]:.2f} printed; {seen[name]} positions had a single bounce off it)"
        for name in SIDES
    ]
    width = f"; {width_of(studied.environment):.3f} m apart ({PRINTED_WIDTH:.2f} printed)" if len(found) == 2 else ""
    return ", ".join(words) + width


def width_of(environment: Environment) -> float:
    """Width of the corridor by a map [m]; NaN where it does not hold both walls."""
    found = walls(environment)
    return abs(found[SIDES[0]] - found[SIDES[1]]) if len(found) == 2 else float("nan")
