"""First sections of the page: what it is, how to read the letter, and its set-ups beside ours."""

from erm.common.page import Page
from erm.letter import published, room, routes
from erm.letter.captures import Campaign


def opening(page: Page) -> None:
    """Write what the page is, and how to read the letter."""
    page.add(
        "# The letter, repeated",
        "This page shows the printed numbers of *Environment Reconstruction with Multi-targets Reflectors-merged "
        "Sensing Method Based on THz Single-sided Channel Characteristics* (Chang et al.) beside the same numbers "
        "computed by this software. All captures are synthetic: paths are traced, a simulated instrument with noise "
        "and faults makes raw captures of them, and only the raw samples are processed.",
        "How to read the letter:",
        "- **What the letter calls RMSE is the standard deviation** of the error: an RMSE cannot be below the mean. "
        "Here the true RMSE has a column of its own.\n"
        "- **Its formula of D_Error has three slips**: a plus sign for a minus, `b_a` for `b_L`, and no square root. "
        "The distance is `|y - a x - b| / sqrt(1 + a^2)`; only with this do the printed points give the printed "
        "errors. (Its face `L(x) = a_L x + a_L` must be `a x + b`.)\n"
        "- **Its equations are planar** but use the slant length of the path. With heights of 28.4 and 1.4 m this "
        "alone moves the reflection points by metres.\n"
        '- The "correlation length 0.15, height standard deviation 1.7" of the plaster are taken as swapped, in mm.',
    )


def set_ups(page: Page, simulation: Campaign, measurement: Campaign) -> None:
    """Tables 1 and 2: the shipped scenes beside the printed values."""
    page.add(
        "## Set-ups (Tables 1 and 2)",
        f"Both ship with the instrument as its scenes `{room.SCENE}` and `{routes.SCENE}`. "
        "The columns *here* are read from them.",
    )
    page.table(
        ["parameter", "simulation, printed", "here", "measurement, printed", "here"],
        [
            [name, *(value for pair in zip(printed, ours, strict=True) for value in pair)]
            for name, printed in published.TABLE_1.items()
            for ours in [(simulation.parameters[name], measurement.parameters[name])]
        ],
    )
    page.add(
        "The letter's simulation has an omnidirectional receiver and takes the azimuths of arrival from the ray "
        "tracer. A capture contains an azimuth only if an antenna turns. The captures of the room therefore use the "
        "horn of the measurement at 300 GHz; the transmitter is omnidirectional, 0 dBi, as printed."
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
