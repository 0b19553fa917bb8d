"""``sounder verify``: the sounder against known artefacts."""

import math
from pathlib import Path
from typing import Annotated

import typer

from erm.common import console
from erm.common.messages import write_json
from erm.common.outputs import protect_inputs, require_suffix


def verify(
    artefacts: Annotated[Path, typer.Argument(help="Description of the verification (TOML).")],
    out: Annotated[Path | None, typer.Option(help="Page with all figures: .pdf, .png or .svg.")] = None,
    history: Annotated[
        Path | None, typer.Option(help="Data of the control chart (CSV), made if missing; results are added.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Test the sounder with known cables, attenuators or links.

    Cables, attenuators, a corner reflector or a link of known length show the errors of delay, gain and linearity, the
    dynamic range and the repeatability, with their standard deviations. The exit code is 1 if an error exceeds two
    standard deviations.
    """
    require_suffix(out, ".pdf", ".png", ".svg")
    from sounder.verification.description import load_verification
    from sounder.verification.history import entries, read_history, with_today, write_history
    from sounder.verification.page import HEADER, draw_page, rows
    from sounder.verification.verify import verify as measure

    described = load_verification(artefacts)
    protect_inputs((out, history), (artefacts, *described.inputs))
    earlier = [] if history is None else read_history(history)
    verified = measure(described)
    known = with_today(earlier, entries(verified))
    if as_json:
        plain = [
            {
                "artefact": one.artefact,
                "quantity": one.quantity,
                "unit": one.unit,
                "known": None if math.isnan(one.expected) else one.expected,
                "measured": one.measured,
                "error": one.error,
                "std": None if math.isnan(one.std) else one.std,
                "agrees": one.agrees,
            }
            for one in verified.figures
        ]
        write_json(plain)
    else:
        console.show(HEADER, rows(verified.figures))
    if out is not None:
        with console.drawing():
            console.save_figure(draw_page(verified, known), out)
    if history is not None:
        write_history(known, history)
    console.report_failures(
        [
            f"{artefacts}: {one.artefact}: the {one.quantity} is {abs(one.error) / one.std:.1f} standard deviations off"
            for one in verified.disagreeing
        ]
    )
