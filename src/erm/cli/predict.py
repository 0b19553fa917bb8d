"""The command ``erm predict``: the MPCs between two places, from a map."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from erm.cli.arguments import MapFile, hundredths
from erm.common import console
from erm.common.errors import OptionError
from erm.common.messages import note
from erm.common.outputs import protect_inputs, require_suffix

if TYPE_CHECKING:
    import xarray as xr

Point = tuple[float, float, float]


def predict(
    environment: MapFile,
    tx: Annotated[Point, typer.Option(help="Position of the transmitter, east north up [m].", show_default=False)],
    rx: Annotated[Point, typer.Option(help="Position of the receiver, east north up [m].", show_default=False)],
    frequency: Annotated[float, typer.Option(min=1e6, max=1e13, help="Carrier frequency [Hz].")] = 132e9,
    max_order: Annotated[int, typer.Option(min=0, max=3, help="Largest number of reflections of a path.")] = 2,
    out: Annotated[Path | None, typer.Option(help="Also write the MPCs as a table (.csv).")] = None,
) -> None:
    """Predict the MPCs between any two positions."""
    protect_inputs((out,), (environment,))
    require_suffix(out, ".csv")
    for option, place in (("--tx", tx), ("--rx", rx)):
        if not all(map(math.isfinite, place)):
            raise OptionError(f"{option} is {place}; expected three finite numbers, east north up [m]")
    if tx == rx:
        raise OptionError(f"--tx and --rx are both {tx}; expected two different positions")
    import erm

    mpcs = erm.predict(erm.read_map(environment), tx, rx, frequency, max_order=max_order)
    if out:
        erm.write_mpcs(mpcs, out)
    _print(mpcs)
    if not mpcs.sizes["mpc"]:
        note(f"no path with at most {console.counted(max_order, 'reflection')} from TX to RX")


def _print(mpcs: "xr.Dataset") -> None:
    names = ("azimuth", "elevation", "path_gain")
    columns = (mpcs["delay"].values * 1e9, *(mpcs[name].values for name in names))
    console.show(
        ["delay [ns]", "azimuth [degree]", "elevation [degree]", "path gain [dB]", "reflections"],
        ([*map(hundredths, row), order] for *row, order in zip(*columns, mpcs["order"].values.tolist(), strict=True)),
    )
