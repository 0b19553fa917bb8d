"""Arguments that several commands share, and numbers as they print them."""

import math
from pathlib import Path
from typing import Annotated

import typer

MapFile = Annotated[Path, typer.Argument(help="Map: .h5, .geojson, .gpkg or .csv.", show_default=False)]
FIGURES = (".png", ".pdf", ".svg")
"""Formats of figures."""


def hundredths(value: float) -> str:
    """Write a float to two decimals, an integer as it is, NaN as nothing."""
    return str(value) if isinstance(value, int) else "" if math.isnan(value) else f"{value:z.2f}"


def three_digits(value: float) -> str:
    """Write a float to three significant digits, an integer as it is, NaN as nothing."""
    return str(value) if isinstance(value, int) else "" if math.isnan(value) else f"{value:.3g}"
