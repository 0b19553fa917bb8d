"""Libraries that a plain installation goes without."""

from importlib import import_module
from types import ModuleType

from erm.common.errors import DataError


def require(module: str, extra: str, purpose: str, otherwise: str) -> ModuleType:
    """Import a module of an optional library, or say which extra of this package brings it.

    Raises
    ------
    DataError
        It is not installed; ``purpose`` opens the message and ``otherwise`` closes it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise DataError(
            f"{purpose} needs {module.partition('.')[0]}, which is not installed; "
            f"pip install 'sounder-to-map[{extra}]', or {otherwise}"
        ) from error
