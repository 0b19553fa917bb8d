"""What the page of a campaign shows: its result, and the settings that it was made with."""

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from erm.common.console import counted
from erm.common.page import cell
from sounder.campaign.result import PARAMETERS, POINT_DATA, POINTS, PRODUCTS, STATISTICS, TABLE
from sounder.instrument.description import Sounder
from sounder.processing.recording_summary import describe_sounder
from sounder.report.contents import Contents

if TYPE_CHECKING:
    from sounder.campaign.result import CampaignResult


def page_contents(result: "CampaignResult") -> Contents:
    """Everything that the page shows of a campaign."""
    campaign, located = result.campaign, result.located.attrs
    maps = [f"map.{suffix}" for suffix in campaign.map.formats]
    summary = [
        f"{counted(len(result.products), 'position')} and {counted(result.table.sizes['mpc'], 'MPC')}; "
        f"{result.reflectors}. Made by sounder run from {campaign.source.name}; the products of all positions are in "
        f"the folder {PRODUCTS}. Errors after ± are one standard deviation.",
        *filter(None, [result.environment.reflectors.attrs.get("empty")]),
    ]
    if "delay_std" in located:
        summary.append(
            f"Typical standard errors of an MPC: {located['delay_std'] * 1e9:.2g} ns and "
            f"{located['azimuth_std']:.2g} degrees; from {located['errors_from']} and the residuals."
        )
    folder = f"{campaign.source.parent}{os.sep}"
    return Contents(
        title=campaign.name,
        summary=summary,
        products=result.products,
        table=result.table,
        located=result.located,
        environment=result.environment,
        parameters=result.parameters,
        statistics=result.statistics,
        outline=result.outline,
        score=result.score,
        failures=[line.replace(folder, "") for line in result.failures],
        notes=[line.replace(folder, "") for line in result.notes],
        settings=_settings(result),
        files=[TABLE, *maps, POINTS, PARAMETERS, STATISTICS, POINT_DATA],
        calibrations=result.calibrations,
    )


def _settings(result: "CampaignResult") -> list[tuple[str, str]]:
    campaign = result.campaign
    roots = list(result.products.values())
    rows: list[tuple[str, str]] = []
    for text in dict.fromkeys(root.attrs["sounder"] for root in roots):
        rows += describe_sounder(Sounder.from_tables(json.loads(text), campaign.source.name))
    places = {tuple((np.round(root["tx_position"].values[0], 3) + 0.0).tolist()) for root in roots}  # + 0: no -0
    rows += [("transmitter [m]", ", ".join(f"{value:g}" for value in place)) for place in sorted(places)]
    groups = campaign.recordings
    for label, files in (
        ("recordings", [pattern for group in groups for pattern in group.files]),
        ("back-to-back", [group.calibration.name for group in groups if group.calibration]),
        ("layout", [group.layout.name for group in groups if group.layout]),
        ("description", [group.sounder.name for group in groups if group.sounder]),
        ("table of positions", [group.positions.name for group in groups if group.positions]),
    ):
        if files:
            rows.append((label, ", ".join(dict.fromkeys(files))))
    rows.append(("processing", _options(json.loads(roots[0].attrs["processing_options"]))))
    asked = campaign.map.model_dump(
        include={"threshold", "max_loss", "min_support", "ground", "rx_std", "heading_std", "clock_std"}
    )
    rows.append(("map", _options(asked)))
    if campaign.map.outline:
        rows.append(("outline", campaign.map.outline.name))
    if (place := campaign.map.georeference) is not None:
        where = f"{place.latitude:.10g}, {place.longitude:.10g}, {place.height:g} m"
        rows.append(("origin", f"{where}; heading {place.heading:g} degrees"))
    return list(dict.fromkeys(rows))


def _options(options: dict[str, Any]) -> str:
    return ", ".join(f"{name} {cell(value)}" for name, value in options.items() if value is not None)
