"""Whether a file is whole: every member that it should have, with checksums that hold."""

from pathlib import Path

from erm.common.errors import DataError
from erm.common.gate.hdf5 import open_hdf5
from erm.common.integrity import GOOD, check_members


def check_file(path: Path) -> tuple[list[tuple[str, str]], list[str]]:
    """Read a file completely.

    Returns
    -------
    lines : list of (str, str)
        Each member with its state.
    failures : list of str
        One line for each member that is damaged or missing, or for the file if it cannot be opened.

    Examples
    --------
    >>> from sounder import shipped
    >>> lines, failures = check_file(shipped.calibration("back-to-back-132ghz.h5"))
    >>> [name for name, _ in lines], failures
    (['attenuator_frequency', 'attenuator_s21', 'iq'], [])
    """
    try:
        with open_hdf5(path) as file:
            lines = list(check_members(file))
    except DataError as error:
        return [], [str(error)]
    return lines, [f"{path}: {name}: {state}" for name, state in lines if state not in GOOD]
