"""Files appear whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from erm.common.atomic import atomic_path
from erm.common.errors import DataError


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_takes_its_place_when_it_is_whole(tmp_path):
    target = tmp_path / "new" / "x.txt"
    with atomic_path(target) as temporary:
        assert temporary.parent.parent == target.parent  # the same disk
        assert temporary.suffix == ".txt"
        temporary.write_text("whole")
        assert not target.exists()
    assert target.read_text() == "whole"
    assert names(target.parent) == ["x.txt"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_file_that_fails_leaves_the_old_one_and_nothing_else(tmp_path, error):
    target = tmp_path / "x.txt"
    target.write_text("old")

    def fail() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert target.read_text() == "old"
    assert names(tmp_path) == ["x.txt"]


def test_a_file_is_on_disk_before_it_has_its_name(tmp_path, monkeypatch):
    order = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (order.append("fsync"), fsync(fd))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (order.append("replace"), replace(a, b))[1])
    with atomic_path(tmp_path / "x") as temporary:
        temporary.write_text("x")
    assert order[:2] == ["fsync", "replace"]


def test_a_folder_that_cannot_be_is_told(tmp_path):
    (tmp_path / "file").write_text("in the way")
    told = pytest.raises(DataError, match="file: is a file; choose a folder to write into")
    with told, atomic_path(tmp_path / "file" / "x.txt"):
        pass
    told = pytest.raises(DataError, match=r"x\.txt: cannot be written \(.*\); choose a writable folder")
    with told, atomic_path(tmp_path / "file" / "folder" / "x.txt"):
        pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_told(tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        with pytest.raises(DataError, match="cannot be written"), atomic_path(tmp_path / "x"):
            pass
    finally:
        tmp_path.chmod(stat.S_IRWXU)


def test_what_a_killed_process_left_of_a_file_is_removed_and_nothing_else(tmp_path):
    for kept in (".x.txt.part", ".x.txt.0.part.txt", ".y.txt.0.part", "x.txt.0.part"):
        (tmp_path / kept).mkdir()
    left = tmp_path / ".x.txt.89abcdef.part"
    left.mkdir()
    (left / "x.txt").write_text("half")
    (left / "x.txt-journal").write_text("of a library")
    with atomic_path(tmp_path / "x.txt") as temporary:
        temporary.write_text("whole")
    assert names(tmp_path) == [".x.txt.0.part.txt", ".x.txt.part", ".y.txt.0.part", "x.txt", "x.txt.0.part"]


def test_what_another_is_writing_is_not_removed(tmp_path):
    target = tmp_path / "x.txt"
    with atomic_path(target) as slow:
        slow.write_text("slow")
        with atomic_path(target) as quick:
            quick.write_text("quick")
        assert target.read_text() == "quick"
        assert slow.read_text() == "slow"
    assert target.read_text() == "slow"
    assert names(tmp_path) == ["x.txt"]


def test_a_hidden_folder_that_is_taken_for_a_leftover_is_made_again(tmp_path, monkeypatch):
    made, mkdir = [], Path.mkdir

    def cleared_at_once(folder: Path, *arguments, **options) -> None:
        mkdir(folder, *arguments, **options)
        if folder.name.endswith(".part") and len(made) < 2:
            made.append(folder)
            folder.rmdir()

    monkeypatch.setattr(Path, "mkdir", cleared_at_once)
    with atomic_path(tmp_path / "x") as temporary:
        temporary.write_text("x")
    assert len(made) == 2
    assert names(tmp_path) == ["x"]
