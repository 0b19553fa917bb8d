"""Materials of surfaces: complex permittivity as a function of frequency, and roughness.

The power laws of `LIBRARY` are those of Table 3 of ITU-R P.2040, rows for 110-330 GHz (glass: 100-400 GHz). Metal and
asphalt have rows up to 100 and 40 GHz only and are extrapolated. For metal this is harmless: its reflection is 1
within 0.2 % at these frequencies. For asphalt it is a guess.

Plaster is that of the letter. It prints "correlation length 0.15, height standard deviation 1.7" without units. At 300
GHz the wavelength is 1.0 mm and the specular amplitude falls by ``exp(-(4 pi sigma_h cos(theta) / lambda)**2 / 2)``.
With ``sigma_h`` = 1.7 mm that is exp(-228), -1982 dB at normal incidence and -60 dB at 80 degrees: no reflection would
be measurable. With ``sigma_h`` = 0.15 mm it is exp(-1.78), -15.4 dB at normal incidence and -3.9 dB at 60 degrees, and
a correlation length of 1.7 mm gives slopes near sqrt(2) 0.15 / 1.7 = 0.12, which a trowel can leave. So the two values
are taken as swapped and in mm: height deviation 0.15 mm, correlation length 1.7 mm (compare the indoor surfaces of
Jansen et al., "Diffuse scattering from rough surfaces in THz communication channels", IEEE Trans. THz Sci. Technol. 1
(2011) 462-472). Its index 1.92 - j0.059 is eps = 3.683 - j0.2266, 3.78 S/m at 300 GHz; the index is used as it stands
at other frequencies.
"""

from cmath import isfinite as cisfinite
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite, nan, pi
from typing import Any

from scipy.constants import epsilon_0

from erm.common.errors import DataError
from erm.common.usage import shortened


@dataclass(frozen=True)
class Material:
    """Electrical and surface properties of a reflector.

    They are given either as a constant ``refractive_index`` ``n = n' - j n''`` (time convention ``exp(+j 2 pi f t)``:
    a lossy material has a negative imaginary part), or by the power laws of ITU-R P.2040 in GHz::

        eps_r(f) = permittivity[0] * f**permittivity[1]
        sigma(f) = conductivity[0] * f**conductivity[1]     [S/m]
        eps(f)   = eps_r - j sigma / (2 pi f eps_0)         n(f) = sqrt(eps(f))

    Parameters
    ----------
    name : str
        Name by which environments refer to the material.
    refractive_index : complex, optional
        ``n' - j n''``. If given, the power laws are not used.
    permittivity, conductivity : tuple of float
        ``(a, b)`` and ``(c, d)`` of the power laws.
    height_deviation : float
        Standard deviation of the surface height [m]; 0 is smooth.
    correlation_length : float
        Correlation length of the surface height [m]; NaN if unknown. The specular path does not depend on it.

    Raises
    ------
    DataError
        A property is out of range.

    Examples
    --------
    >>> import erm
    >>> board = erm.Material("board", refractive_index=1.6 - 0.01j, height_deviation=1e-4)
    >>> board.relative_permittivity(132e9)
    (2.5599000000000003-0.032j)
    >>> wall = erm.Environment.walls([[[0, 0], [9, 0]]], material="board", materials={"board": board})
    """

    name: str
    refractive_index: complex | None = None
    permittivity: tuple[float, float] = (1.0, 0.0)
    conductivity: tuple[float, float] = (0.0, 0.0)
    height_deviation: float = 0.0
    correlation_length: float = nan

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise DataError(f"a material's name is {shortened(self.name)}; expected a text")
        n = self.refractive_index
        if n is not None and not (n.real > 0 and n.imag <= 0 and cisfinite(n * n)):
            raise DataError(
                f"material {self.name}: refractive index {n}; write it as n' - j n'', both finite, a loss is negative"
            )
        if n is None and not (self.permittivity[0] > 0 and self.conductivity[0] >= 0):
            raise DataError(f"material {self.name}: permittivity must be positive, conductivity not negative")
        if not (isfinite(self.height_deviation) and self.height_deviation >= 0):
            raise DataError(f"material {self.name}: height deviation {self.height_deviation} m; expected 0 or more")

    def relative_permittivity(self, frequency: float) -> complex:
        """Complex relative permittivity ``eps' - j eps''`` at a frequency [Hz]."""
        if self.refractive_index is not None:
            return self.refractive_index**2
        ghz = frequency / 1e9
        a, b = self.permittivity
        c, d = self.conductivity
        return complex(a * ghz**b, -c * ghz**d / (2 * pi * frequency * epsilon_0))

    def to_dict(self) -> dict[str, Any]:
        """Properties as plain numbers for JSON; unknown ones are left out."""
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
        """Make a material from the result of `to_dict`; an unknown or malformed property is a `DataError`."""
        named: dict[str, Any] = dict(values)
        try:
            for pair in ("permittivity", "conductivity"):
                if pair in named:
                    first, second = named[pair]
                    named[pair] = (float(first), float(second))
            if "refractive_index" in named:
                named["refractive_index"] = complex(*named["refractive_index"])
            return cls(**named)
        except DataError:
            raise
        except (TypeError, ValueError) as error:
            raise DataError(f"material {named.get('name', '?')}: {error}") from error


def _itu(name: str, a: float, c: float, d: float) -> Material:
    return Material(name, permittivity=(a, 0.0), conductivity=(c, d))


LIBRARY: Mapping[str, Material] = {
    material.name: material
    for material in (
        Material("plaster", 1.92 - 0.059j, height_deviation=0.15e-3, correlation_length=1.7e-3),
        _itu("concrete", 5.17, 0.0145, 1.09),
        _itu("brick", 4.15, 0.0006, 1.5712),
        _itu("plasterboard", 2.56, 0.0001, 1.7799),
        _itu("wood", 1.82, 0.004, 1.0761),
        _itu("marble", 7.94, 0.0001, 1.733),
        _itu("glass", 6.5767, 0.0012, 1.4697),
        _itu("asphalt", 4.83, 0.0108, 1.3969),
        _itu("metal", 1.0, 1e7, 0.0),
    )
}
