"""Section of the page on the letter's mapping to the environment: DAPS with computed sectors."""

from typing import TYPE_CHECKING, cast

import numpy as np

from erm.common.page import Page
from erm.evaluation.explain import UNEXPLAINED, azimuth_sectors, count_reflectors, explain, last_reflector
from erm.figures import plot_sectors
from erm.letter.captures import Captures
from erm.letter.routes import Study
from erm.letter.truth import NO_PATH, rays_of, true_ray

if TYPE_CHECKING:
    import numpy.typing as npt
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

OVERLAID = (("Route 1", "RX2_L", "RX9_L"), ("Route 2", "RX2_N", "RX3_N"))


def daps(page: Page, studied: Study, captures: Captures) -> None:
    """Fig. 3: two pairs of DAPS with computed sectors."""
    import matplotlib.pyplot as plt

    page.add(
        "## DAPS (Fig. 3)",
        "The sectors are computed. Each MPC is assigned to the path through the reconstructed map that is nearest in "
        "delay and azimuth. The MPCs whose last reflector is the same make its sector, 5° wider on either side. W are "
        "walls and P poles; the number is the row of the reflector in the table of the map, below. The number of MPCs "
        "is in brackets. The direct path counts with the ground bounce under it (black). Every MPC has a mark. An arc "
        "without a mark is a sidelobe of the horn at the delay of a stronger MPC. A mark without a sector (a cross) is "
        "an MPC that the map does not explain. The tables show the true number of bounces of each.",
    )
    rays = rays_of(studied.campaign)
    for route, first, second in OVERLAID:
        pair = (first, second)
        table = studied.table.isel(mpc=np.flatnonzero(studied.of(pair)))
        labels = explain(table, studied.environment)
        arcs = azimuth_sectors(table["azimuth"].values, [last_reflector(label) for label in labels])
        figure = plt.figure(figsize=(7.4, 5.8), layout="constrained")
        axes = captures.draw_daps([(name, studied.daps[name]) for name in pair], _polar(figure))
        plot_sectors(arcs, axes, table=table, labels=labels)
        page.figure(f"daps_{first}_{second}", figure, _caption(route, pair, labels))
        ray = true_ray(table, studied.campaign, rays)
        order = np.lexsort((table["delay"].values, table["position"].values))
        page.table(
            ["RX", "delay [ns]", "azimuth [°]", "path gain [dB]", "explained by", "true bounces"],
            [
                [
                    str(table["position"].values[i]),
                    f"{1e9 * table['delay'].values[i]:.1f}",
                    f"{table['azimuth'].values[i] % 360:.0f}",
                    f"{table['path_gain'].values[i]:.0f}",
                    str(labels[i]).replace("+", ", then ") or None,
                    int(rays.order[ray[i]]) if ray[i] != NO_PATH else None,
                ]
                for i in order.tolist()
            ],
        )


def _caption(route: str, pair: tuple[str, str], labels: "npt.NDArray[np.str_]") -> str:
    unexplained = int(np.count_nonzero(labels == UNEXPLAINED))
    chains = sum(count_reflectors(label) > 1 for label in labels.tolist())
    return (
        f"{route}: DAPS of {pair[0]} (blue) and {pair[1]} (orange). Of their {len(labels)} MPCs the map explains "
        f"{len(labels) - unexplained}, {chains} of them by more than one reflector; {unexplained} have no sector."
    )


def _polar(figure: "Figure") -> "PolarAxes":
    return cast("PolarAxes", figure.add_subplot(projection="polar"))
