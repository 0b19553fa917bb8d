"""Fixtures shared by all tests."""

from pathlib import Path

import matplotlib as mpl
import pytest

mpl.use("Agg")

SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of independent captures and path tables, beside the project; tests that need it skip without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip("independent data (../shared/data) are not beside this clone")
    return SHARED_DATA
