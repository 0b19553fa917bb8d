"""Fixtures shared by all tests."""

from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")

SLOW_EXAMPLES = (
    "src/sounder/__init__.py",
    "src/sounder/campaign/run.py",
    "src/sounder/processing/channel_parameters.py",
    "src/sounder/products/engine.py",
    "src/erm/reconstruction/make_map.py",
)
"""Files whose docstrings have examples that process captures."""
SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of independent captures and path tables, beside the project; tests that need it skip without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip("independent data (../shared/data) are not beside this clone")
    return SHARED_DATA


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark examples of docstrings that take more than half a second."""
    for item in items:
        if item.nodeid.startswith(SLOW_EXAMPLES):
            item.add_marker(pytest.mark.slow)
