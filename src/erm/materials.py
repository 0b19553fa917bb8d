"""What surfaces are made of: complex permittivity over frequency, and roughness."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite, nan, pi
from typing import Any

from scipy.constants import epsilon_0

from erm.errors import DataError


@dataclass(frozen=True)
class Material:
    """Electrical and surface properties of a reflector.

    Given either as a constant ``refractive_index`` ``n = n' - j n''`` (time convention ``exp(+j 2 pi f t)``:
    a lossy material has a negative imaginary part), or by the power laws of ITU-R P.2040 in GHz::

        eps_r(f) = permittivity[0] * f**permittivity[1]
        sigma(f) = conductivity[0] * f**conductivity[1]     [S/m]
        eps(f)   = eps_r - j sigma / (2 pi f eps_0)         n(f) = sqrt(eps(f))

    Parameters
    ----------
    name : str
        What environments refer to it by.
    refractive_index : complex, optional
        ``n' - j n''``; when given the power laws are not used.
    permittivity, conductivity : tuple of float
        ``(a, b)`` and ``(c, d)`` of the power laws.
    height_deviation : float
        Standard deviation of the surface's height [m]; 0 is a mirror.
    correlation_length : float
        Distance over which the height forgets itself [m]; NaN if unknown. The specular path does not
        depend on it.
    """

    name: str
    refractive_index: complex | None = None
    permittivity: tuple[float, float] = (1.0, 0.0)
    conductivity: tuple[float, float] = (0.0, 0.0)
    height_deviation: float = 0.0
    correlation_length: float = nan

    def __post_init__(self) -> None:
        n = self.refractive_index
        if n is not None and not (n.real > 0 and n.imag <= 0):
            raise DataError(
                f"material {self.name}: refractive index {n}; write it as n' - j n'', a loss is negative"
            )
        if n is None and not (self.permittivity[0] > 0 and self.conductivity[0] >= 0):
            raise DataError(f"material {self.name}: permittivity must be positive, conductivity not negative")
        if not (isfinite(self.height_deviation) and self.height_deviation >= 0):
            raise DataError(
                f"material {self.name}: height deviation {self.height_deviation} m; expected 0 or more"
            )

    def relative_permittivity(self, frequency: float) -> complex:
        """Complex relative permittivity ``eps' - j eps''`` at a frequency [Hz]."""
        if self.refractive_index is not None:
            return self.refractive_index**2
        ghz = frequency / 1e9
        a, b = self.permittivity
        c, d = self.conductivity
        return complex(a * ghz**b, -c * ghz**d / (2 * pi * frequency * epsilon_0))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; what is unknown is left out."""
        values = asdict(self)
        n = values.pop("refractive_index")
        if n is not None:
            del values["permittivity"], values["conductivity"]
            values["refractive_index"] = [n.real, n.imag]
        if not isfinite(self.correlation_length):
            del values["correlation_length"]
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Material":
        """Undo `to_dict`; an unknown or malformed property is a `DataError`."""
        named: dict[str, Any] = dict(values)
        try:
            for pair in ("permittivity", "conductivity"):
                if pair in named:
                    first, second = named[pair]
                    named[pair] = (float(first), float(second))
            if "refractive_index" in named:
                named["refractive_index"] = complex(*named["refractive_index"])
            return cls(**named)
        except (TypeError, ValueError) as error:
            raise DataError(f"material {named.get('name', '?')}: {error}") from error


def _itu(name: str, a: float, b: float, c: float, d: float) -> Material:
    return Material(name, permittivity=(a, b), conductivity=(c, d))


LIBRARY: Mapping[str, Material] = {
    material.name: material
    for material in (
        Material("plaster", 1.92 - 0.059j, height_deviation=0.15e-3, correlation_length=1.7e-3),
        _itu("concrete", 5.24, 0.0, 0.0462, 0.7822),
        _itu("brick", 3.91, 0.0, 0.0238, 0.16),
        _itu("plasterboard", 2.73, 0.0, 0.0085, 0.9395),
        _itu("wood", 1.99, 0.0, 0.0047, 1.0718),
        _itu("glass", 6.31, 0.0, 0.0036, 1.3394),
        _itu("marble", 7.074, 0.0, 0.0055, 0.9262),
        _itu("metal", 1.0, 0.0, 1e7, 0.0),
    )
}
