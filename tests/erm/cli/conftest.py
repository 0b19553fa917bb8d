"""MPCs of one wall."""

from pathlib import Path

import numpy as np
import pytest
from scipy.constants import c

from erm.geometry.vertical import azimuth_of, mirrored
from erm.mpcs.files import write_mpcs
from erm.mpcs.table import make_table

TX = np.array([-40.0, 3.0, 12.0])
WALL = (90.0, -9.0)  # y = -9


@pytest.fixture
def mpcs(tmp_path: Path) -> Path:
    """Six positions along a street that see one wall."""
    rx = np.column_stack([np.linspace(-20, 30, 6), np.linspace(-2, 4, 6), np.full(6, 1.5)])
    tx = np.tile(TX, (6, 1))
    seen = mirrored(tx, *WALL) - rx[:, :2]
    length = np.hypot(np.linalg.norm(seen, axis=-1), TX[2] - 1.5)
    gain = 20 * np.log10(c / 132e9 / (4 * np.pi * length)) - 6
    table = make_table(
        {"position": np.array([f"RX{i}" for i in range(6)]), "tx_position": tx, "rx_position": rx}
        | {"frequency": 132e9, "delay": length / c, "azimuth": azimuth_of(seen), "path_gain": gain}
    )
    write_mpcs(table, tmp_path / "mpcs.csv")
    return tmp_path / "mpcs.csv"
