"""A page is whole or not there."""

from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from erm.common.atomic import atomic_path
from erm.common.errors import DataError
from erm.common.page import Page, cell


@pytest.mark.slow
def test_a_figure_is_written_as_vector_and_as_picture_and_shown_with_its_caption(tmp_path: Path):
    open_before = plt.get_fignums()
    page = Page(tmp_path, "page.md")
    page.add("# Title")
    page.table(["a", "b"], [["x", 0.12345], ["y", float("nan")], ["one|cell", 1]])
    page.figure("curve", plt.subplots()[1], "One curve.")
    text = page.write().read_text()
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {"curve.pdf", "curve.png"}
    assert "| x | 0.123 |\n| y | – |\n| one\\|cell | 1 |" in text
    assert "*Figure 1 ([PDF](figures/curve.pdf)).* One curve." in text
    assert plt.get_fignums() == open_before


@pytest.mark.slow
def test_the_same_figure_gives_the_same_bytes(tmp_path: Path):
    for name in ("one", "two"):
        axes = plt.subplots()[1]
        axes.plot([0, 1], [1, 0])
        Page(tmp_path / name, "page.md").figure("curve", axes, "One curve.")
    for suffix in ("pdf", "png"):
        first, second = ((tmp_path / name / "figures" / f"curve.{suffix}").read_bytes() for name in ("one", "two"))
        assert first == second
        assert b"CreationDate" not in first  # two in the same second would be the same


def test_no_page_stands_until_all_is_done(tmp_path: Path):
    (tmp_path / "page.md").write_text("of an earlier run")
    page = Page(tmp_path, "page.md")
    page.add("half")
    assert (tmp_path / "page.md").read_text() == "of an earlier run"  # its figures are still its own
    page.file("table.csv", "of this run")
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_a_page_that_was_not_drawn_leaves_no_folder(tmp_path: Path):
    Page(tmp_path / "letter", "page.md").add("half")
    with pytest.raises(KeyboardInterrupt), atomic_path(tmp_path / "letter" / "figures" / "one.png"):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="choose a writable folder"):
        Page(tmp_path / "file" / "folder", "page.md").file("table.csv", "")


def test_numbers_are_told_to_three_digits():
    assert [cell(x) for x in (1167.9, 0.0036, 1e-14, 0.0, 12, True, None)] == [
        "1168", "0.0036", "< 0.0001", "0", "12", "on", "–"
    ]  # fmt: skip
