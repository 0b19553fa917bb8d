"""Watching a campaign: whole recordings only, one line for each, stopped and started again at will."""

import shutil
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

from sounder.campaign.watch import watch_campaign
from sounder.processing.position import process_position
from sounder.twin.scene import load_scene
from sounder.twin.simulate import simulate

from ..cli.commands import SCENE, SOUNDER

TEXT = """
[recordings]
files = ["raw/*.h5"]
calibration = "back-to-back.h5"
[map]
min_support = 2
[figures]
positions = "none"
"""


class StoppedError(Exception):
    """In place of Ctrl-C."""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("simulated")
    (folder / "sounder.toml").write_text(SOUNDER, encoding="utf-8")
    third = '[[receivers]]\nname = "RX3"\ntx = "TX"\nposition = [13, 5, 1.5]\n[[environment.walls]]'
    (folder / "scene.toml").write_text(SCENE.replace("[[environment.walls]]", third), encoding="utf-8")
    simulate(load_scene(folder / "scene.toml"), folder)
    return folder


def watched(
    folder: Path, *events: Callable[[], object], tell: Callable[[str], object] = lambda line: None
) -> list[list[str]]:
    """Lines that are told after each event; the watch is stopped after the last."""
    told: list[list[str]] = [[]]
    coming = iter(events)

    def wait(_: float) -> None:
        event = next(coming, None)
        if event is None:
            raise StoppedError
        told.append([])
        event()

    def note(line: str) -> None:
        told[-1].append(line)
        tell(line)

    with pytest.raises(StoppedError):
        watch_campaign(folder / "street.toml", wait=wait, tell=note)
    return told


def nothing() -> None:
    """Only time passes."""


@pytest.mark.slow
def test_recordings_are_processed_when_they_are_whole_and_told_in_one_line(simulated, tmp_path, monkeypatch):
    raw, out = tmp_path / "raw", tmp_path / "street"
    raw.mkdir()
    (tmp_path / "street.toml").write_text(TEXT, encoding="utf-8")
    first, second = (simulated / "raw" / name for name in ("RX1.h5", "RX2.h5"))
    half = second.read_bytes()[: second.stat().st_size // 2]
    told = watched(
        tmp_path,
        lambda: shutil.copy(first, raw),
        nothing,  # whole, but there is no back-to-back
        lambda: (raw / "RX2.h5").write_bytes(half),  # a copy that stops half-way: still, but not readable
        lambda: shutil.copy(simulated / "back-to-back.h5", tmp_path),
        nothing,
        nothing,  # nothing has changed
    )
    assert told[0] == [f"{tmp_path / 'street.toml'}: watching; Ctrl-C ends it"]
    assert told[1] == told[3] == told[6] == []
    assert not any("MPCs" in line for line in told[2] + told[4])
    worth, campaign, *others = told[5]
    assert worth.startswith("RX1: ")
    assert "SNR" in worth
    assert "against geometry" in worth
    assert campaign.startswith("1 position; ")
    assert [line for line in told[4] + others if "RX2.h5" in line]
    made = (out / "products" / "RX1.h5").stat().st_mtime_ns

    # two at once: the second is not processed before the first was told
    first_told = Event()

    def in_turn(job, *others, **options):
        assert job.recording.name != "RX3" or first_told.wait(60)
        return process_position(job, *others, **options)

    monkeypatch.setattr("sounder.processing.pipeline.process_position", in_turn)
    for recording in (second, simulated / "raw" / "RX3.h5"):
        shutil.copy(recording, raw)
    told = watched(tmp_path, nothing, tell=lambda line: line.startswith("RX2: ") and first_told.set())
    assert [line.partition(" ")[0] for line in told[1][:3]] == ["RX2:", "RX3:", "3"]  # RX1 was kept
    assert '"RX2"' in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "products" / "RX1.h5").stat().st_mtime_ns == made
