"""Scripts that start processes are told to guard their call."""

import runpy

import pytest

from erm.common.errors import DataError

SCRIPT = """from sounder.processing.main_guard import require_main_guard

def work():
    require_main_guard()

{guard}
    work()
"""


@pytest.mark.parametrize("guard", ['if __name__ == "__main__":', "if '__main__' == __name__ and True:"])
def test_a_call_below_the_guard_passes(guard, tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT.format(guard=guard))
    runpy.run_path(str(tmp_path / "script.py"), run_name="__main__")


def test_a_call_without_it_is_refused_in_one_line(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT.format(guard="if True:"))
    with pytest.raises(DataError, match=r"script\.py:7: workers are .* below `if __name__ == \"__main__\":`$"):
        runpy.run_path(str(tmp_path / "script.py"), run_name="__main__")
