"""A foreign file and its layout, written and opened."""

from pathlib import Path
from typing import Any

import h5py
import pytest

from sounder.recordings import foreign
from sounder.recordings.layout import load_layout

from .captures import AZIMUTH, ELEVATION, WAVEFORM


@pytest.fixture(scope="module")
def sounder(description):
    return description(waveform=WAVEFORM, scan={"azimuth": AZIMUTH, "elevation": ELEVATION})


@pytest.fixture
def opened(tmp_path: Path, sounder):
    """Write a file and its layout; returns the recordings and the back-to-back."""

    def open_(content: dict[str, Any] | Path, layout: str, attributes: dict[str, Any] | None = None):
        path = tmp_path / "foreign.h5"
        if isinstance(content, Path):
            path = content
        else:
            with h5py.File(path, "w") as file:
                for name, data in content.items():
                    file[name] = data
                for name, value in (attributes or {}).items():
                    of, _, key = name.rpartition("@")
                    (file[of] if of else file).attrs[key] = value
        (tmp_path / "layout.toml").write_text(layout, encoding="utf-8")
        plan = load_layout(tmp_path / "layout.toml")
        return foreign.recordings(path, plan, sounder), foreign.back_to_back(path, plan, sounder)

    return open_
