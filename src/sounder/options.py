"""What options of the command line choose among."""

from enum import StrEnum


class Averaging(StrEnum):
    """Averaging over the snapshots of a direction."""

    coherent = "coherent"
    phase_aligned = "phase-aligned"
    power = "power"


class Threshold(StrEnum):
    """Least power of an MPC."""

    usc = "usc"
    nyu = "nyu"


class Method(StrEnum):
    """How MPCs that overlap are told apart."""

    sage = "sage"
    clean = "clean"
    peaks = "peaks"


class Omnidirectional(StrEnum):
    """Making of the omnidirectional PDP."""

    sum = "sum"
    maximum = "maximum"


class Format(StrEnum):
    """File format of figures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"
