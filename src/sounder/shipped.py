"""Files that come with the package: a sounder description, its synthetic calibration, a recording, and scenes."""

from pathlib import Path

INSTALLED = Path(__file__).parent / "shipped_files"
CHECKOUT = Path(__file__).parents[2]


def calibration(name: str = "") -> Path:
    """Path of a file in the shipped folder ``calibration``, or of the folder.

    Examples
    --------
    >>> calibration("sounder-132ghz.toml").is_file()
    True
    """
    return _folder("calibration", CHECKOUT / "calibration") / name


def scene(name: str) -> Path:
    """Path of a shipped scene.

    Examples
    --------
    >>> scene("uma.toml").name
    'uma.toml'
    """
    return _folder("scenes", CHECKOUT / "examples" / "scenes") / name


def _folder(name: str, in_checkout: Path) -> Path:
    installed = INSTALLED / name
    return installed if installed.is_dir() else in_checkout
