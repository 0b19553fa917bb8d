"""Options of the selection of MPCs, apart from it: command lines need them before they load numpy."""

from typing import Literal

Threshold = Literal["consistency", "fixed", "letter"]
"""How single reflections are selected; see `erm.mpcs.selection.select`."""
