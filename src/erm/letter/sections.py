"""How the page opens: what it is, how the letter must be read, and its set-ups beside ours."""

from erm.common.page import Page
from erm.letter import published, room, routes
from erm.letter.captures import Campaign


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
    page.add(
        "## Set-ups (Tables 1 and 2)",
        f"Both ship with the instrument, as its scenes `{room.SCENE}` and `{routes.SCENE}`; *here* is read from them.",
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
