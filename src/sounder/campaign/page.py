"""Report of a campaign, one page: the map with its errors, the score, the set-up, each position, and the failures."""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from erm.common.console import counted
from erm.common.page import Page, cell
from erm.common.storage import SOFTWARE, open_group
from erm.mpcs.reasons import Reason, count_reasons
from sounder.campaign.result import PARAMETERS, POINT_DATA, POINTS, PRODUCTS, STATISTICS, TABLE
from sounder.instrument.description import Sounder
from sounder.processing.recording_summary import describe_sounder
from sounder.processing.summary_texts import line_of_sight
from sounder.quality.table import read_remarks
from sounder.remark import lines

if TYPE_CHECKING:
    from sounder.campaign.result import CampaignResult

MAX_SHOWN_MPCS = 10
"""Strongest MPCs of a position that the page shows; the MPC table holds all. Chosen; not derived."""
IMAGES = (".png", ".svg")
"""Formats of figures that Markdown can show. Others are linked."""


def fill_page(result: "CampaignResult", page: Page) -> None:
    """Fill the page.

    It holds neither the folder, nor the time, nor what existed before: the same campaign gives the same page.

    Parameters
    ----------
    result : CampaignResult
    page : Page
    """
    campaign = result.campaign
    positions = [_Position(product, root, result) for product, root in result.products.items()]
    page.add(f"# {campaign.name}", _overview(result))
    if result.failures:
        page.add("## What failed", _list(_relative(line, campaign.source.parent) for line in result.failures))
    page.add("## Map", _image(result.map_figure, result.out, "Map of the walls, reflection points, TX and RX"))
    _reflectors(result, page)
    if result.score:
        _score(result, page)
    _set_up(result, positions, page)
    page.add("## Positions")
    page.table(
        ["position", "line of sight", "TX to RX [m]", "MPCs", "on reflectors", "strongest [ns]", "azimuth [degree]",
         "path gain [dB]", "directions missing", "with problems", "remarks"],
        [position.row for position in positions],
    )  # fmt: skip
    for position in positions:
        _position_section(position, result, page)


class _Position:
    """What the page shows of a product."""

    def __init__(self, product: Path, root: xr.Dataset, result: "CampaignResult") -> None:
        self.product, self.attributes = product, root.attrs
        self.name = str(root["position"].item())
        self.tx, self.rx = (root[f"{end}_position"].values[0] for end in ("tx", "rx"))
        remarks, recorded = read_remarks(open_group(product, "/quality")), int(root.attrs["recorded_directions"])
        self.failures, self.notes = (lines(remarks, recorded, failures=which) for which in (True, False))
        rows = np.flatnonzero(result.table["position"].values == self.name)
        self.table, self.located = result.table.isel(mpc=rows), result.located.isel(mpc=rows)

    @property
    def row(self) -> list[object]:
        strongest: list[object] = [None] * 3
        if self.table.sizes["mpc"]:
            first = self.table.isel(mpc=0)
            formats = {"delay": (1e9, 2), "azimuth": (1, 1), "path_gain": (1, 1)}
            strongest = [f"{float(first[name]) * scale:.{digits}f}" for name, (scale, digits) in formats.items()]
        remarks = [
            counted(len(lines), kind) for lines, kind in ((self.failures, "failure"), (self.notes, "note")) if lines
        ]
        return [
            f"[{_link_text(self.name)}](#{_anchor(self.name)})",
            line_of_sight(int(self.attributes["los"])),
            f"{np.linalg.norm(self.tx - self.rx):.2f}",
            int(self.table.sizes["mpc"]),
            int(np.sum(self.located["wall"].values >= 0)),
            *strongest,
            int(self.attributes["missing_directions"]),
            int(self.attributes["problem_directions"]),
            ", ".join(remarks),
        ]


def _overview(result: "CampaignResult") -> str:
    maps = [f"map.{suffix}" for suffix in result.campaign.map.formats]
    files = [TABLE, *maps, POINTS, PARAMETERS, STATISTICS, POINT_DATA]
    links = ", ".join(f"[{name}]({name})" for name in files)
    return (
        f"{counted(len(result.products), 'position')} and {counted(result.table.sizes['mpc'], 'MPC')}; "
        f"{result.reflectors}. Made by `sounder run` ({SOFTWARE}) from `{result.campaign.source.name}`. "
        f"Files: {links}; the products of all positions are in `{PRODUCTS}`. Errors after ± are one standard deviation."
    )


def _reflectors(result: "CampaignResult", page: Page) -> None:
    located = result.located.attrs
    if "delay_std" in located:
        page.add(
            f"Typical standard errors of an MPC: {located['delay_std'] * 1e9:.2g} ns and "
            f"{located['azimuth_std']:.2g} degrees; from {located['errors_from']} and the residuals."
        )
    table = result.environment.reflectors
    if not table.sizes["reflector"]:
        pairs = result.campaign.map.min_support
        page.add(f"No reflector was found. A wall needs MPCs of {pairs} or more antenna pairs that share it.")
    else:
        page.table(
            ["reflector", "kind", "normal [degree]", "offset [m]", "from [m]", "to [m]", "length [m]", "top [m]",
             "MPCs", "material"],
            [_reflector(table.isel(reflector=i), i) for i in range(table.sizes["reflector"])],
        )  # fmt: skip
    counts = count_reasons(result.located["reason"].values.tolist())
    page.add("Use of the MPCs:")
    page.table(["MPCs", "use"], [(count, reason.text) for reason, count in counts.items()])


def _reflector(one: xr.Dataset, number: int) -> list[object]:
    ends = one["end_points"].values
    std = np.sqrt(np.diag(one["covariance"].values))
    where = [f"{east:.2f}, {north:.2f}" for east, north in ends]
    wall = one["kind"].item() == "wall"
    if not wall:
        errors = np.sqrt(np.diag(one["centre_covariance"].values))
        where[0] = ", ".join(with_error(value, error) for value, error in zip(ends[0].tolist(), errors, strict=True))
    return [
        number,
        one["kind"].item(),
        with_error(one["normal"].item(), std[0]),
        with_error(one["offset"].item(), std[1]),
        where[0],
        where[1] if wall else f"radius {one['radius'].item():.2f}",
        f"{np.linalg.norm(ends[1] - ends[0]):.1f}" if wall else None,
        f"{one['top'].item():.1f}",
        int(one["support"].item()),
        one["material"].item(),
    ]


def _score(result: "CampaignResult", page: Page) -> None:
    walls, points, outline = result.score["walls"], result.score["points"], result.campaign.map.outline
    page.add(f"## Score\n\nCompared with the outline `{outline.name if outline else ''}`.")
    rows: list[list[object]] = [
        ["walls on the map", walls["walls"]],
        ["false walls, where the outline has no face", walls["false"]],
        ["length of walls on a face [%]", 100 * walls["correctness"]],
        ["offset of walls, RMSE [m]", walls["offset_error"]["rmse"]],
        ["angle of walls, RMSE [degree]", walls["angle_error"]["rmse"]],
        ["RPs of single MPCs, perpendicular RMSE [m]", points["single"]["perpendicular"]["rmse"]],
        ["RPs on walls, perpendicular RMSE [m]", points["merged"]["perpendicular"]["rmse"]],
    ]
    page.table(["score", "value"], rows)
    page.table(
        ["seen by receivers", "outline [m]", "with a wall [%]"],
        [[f"{seen.receivers} or more", f"{seen.length:.0f}", 100 * seen.share] for seen in result.score["visible"]],
    )


def _set_up(result: "CampaignResult", positions: list[_Position], page: Page) -> None:
    campaign = result.campaign
    page.add("## Set-up")
    places = {tuple((np.round(position.tx, 3) + 0.0).tolist()) for position in positions}  # + 0: no -0
    rows: list[tuple[str, str]] = []
    for text in dict.fromkeys(position.attributes["sounder"] for position in positions):
        rows += describe_sounder(Sounder.from_tables(json.loads(text), campaign.source.name))
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
            rows.append((label, ", ".join(f"`{name}`" for name in dict.fromkeys(files))))
    rows.append(("processing", _options(json.loads(positions[0].attributes["processing_options"]))))
    asked = campaign.map.model_dump(
        include={"threshold", "max_loss", "min_support", "ground", "rx_std", "heading_std", "clock_std"}
    )
    rows.append(("map", _options(asked)))
    if (place := campaign.map.georeference) is not None:
        where = f"{place.latitude:.10g}, {place.longitude:.10g}, {place.height:g} m"
        rows.append(("origin", f"{where}; heading {place.heading:g} degrees"))
    page.table(["what", "value"], list(dict.fromkeys(rows)))


def _position_section(position: _Position, result: "CampaignResult", page: Page) -> None:
    page.add(f"### {position.name}")
    remarks = [f"**{line}**" for line in position.failures] + position.notes
    if remarks:
        page.add(_list(remarks))
    if position.product in result.figures:
        kinds = ("DAPS in polar form", "DAPS and MPCs", "PDP")
        drawn = zip(result.figures[position.product], kinds, strict=True)
        page.add("\n".join(_image(path, result.out, f"{kind} of {_link_text(position.name)}") for path, kind in drawn))
    count = position.table.sizes["mpc"]
    if not count:
        page.add("No MPCs.")
        return
    if count > MAX_SHOWN_MPCS:
        page.add(f"The strongest {MAX_SHOWN_MPCS} of {count} MPCs:")
    page.table(
        ["delay [ns]", "azimuth [degree]", "elevation [degree]", "path gain [dB]", "reflector or reason"],
        [_mpc_row(position.table, position.located, row) for row in range(min(count, MAX_SHOWN_MPCS))],
    )


def _mpc_row(table: xr.Dataset, located: xr.Dataset, row: int) -> list[object]:
    scales = {"delay": 1e9, "azimuth": 1.0, "elevation": 1.0, "path_gain": 1.0}
    values = [
        with_error(float(table[name].values[row]) * scale, float(table[f"{name}_std"].values[row]) * scale)
        for name, scale in scales.items()
    ]
    wall = int(located["wall"].values[row])
    return [*values, wall if wall >= 0 else Reason(located["reason"].values[row]).text]


def with_error(value: float, std: float) -> str:
    """Write a value and its standard deviation to the second digit of the latter; a dash if the value is not known."""
    if not np.isfinite(value):
        return cell(None)
    if not (np.isfinite(std) and std > 0):
        return f"{value:.6g}"
    digits = max(1 - int(np.floor(np.log10(std))), 0)
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def _options(options: dict[str, Any]) -> str:
    return ", ".join(f"{name} {cell(value)}" for name, value in options.items() if value is not None)


def _list(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _image(path: Path, out: Path, text: str) -> str:
    link = f"[{text}]({path.relative_to(out).as_posix()})"
    return f"!{link}" if path.suffix in IMAGES else link


def _relative(line: str, folder: Path) -> str:
    """A line with files named relative to a folder, and ``*`` escaped."""
    return line.replace(f"{folder}{os.sep}", "").replace("*", r"\*")


def _link_text(name: str) -> str:
    """A name in the brackets of a link."""
    return name.replace("[", r"\[").replace("]", r"\]")


def _anchor(name: str) -> str:
    """Anchor of the heading of a position."""
    return "".join(one for one in name.lower().replace(" ", "-") if one.isalnum() or one in "-_")
