"""Text and tables as ordinary programs write them."""

import pytest

from erm.common.errors import DataError
from erm.common.text_files import read_table, read_text


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_text_is_read_in_its_encoding(tmp_path, encoding):
    path = tmp_path / "place.txt"
    path.write_bytes("Straße 7 °".encode(encoding))
    assert read_text(path, "text") == "Straße 7 °"


@pytest.mark.parametrize("content", [b"\x89HDF\r\n\x1a\n\0\0", b"Stra\xdfe \x81", b"\xff\xfe\x00\xd8"])
def test_bytes_that_are_no_text_are_refused(tmp_path, content):
    path = tmp_path / "place.txt"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"place.txt: not text .*expected a list"):
        read_text(path, "a list")


@pytest.mark.parametrize(
    "text",
    [
        'name,Delay,gain\n"a, b",1.5e-7,-110.25\n',
        'name;Delay;gain\n"a, b";1,5E-7;-110,25\n',
        "Name;delay;gain\na, b;1.5e-7;-110.25\n",
        "name\tdelay\tgain\r\na, b\t1,5e-7\t-110,25\r\n",
        'sep=;\nname;delay;gain\n"a, b";1,5e-7;-110,25\n',
        'sep=,\nname,delay,gain\n"a, b",1.5e-7,-110.25\n',
        '# made by hand\n\nname, delay, gain\n\n"a, b", 1.5e-7, -110.25\n\n',
    ],
)
def test_separators_and_decimal_commas_do_not_change_a_table(tmp_path, text):
    path = tmp_path / "table.csv"
    path.write_bytes(text.encode())
    table = read_table(path, "a table")
    assert table.header == ["name", "delay", "gain"]
    assert table.column("name") == ["a, b"]
    assert [float(cell) for cell in (*table.column("delay"), *table.column("gain"))] == [1.5e-7, -110.25]
    assert table.column("azimuth") == [""]
    assert text.splitlines()[table.lines[0] - 1].startswith(("a, b", '"a, b"'))


def test_a_number_of_thousands_is_not_guessed(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("x;y\n1.234,5;2\n")
    assert read_table(path, "a table").rows == [["1.234,5", "2"]]


def test_a_table_without_lines_is_refused(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("# nothing\n\n")
    with pytest.raises(DataError, match=r"table.csv: empty; expected a table"):
        read_table(path, "a table")
