"""What is no ordinary file, text that is nested too deeply, and databases that are no GeoPackage."""

import os
import sqlite3
import sys

import pytest

from erm.common.errors import DataError
from erm.common.gate.files import require_file
from erm.common.gate.geopackage import require_geopackage
from erm.common.gate.nesting import MAX_DEPTH, parse_json, parse_toml


@pytest.mark.skipif(sys.platform == "win32", reason="no such devices")
def test_devices_and_pipes_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", type(tmp_path)("/dev/zero")):
        with pytest.raises(DataError, match="is a device or a pipe; expected a file"):
            require_file(path)


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (parse_json, "[" * 100_000 + "]" * 100_000),
        (parse_toml, "x = " + "[" * 100_000),
        (parse_toml, "x = " + "[" * 90 + "]" * 90),
        (parse_toml, ".".join(["a"] * 10_000) + " = 1"),
    ],
)
def test_deep_text_is_refused(parse, text):
    with pytest.raises(ValueError, match=f"more than {MAX_DEPTH} levels"):
        parse(text)


def test_brackets_in_a_text_are_no_levels():
    text = '{"a": "' + "[" * 100 + r"\"" + '"}'
    assert parse_json(text) == {"a": "[" * 100 + '"'}


def test_a_file_for_another_driver_is_no_geopackage(tmp_path):
    path = tmp_path / "map.gpkg"
    path.write_text('<OGRVRTDataSource><OGRVRTLayer name="x"><SrcDataSource>/etc/hosts</SrcDataSource></OGRVRTLayer>')
    with pytest.raises(DataError, match=r"map\.gpkg: not a GeoPackage"):
        require_geopackage(path)
    path.unlink()
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA application_id = 1196444487")  # GPKG
        database.execute("CREATE VIEW reflectors AS SELECT 1")
    database.close()
    with pytest.raises(DataError, match="holds a view reflectors, which is not run"):
        require_geopackage(path)


def test_a_number_of_many_digits_is_refused_at_once():
    with pytest.raises(ValueError, match="Exceeds the limit"):
        parse_toml("x = " + "9" * 100_000)  # looking for dotted keys from each digit on would take a minute


def test_a_number_that_no_integer_holds_is_rounded():
    assert parse_json("[9007199254740993, 9223372036854775807]")[0] == 2**53 + 1
    assert parse_json(f"[{'9' * 30}, -{'9' * 400}]") == [1e30, float("-inf")]
