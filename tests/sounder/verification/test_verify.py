"""The twin is verified: a clean one agrees with what is known, an error of known size is measured."""

import datetime
import json
from pathlib import Path

import numpy as np
import pytest

from erm.common.constants import c
from sounder import load_sounder, shipped
from sounder.cli import app
from sounder.instrument.description import Sounder
from sounder.recordings.writer import write_back_to_back, write_recording
from sounder.twin.faults import Faults
from sounder.twin.receiver import back_to_back, record
from sounder.verification.description import Artefact, Verification, load_verification
from sounder.verification.history import entries, read_history, with_today, write_history
from sounder.verification.links import expected_link
from sounder.verification.page import draw_page
from sounder.verification.verify import Figure, Verified, verify

pytestmark = pytest.mark.slow

FULL = load_sounder(shipped.calibration("sounder-132ghz.toml"))
SOUNDER: Sounder = FULL.model_copy(
    update={"scan": FULL.scan.model_copy(update={"azimuth": (0.0, 10.0, 20.0), "elevation": (-9.0, 0.0, 9.0)})}
)
LINEAR = Faults(iq_imbalance=False, converter={"bits": 16, "full_scale": -30.0})
"""Without the image of the mixers, which changes the gain with the phase of the carrier by 0.1 dB."""


def connected(path: Path, attenuator, seed: int) -> Path:
    write_back_to_back(back_to_back(SOUNDER, attenuator, faults=LINEAR, seed=seed), path, history="test")
    return path


def cable(folder: Path, delay: float, gain: float) -> Path:
    """Touchstone file of a cable with a tilt of 2 dB."""
    frequency = np.linspace(131e9, 133e9, 101)
    s21 = 10 ** ((gain + (frequency - 132e9) / 1e9) / 20) * np.exp(-2j * np.pi * frequency * delay)
    rows = [f"{f} 0 0 {s.real} {s.imag} {s.real} {s.imag} 0 0" for f, s in zip(frequency, s21, strict=True)]
    (folder / "cable.s2p").write_text("\n".join(["# Hz S RI R 50", *rows]) + "\n")
    return folder / "cable.s2p"


def figure(verified: Verified, artefact: str, quantity: str) -> Figure:
    [found] = [one for one in verified.figures if (one.artefact, one.quantity) == (artefact, quantity)]
    return found


def verification(folder: Path, *artefacts: Artefact, seed: int = 0) -> Verification:
    return Verification(
        name="twin",
        date=datetime.date(2026, 3, 1),
        calibration=connected(folder / "calibration.h5", 60.0, seed),
        artefacts=artefacts,
    )


def test_connected_devices_agree_and_the_receiver_is_linear(tmp_path: Path) -> None:
    devices = [
        Artefact(
            name=f"{loss:g} dB",
            kind="connected",
            recordings=(connected(tmp_path / f"{loss:g}.h5", loss, 10 + k),),
            attenuation=loss,
            delay=0.0,
        )
        for k, loss in enumerate((50.0, 70.0, 85.0))
    ]
    verified = verify(verification(tmp_path, *devices))
    for device in devices:
        for quantity, least in (("gain", 1e-3), ("delay", 1e-14)):
            found = figure(verified, device.name, quantity)
            assert abs(found.error) < 3.5 * found.std, found
            assert found.std > least  # noise is there
    slope = figure(verified, "connected devices", "linearity")
    assert abs(slope.error) < 3.5 * slope.std < 0.02
    # 35 dB less signal, 35 dB less range; the strongest sample of noise varies by a few decibels
    strong, weak = (figure(verified, f"{loss} dB", "dynamic range").measured for loss in (50, 85))
    assert strong - weak == pytest.approx(35, abs=5)


def test_errors_of_known_size_are_measured(tmp_path: Path) -> None:
    """The cable is 0.4 dB and 5 ps other than its S21 says."""
    said = cable(tmp_path, 21.3e-9, -55.0)
    frequency = np.linspace(131e9, 133e9, 101)
    tilted = 10 ** ((-54.6 + (frequency - 132e9) / 1e9) / 20)
    true = tilted * np.exp(-2j * np.pi * frequency * 21.305e-9)
    recordings = tuple(connected(tmp_path / f"cable{k}.h5", (frequency, true), 20 + k) for k in range(3))
    artefact = Artefact(name="cable", kind="connected", recordings=recordings, s21=said, gain_std=0.05, delay_std=1e-12)
    verified = verify(verification(tmp_path, artefact))
    gain, delay = figure(verified, "cable", "gain"), figure(verified, "cable", "delay")
    assert gain.error == pytest.approx(0.4, abs=0.03)
    assert delay.error == pytest.approx(5e-12, abs=0.5e-12)
    assert delay.expected == pytest.approx(21.3e-9, abs=1e-12)
    assert {one.quantity for one in verified.disagreeing} >= {"gain", "delay"}
    assert figure(verified, "cable", "repeatability of gain").measured < 0.02


def test_a_link_of_known_length(tmp_path: Path) -> None:
    import xarray as xr

    distance = 30.0
    link = Artefact(name="yard", kind="link", recordings=(tmp_path / "yard.h5",), distance=distance, gain_std=0.2)
    delay, gain = expected_link(link, 132e9)
    assert delay == pytest.approx(distance / c)
    for off in (0.0, 3.0):
        path = {"coefficient": 10 ** ((gain + off) / 20), "delay": delay, "azimuth": 8.0, "elevation": 1.0}
        paths = xr.Dataset({key: ("path", [value]) for key, value in path.items()})
        ends = {"tx_position": (distance, 0, 2), "rx_position": (0, 0, 2)}
        made = record(paths, SOUNDER, name="A", snapshots=2, faults=LINEAR, seed=3, **ends)
        write_recording(made, tmp_path / "yard.h5", history="test")
        verified = verify(verification(tmp_path, link))
        assert figure(verified, "yard", "gain").error == pytest.approx(off, abs=0.3)
        assert abs(figure(verified, "yard", "delay").error) < 20e-12
        assert (figure(verified, "yard", "gain") in verified.disagreeing) == (off > 0)


def test_a_corner_reflector_of_known_size() -> None:
    """Radar equation with a cross section of 4 pi a^4 / (3 lambda^2)."""
    corner = Artefact(name="corner", kind="reflector", recordings=(Path("a.h5"),), distance=20.0, side=0.1)
    delay, gain = expected_link(corner, 132e9)
    wavelength = c / 132e9
    section = 4 * np.pi * 0.1**4 / (3 * wavelength**2)  # 81.2 m2
    assert section == pytest.approx(81.2, abs=0.1)
    assert delay == pytest.approx(40 / c)
    assert 10 ** (gain / 10) == pytest.approx(section * wavelength**2 / ((4 * np.pi) ** 3 * 20.0**4))


def test_history_holds_a_row_a_day_and_figure(tmp_path: Path) -> None:
    described = Verification(
        name="x",
        date=datetime.date(2026, 3, 1),
        calibration=Path("c.h5"),
        artefacts=(Artefact(name="a", kind="connected", recordings=(Path("a.h5"),), attenuation=50.0),),
    )
    figures = (Figure("a", "gain", -50.0, -49.9, 0.06), Figure("a", "dynamic range", np.nan, 61.0, np.nan))
    verified = Verified(described, figures, "twin", np.zeros((1, 3)))
    today = entries(verified)
    assert [entry.error for entry in today] == [pytest.approx(0.1), 61.0]
    earlier = [one._replace(date="2026-02-01") for one in today]
    history = with_today(with_today([], earlier), today)
    write_history(history, tmp_path / "h.csv")
    back = read_history(tmp_path / "h.csv")
    assert [entry.date for entry in back] == ["2026-02-01", "2026-02-01", "2026-03-01", "2026-03-01"]
    assert len(with_today(back, today)) == 4
    page = draw_page(verified, back)
    assert len(page.axes) == 4


def test_the_command_writes_page_and_history_and_fails_on_disagreement(tmp_path: Path, capsys) -> None:
    from typer.testing import CliRunner

    connected(tmp_path / "calibration.h5", 60.0, 1)
    connected(tmp_path / "70.h5", 70.0, 2)
    text = """name = "twin"
date = 2026-03-01
calibration = "calibration.h5"
[[artefacts]]
name = "70 dB"
kind = "connected"
recordings = ["70.h5"]
attenuation = %s
gain_std = 0.1
"""
    file, page, history = tmp_path / "v.toml", tmp_path / "page.pdf", tmp_path / "history.csv"
    options = ["verify", str(file), "--out", str(page), "--history", str(history), "--json"]
    for attenuation, code in (("70.0", 0), ("71.0", 1)):
        file.write_text(text % attenuation)
        result = CliRunner().invoke(app, options)
        assert result.exit_code == code, result.output
    assert page.read_bytes().startswith(b"%PDF")
    assert len(read_history(history)) == 3  # gain, dynamic range, linearity; of one day
    assert load_verification(file).artefacts[0].recordings == (tmp_path / "70.h5",)
    assert json.loads(CliRunner().invoke(app, options).stdout)[0]["agrees"] is False
