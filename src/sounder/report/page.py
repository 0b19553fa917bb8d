"""The page as one HTML file: its template, styles and scripts stand in ``assets``, its data are JSON inside."""

import json
from pathlib import Path
from typing import Any

from jinja2 import Environment as Templates
from jinja2 import FileSystemLoader, StrictUndefined
from markupsafe import Markup

from erm.common.atomic import atomic_path
from erm.common.storage import SOFTWARE
from erm.mpcs.reasons import count_reasons
from sounder.processing.parameter_tables import summarise
from sounder.report.calibration import back_to_back
from sounder.report.channel import fits, parameter_columns
from sounder.report.contents import Contents
from sounder.report.geometry import mpc_columns, reflectors
from sounder.report.numbers import rounded, with_error
from sounder.report.positions import describe_position

ASSETS = Path(__file__).parent / "assets"
SCRIPTS = ("elements.js", "charts.js", "tables.js", "map.js", "page.js")
"""Scripts in the order in which they need one another."""


def write_page(contents: Contents, path: Path) -> Path:
    """Write the page of a campaign.

    It holds neither the folder, nor the time, nor what existed before: the same campaign gives the same page. Texts
    from files of users are escaped by the template, and as JSON.

    Parameters
    ----------
    contents : Contents
    path : Path

    Raises
    ------
    DataError
        The file cannot be written, or a product cannot be read.
    """
    templates = Templates(
        loader=FileSystemLoader(ASSETS),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["error"] = with_error
    data = page_data(contents)
    text = templates.get_template("page.html").render(
        contents=contents,
        software=SOFTWARE,
        styles=Markup((ASSETS / "page.css").read_text(encoding="utf-8")),
        script=Markup("\n".join((ASSETS / name).read_text(encoding="utf-8") for name in SCRIPTS)),
        data=Markup(_as_script(data)),
        reflectors=data["reflectors"],
        positions=data["positions"],
        calibrations=data["calibrations"],
        uses=[(reason.text, count) for reason, count in count_reasons(contents.located["reason"].values).items()],
        summary=summarise(contents.statistics),
        definitions=dict.fromkeys(contents.parameters["definition"].values.tolist()),
        checksums=_checksums(contents),
    )
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def page_data(contents: Contents) -> dict[str, Any]:
    """Data of the map, the charts and the tables of the page."""
    parameters = contents.parameters
    return {
        "positions": [describe_position(path, root, contents.located) for path, root in contents.products.items()],
        "mpcs": mpc_columns(contents),
        "reflectors": reflectors(contents.environment.reflectors),
        "outline": rounded(contents.outline, 2) if contents.outline is not None else [],
        "north": contents.environment.georeference.heading if contents.environment.georeference else 0.0,
        "parameters": {
            "positions": parameters["position"].values.tolist(),
            "distance": rounded(parameters["distance"].values, 3),
            "columns": parameter_columns(parameters),
        },
        "fits": fits(contents.statistics),
        "calibrations": [back_to_back(b2b) for b2b in contents.calibrations],
    }


def _as_script(data: dict[str, Any]) -> str:
    """JSON that stands in a script element: no text can end the element or begin a comment."""
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", r"\u003c").replace(">", r"\u003e").replace("&", r"\u0026")


def _checksums(contents: Contents) -> list[tuple[str, str, str]]:
    """Position, name and SHA-256 of each file that its product was made from."""
    return [
        (str(root["position"].item()), name, checksum)
        for root in contents.products.values()
        for name, checksum in json.loads(root.attrs["input_sha256"]).items()
    ]
