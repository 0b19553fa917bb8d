"""Libraries that are not part of a plain installation."""

from importlib import import_module
from types import ModuleType

from erm.common.errors import DataError


def require_library(module: str, extra: str, purpose: str, otherwise: str) -> ModuleType:
    """Import a module of an optional library.

    Parameters
    ----------
    module : str
        Name of the module.
    extra : str
        Extra of this package that installs it.
    purpose, otherwise : str
        First and last words of the error: what needs the library, and what to do without it.

    Raises
    ------
    DataError
        The library is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise DataError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed; "
            f"pip install 'sounder-to-map[{extra}]', or {otherwise}"
        ) from error
