"""A plain installation holds everything that is needed away from the checkout."""

import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Content of the wheel, where ``pip install .`` would put it."""
    pytest.importorskip("hatchling", reason="the build backend is not installed")
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=PROJECT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


@pytest.fixture
def elsewhere(installed, tmp_path):
    """Run Python in another folder with the installation before the checkout; returns what it prints."""

    def run(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=tmp_path,
            env={"PYTHONPATH": str(installed), "PATH": "", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.mark.slow
def test_shipped_files_are_found_in_the_installation(installed, elsewhere):
    # all that is asked for is printed as a path below the installation, not below the checkout
    program = (
        "from sounder import shipped\n"
        "for name in ('sounder-132ghz.toml', 'back-to-back-132ghz.h5', 'horn-132ghz.csv', 'attenuator-60db.s2p'):\n"
        "    print(shipped.calibration(name))\n"
        "print(shipped.scene('uma.toml'))\n"
    )
    found = [Path(line) for line in elsewhere("-c", program).splitlines()]
    assert len(found) == 5
    for path in found:
        assert path.is_file()
        assert path.is_relative_to(installed)


@pytest.mark.slow
def test_shipped_description_and_scene_are_read_from_the_installation(elsewhere):
    # reading follows the names inside: the scene's sounder, the sounder's antenna cut
    program = (
        "from sounder import shipped\n"
        "from sounder.twin.scene import load_scene\n"
        "for name in ('uma.toml', 'lroom.toml'):\n"
        "    print(load_scene(shipped.scene(name)).sounder.carrier.frequency)\n"
    )
    assert [float(line) for line in elsewhere("-c", program).split()] == [132e9, 300e9]


@pytest.mark.slow
def test_the_letters_study_finds_the_twin_of_the_installation(elsewhere):
    program = (
        "from importlib.metadata import distribution\n"
        "points = distribution('sounder-to-map').entry_points.select(group='erm.captures')\n"
        "print([point.load().__name__ for point in points])\n"
    )
    assert elsewhere("-c", program).strip() == "['sounder.campaign.study']"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sounder", "erm"])
def test_command_line_starts_from_the_installation(elsewhere, name):
    # through the entry point, as the script that pip writes does
    program = (
        "import sys\n"
        "from importlib.metadata import distribution\n"
        f"sys.argv = ['{name}', '--help']\n"
        "points = distribution('sounder-to-map').entry_points.select(group='console_scripts')\n"
        f"points['{name}'].load()()\n"
    )
    assert f"Usage: {name} " in elsewhere("-c", program)


@pytest.mark.slow
def test_geometry_is_imported_without_the_sounder(elsewhere):
    program = (
        "import pkgutil, sys\n"
        "import erm\n"
        "for module in pkgutil.walk_packages(erm.__path__, 'erm.'):\n"
        "    __import__(module.name)\n"
        "    print(module.name)\n"
        "assert 'sounder' not in sys.modules\n"
    )
    assert "erm.reconstruction.reconstruct" in elsewhere("-c", program).split()


def test_wheel_tells_its_licence_and_that_it_is_typed(installed):
    (info,) = installed.glob("*.dist-info")
    metadata = Parser().parsestr((info / "METADATA").read_text(encoding="utf-8"))
    assert metadata["License-Expression"] == "BSD-3-Clause"
    assert (info / "licenses" / "LICENSE").is_file()
    assert (installed / "sounder" / "py.typed").is_file()
    assert (installed / "erm" / "py.typed").is_file()
