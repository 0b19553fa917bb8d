"""Options of processing: what each may be, in one place for functions, campaign files and the command line."""

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args, get_type_hints

from erm.common.errors import OptionError

Averaging = Literal["coherent", "phase-aligned", "power"]
"""How the snapshots of a direction are averaged."""
Threshold = Literal["usc", "nyu"]
"""Least power of an MPC: noise floor + 12 dB (usc), or max(strongest - 25 dB, noise floor + 5 dB) (nyu)."""
Method = Literal["sage", "clean", "peaks"]
"""How overlapping MPCs are separated."""
Omnidirectional = Literal["sum", "maximum"]
"""How the omnidirectional PDP is made: sum of the beams, or strongest beam."""
FigureFormat = Literal["png", "pdf", "svg"]
"""File format of figures."""


@dataclass(frozen=True)
class Options:
    """How recordings are processed. Every product stores its options.

    Attributes
    ----------
    averaging : {"coherent", "phase-aligned", "power"}
        Over the snapshots of a direction; see :func:`sounder.cir.impulse_response.impulse_responses`.
    threshold : {"usc", "nyu"}
        Least power of an MPC; see :func:`sounder.mpc.extract.extract_mpcs`.
    method : {"sage", "clean", "peaks"}
        How overlapping MPCs are separated; see :func:`sounder.mpc.extract.extract_mpcs`.
    omnidirectional : {"sum", "maximum"}
        How the omnidirectional PDP is made; see :func:`sounder.cir.power_spectrum.daps`.
    keep_cir : bool
        Keep the impulse responses in the product.

    Raises
    ------
    OptionError
        A value is none of these.

    Examples
    --------
    >>> from sounder import Options
    >>> Options(threshold="nyu").method
    'sage'
    >>> Options(threshold="noise")
    Traceback (most recent call last):
    erm.common.errors.OptionError: threshold is 'noise'; expected one of usc, nyu
    """

    averaging: Averaging = "coherent"
    threshold: Threshold = "usc"
    method: Method = "sage"
    omnidirectional: Omnidirectional = "sum"
    keep_cir: bool = False

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self))
        for field in fields(self):
            if get_args(hints[field.name]):
                require_choice(field.name, getattr(self, field.name), hints[field.name])


def require_choice(name: str, value: str, choices: Any) -> None:
    """Check an option of a stage.

    Parameters
    ----------
    name, value : str
    choices : Literal
        The values it may have.

    Raises
    ------
    OptionError
        It has another.
    """
    if value not in get_args(choices):
        raise OptionError(f"{name} is {value!r}; expected one of {', '.join(get_args(choices))}")
