"""Transmission of an attenuator from a touchstone file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from erm.common.errors import DataError
from erm.common.gate.limits import MAX_TEXT
from erm.common.text_files import read_text

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def read_s21(path: Path | str, *, band: tuple[float, float] | None = None) -> tuple[Real, Complex]:
    """Frequency and transmission from port 1 to port 2 of a two-port touchstone file.

    Parameters
    ----------
    path : path
        A ``.s2p`` file.
    band : tuple of float, optional
        Lowest and highest frequency that must be covered [Hz].

    Returns
    -------
    frequency, s21 : array (frequency,), (frequency,)
        [Hz] and complex [1].

    Raises
    ------
    DataError
        The file is missing, is not a two-port touchstone file, or does not cover the band.

    Examples
    --------
    >>> from sounder import shipped
    >>> frequency, s21 = read_s21(shipped.calibration("attenuator-60db.s2p"), band=(131.4e9, 132.6e9))
    >>> frequency.size, s21.dtype.name
    (501, 'complex128')
    """
    # Imported here because it takes a second and few commands read touchstone. Not skrf.Network: it would try to
    # unpickle the file first.
    from skrf.io.touchstone import Touchstone

    path = Path(path)
    read_text(path, "a touchstone file (.s2p)", limit=MAX_TEXT)
    if path.suffix.lower() != ".s2p":
        raise DataError(f"{path}: not a two-port touchstone file; expected the suffix .s2p")
    try:
        frequency, parameters = Touchstone(str(path)).get_sparameter_arrays()
        s21 = parameters[:, 1, 0]
    except Exception as error:  # the parser raises errors of many types for damaged files
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DataError(f"{path}: not readable as touchstone ({reason}); expected a two-port .s2p file") from None
    if frequency.size < 2 or not np.isfinite(s21).all() or not np.all(np.diff(frequency) > 0) or not s21.all():
        raise DataError(f"{path}: expected two or more frequencies in ascending order, with finite S21 other than 0")
    if band and not (frequency[0] <= band[0] and frequency[-1] >= band[1]):
        raise DataError(
            f"{path}: covers {frequency[0] / 1e9:.3f} to {frequency[-1] / 1e9:.3f} GHz; expected at least "
            f"{band[0] / 1e9:.3f} to {band[1] / 1e9:.3f} GHz; measure the attenuator over the whole band"
        )
    return frequency, s21


def transmission(frequency: Real, s21: Complex, wanted: Real) -> Complex:
    """Interpolate S21: magnitude in dB and unwrapped phase, each linear between the measured points.

    Outside the measured span the end values hold. The real and the imaginary part are not interpolated by themselves,
    because the magnitude of a device with delay would come out too small between points.

    Parameters
    ----------
    frequency, s21 : array (frequency,)
        [Hz] in ascending order, and complex.
    wanted : array (...)
        [Hz]

    Returns
    -------
    array complex (...)
    """
    gain = np.interp(wanted, frequency, 20 * np.log10(np.abs(s21)))
    phase = np.interp(wanted, frequency, np.unwrap(np.angle(s21)))
    result: Complex = 10 ** (gain / 20) * np.exp(1j * phase)
    return result
