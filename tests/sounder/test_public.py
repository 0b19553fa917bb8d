"""What `import sounder` offers: every stage by one name, and nothing is imported before it is used."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import sounder


@pytest.mark.parametrize("name", sounder._MODULES)
def test_each_public_name_is_that_of_what_it_names(name):
    assert getattr(sounder, name).__name__ == name
    assert name in dir(sounder)


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(sounder.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.name: node.module for node in block.body for alias in node.names}
    assert seen == sounder._MODULES
    assert sorted([*seen, "__version__"]) == sounder.__all__


def test_a_name_that_does_not_exist_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'sounder' has no attribute 'processes'"):
        sounder.processes  # noqa: B018


def test_import_sounder_imports_nothing_heavy():
    program = "import sounder, sys; print([m for m in ('numpy', 'xarray', 'h5py', 'pydantic') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
