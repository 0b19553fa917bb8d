"""Files that come with the package: the sounder description, the synthetic calibration and the demo's scene."""

from pathlib import Path

INSTALLED = Path(__file__).parent / "shipped_files"
CHECKOUT = Path(__file__).parents[2]


def calibration(name: str = "") -> Path:
    """Path of a file of the shipped ``calibration`` folder, or of the folder."""
    return _folder("calibration", CHECKOUT / "calibration") / name


def scene(name: str) -> Path:
    """Path of a shipped scene."""
    return _folder("scenes", CHECKOUT / "examples" / "scenes") / name


def _folder(name: str, in_checkout: Path) -> Path:
    installed = INSTALLED / name
    return installed if installed.is_dir() else in_checkout
