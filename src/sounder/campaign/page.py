"""The report of a campaign, as one page: what was measured, the map with its errors, each position, what failed."""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from erm.common.console import counted
from erm.common.page import Page, cell
from erm.common.storage import SOFTWARE
from erm.mpcs.reasons import Reason, count_reasons
from sounder.instrument.description import Sounder
from sounder.processing.recording_summary import describe_sounder

if TYPE_CHECKING:
    from sounder.campaign.description import Campaign
    from sounder.campaign.result import Result

SHOWN = 10
"""MPCs of a position that the page shows, the strongest; the table beside it holds all."""
SEEN = (".png", ".svg")
"""Figures that a page of Markdown can show; others are linked."""


def tell(campaign: "Campaign", result: "Result", page: Page) -> None:
    """Fill the page.

    It names neither the folder nor the time, nor what was there before: the same campaign gives the same page.

    Parameters
    ----------
    campaign : Campaign
    result : Result
        Of :func:`sounder.campaign.run.run_campaign`.
    page : Page
    """
    positions = [_Position(product, root, result) for product, root in result.products.items()]
    page.add(f"# {campaign.name}", _opening(campaign, result))
    if result.failures:
        page.add("## What failed", _listed(_local(line, campaign) for line in result.failures))
    page.add("## Map", _shown(result.map_figure, result.out, "Map of the walls, reflection points, TX and RX"))
    _walls(campaign, result, page)
    if result.score:
        _score(campaign, result, page)
    _set_up(campaign, positions, page)
    page.add("## Positions")
    page.table(
        ["position", "line of sight", "TX to RX [m]", "MPCs", "on reflectors", "strongest [ns]", "azimuth [degree]",
         "path gain [dB]", "directions missing", "with problems", "remarks"],
        [position.row for position in positions],
    )  # fmt: skip
    for position in positions:
        _one(position, result, page)


class _Position:
    """A product as the page tells of it."""

    def __init__(self, product: Path, root: xr.Dataset, result: "Result") -> None:
        self.product, self.attributes = product, root.attrs
        self.name = str(root["position"].item())
        self.tx, self.rx = (root[f"{end}_position"].values[0] for end in ("tx", "rx"))
        self.failures, self.notes = (json.loads(root.attrs[name]) for name in ("failures", "notes"))
        rows = np.flatnonzero(result.table["position"].values == self.name)
        self.table, self.located = result.table.isel(mpc=rows), result.located.isel(mpc=rows)

    @property
    def row(self) -> list[object]:
        strongest: list[object] = [None] * 3
        if self.table.sizes["mpc"]:
            first = self.table.isel(mpc=0)
            places = {"delay": (1e9, 2), "azimuth": (1, 1), "path_gain": (1, 1)}
            strongest = [f"{float(first[name]) * scale:.{digits}f}" for name, (scale, digits) in places.items()]
        told = [
            counted(len(lines), kind) for lines, kind in ((self.failures, "failure"), (self.notes, "note")) if lines
        ]
        return [
            f"[{_text(self.name)}](#{_anchor(self.name)})",
            {1: "yes", 0: "no"}.get(int(self.attributes["los"]), "not known"),
            f"{np.linalg.norm(self.tx - self.rx):.2f}",
            int(self.table.sizes["mpc"]),
            int(np.sum(self.located["wall"].values >= 0)),
            *strongest,
            int(self.attributes["missing_directions"]),
            int(self.attributes["problem_directions"]),
            ", ".join(told),
        ]


def _opening(campaign: "Campaign", result: "Result") -> str:
    kind = result.environment.reflectors["kind"].values
    found = f"{counted(int(np.sum(kind == 'wall')), 'wall')} and {counted(int(np.sum(kind == 'pole')), 'pole')}"
    used = int(result.located["accepted"].sum())
    files = ["mpcs.csv", *(f"map.{suffix}" for suffix in campaign.map.formats), "reflection-points.csv"]
    links = ", ".join(f"[{name}]({name})" for name in files)
    made = f"Made by `sounder run` ({SOFTWARE}) from `{campaign.source.name}`."
    return (
        f"{counted(len(result.products), 'position')} and {counted(result.table.sizes['mpc'], 'MPC')}; {found} from "
        f"{used} of these. {made} Beside this page: {links}; the products of all positions are in `products`. Errors "
        "after ± are one standard deviation."
    )


def _walls(campaign: "Campaign", result: "Result", page: Page) -> None:
    located = result.located.attrs
    if "delay_std" in located:
        page.add(
            f"Typical errors of an MPC: {located['delay_std'] * 1e9:.2g} ns and {located['azimuth_std']:.2g} degrees; "
            f"from {located['errors_from']} and the residuals."
        )
    table = result.environment.reflectors
    if not table.sizes["reflector"]:
        page.add(
            f"No reflector was found. A wall needs MPCs of {campaign.map.min_support} or more antenna pairs that agree."
        )
    else:
        page.table(
            ["reflector", "kind", "normal [degree]", "offset [m]", "from [m]", "to [m]", "length [m]", "top [m]",
             "MPCs", "material"],
            [_reflector(table.isel(reflector=i), i) for i in range(table.sizes["reflector"])],
        )  # fmt: skip
    counts = count_reasons(result.located["reason"].values.tolist())
    page.add("What became of the MPCs:")
    page.table(["MPCs", ""], [(count, reason.text) for reason, count in counts.items()])


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


def _score(campaign: "Campaign", result: "Result", page: Page) -> None:
    walls, points = result.score["walls"], result.score["points"]
    judge = campaign.map.outline.name if campaign.map.outline else ""
    page.add(f"## Score\n\nAgainst the outline in `{judge}`.")
    rows: list[list[object]] = [
        ["walls on the map", walls["walls"]],
        ["of them where no face stands", walls["false"]],
        ["length of walls that lies on a face [%]", 100 * walls["correctness"]],
        ["offset of walls, RMSE [m]", walls["offset_error"]["rmse"]],
        ["angle of walls, RMSE [degree]", walls["angle_error"]["rmse"]],
        ["RPs of MPCs by themselves, perpendicular RMSE [m]", points["single"]["perpendicular"]["rmse"]],
        ["RPs on their walls, perpendicular RMSE [m]", points["merged"]["perpendicular"]["rmse"]],
    ]
    page.table(["", "result"], rows)
    page.table(
        ["seen by receivers", "outline [m]", "with a wall [%]"],
        [[f"{seen.receivers} or more", f"{seen.length:.0f}", 100 * seen.share] for seen in result.score["visible"]],
    )


def _set_up(campaign: "Campaign", positions: list[_Position], page: Page) -> None:
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
    ):
        if files:
            rows.append((label, ", ".join(f"`{name}`" for name in files)))
    rows.append(("processing", _options(json.loads(positions[0].attributes["processing_options"]))))
    asked = campaign.map.model_dump(include={"threshold", "max_loss", "min_support", "ground", "rx_std"})
    rows.append(("map", _options(asked)))
    if (place := campaign.map.georeference) is not None:
        where = f"{place.latitude:.10g}, {place.longitude:.10g}, {place.height:g} m"
        rows.append(("origin", f"{where}; heading {place.heading:g} degrees"))
    page.table(["what", "value"], rows)


def _one(position: _Position, result: "Result", page: Page) -> None:
    page.add(f"### {position.name}")
    said = [f"**{line}**" for line in position.failures] + position.notes
    if said:
        page.add(_listed(said))
    if position.product in result.figures:
        kinds = ("DAPS in polar form", "DAPS and MPCs", "PDP")
        drawn = zip(result.figures[position.product], kinds, strict=True)
        page.add("\n".join(_shown(path, result.out, f"{kind} of {_text(position.name)}") for path, kind in drawn))
    count = position.table.sizes["mpc"]
    if not count:
        page.add("No MPC.")
        return
    if count > SHOWN:
        page.add(f"The strongest {SHOWN} of {count} MPCs:")
    page.table(
        ["delay [ns]", "azimuth [degree]", "elevation [degree]", "path gain [dB]", "reflector, or why none"],
        [_component(position.table, position.located, row) for row in range(min(count, SHOWN))],
    )


def _component(table: xr.Dataset, located: xr.Dataset, row: int) -> list[object]:
    scales = {"delay": 1e9, "azimuth": 1.0, "elevation": 1.0, "path_gain": 1.0}
    values = [
        with_error(float(table[name].values[row]) * scale, float(table[f"{name}_std"].values[row]) * scale)
        for name, scale in scales.items()
    ]
    wall = int(located["wall"].values[row])
    return [*values, wall if wall >= 0 else Reason(located["reason"].values[row]).text]


def with_error(value: float, std: float) -> str:
    """A value and its standard deviation, both to the second digit of the latter; what is not known as a dash."""
    if not np.isfinite(value):
        return cell(None)
    if not (np.isfinite(std) and std > 0):
        return f"{value:.6g}"
    digits = max(1 - int(np.floor(np.log10(std))), 0)
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def _options(options: dict[str, Any]) -> str:
    return ", ".join(f"{name} {cell(value)}" for name, value in options.items() if value is not None)


def _listed(lines: Iterable[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _shown(path: Path, out: Path, text: str) -> str:
    link = f"[{text}]({path.relative_to(out).as_posix()})"
    return f"!{link}" if path.suffix in SEEN else link


def _local(line: str, campaign: "Campaign") -> str:
    """A line with files named from the folder of the campaign, in which Markdown finds nothing to emphasise."""
    return line.replace(f"{campaign.source.parent}{os.sep}", "").replace("*", r"\*")


def _text(name: str) -> str:
    """A name within the brackets of a link."""
    return name.replace("[", r"\[").replace("]", r"\]")


def _anchor(name: str) -> str:
    """Anchor that viewers of Markdown give the heading of a position."""
    return "".join(one for one in name.lower().replace(" ", "-") if one.isalnum() or one in "-_")
