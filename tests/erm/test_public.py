"""One import offers everything, and costs nothing until it is used."""

import subprocess
import sys
from importlib import import_module

import pytest

import erm

HEAVY = ("numpy", "scipy", "xarray", "matplotlib", "shapely", "h5py", "typer", "pydantic", "numba")


def test_import_loads_nothing_heavy():
    program = f"import sys, erm; dir(erm); print([name for name in {HEAVY} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert loaded.strip() == "[]"


@pytest.mark.parametrize("name", [name for name in erm.__all__ if name != "__version__"])
def test_a_public_name_is_the_object_of_its_module(name):
    value = getattr(erm, name)
    assert value.__name__ == name
    assert value is getattr(import_module(value.__module__), name)
    assert name in dir(erm)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'erm' has no attribute 'recontsruct'"):
        erm.recontsruct  # noqa: B018


def test_errors_are_value_errors():
    # whoever catches ValueError, as Python's own readers raise it, catches these too
    assert issubclass(erm.OptionError, erm.DataError)
    assert issubclass(erm.DataError, ValueError)
