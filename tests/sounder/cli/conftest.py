"""The small scene simulated, processed, copied, and in one foreign file."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from .commands import LAYOUT, SCENE, SOUNDER, run


@pytest.fixture(scope="session")
def campaign(tmp_path_factory) -> Path:
    """Folder with a simulated scene: ``raw/RX1.h5``, ``raw/RX2.h5``, ``back-to-back.h5`` and ``truth``."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "sounder.toml").write_text(SOUNDER, encoding="utf-8")
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    assert run("simulate", folder / "scene.toml", "--out", folder) == 0
    return folder


@pytest.fixture(scope="session")
def products(campaign: Path) -> Path:
    raw = campaign / "raw"
    arguments = ("process", raw / "RX1.h5", raw / "RX2.h5", "--calibration", campaign / "back-to-back.h5")
    assert run(*arguments, "--keep-cir", "--out", campaign / "products") == 0
    return campaign / "products"


@pytest.fixture
def copied(campaign: Path, tmp_path: Path) -> Path:
    """Copy of the recordings that a test may spoil."""
    for name in ("raw/RX1.h5", "raw/RX2.h5", "back-to-back.h5"):
        shutil.copy(campaign / name, tmp_path)
    return tmp_path


@pytest.fixture
def joined(campaign: Path, tmp_path: Path) -> Path:
    """Both positions and the back-to-back in one foreign file, its layout beside it."""
    (tmp_path / "layout.toml").write_text(LAYOUT, encoding="utf-8")
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        parts = [h5py.File(campaign / "raw" / f"RX{i}.h5") for i in (1, 2)]
        for name in ("iq", "agc_gain"):
            file[name] = np.stack([part[name][()] for part in parts])
        for name in ("tx_position", "rx_position"):
            file[name] = np.concatenate([part[name][()] for part in parts])
        for name in ("azimuth", "elevation"):
            file[name] = parts[0][name][()]
        file["iq"].attrs["scale_factor"] = parts[0]["iq"].attrs["scale_factor"]
        with h5py.File(campaign / "back-to-back.h5") as b2b:
            file["b2b"] = b2b["iq"][()]
            file["b2b"].attrs["scale_factor"] = b2b["iq"].attrs["scale_factor"]
        for part in parts:
            part.close()
    return tmp_path / "foreign.h5"
