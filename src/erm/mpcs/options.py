"""Options of the selection of MPCs, in a separate file: command lines need them before they load numpy."""

from typing import Literal

Threshold = Literal["consistency", "fixed", "letter"]
"""How single reflections are selected; see `erm.mpcs.selection.select`."""
