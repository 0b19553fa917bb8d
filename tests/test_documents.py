"""The examples of the documents run: Python blocks, and command lines whose files exist.

They run in a copy of the project's data with the output of a small demo, one document after the other: Python in the
project's folder, commands in ``demo-output``. A block may be prepared by another that readers do not see, a comment
``<!-- invisible-code-block: python``; `Sybil <https://sybil.readthedocs.io>`_ finds both.
"""

import glob
import io
import re
import runpy
import shlex
import shutil
import sys
from contextlib import chdir, redirect_stderr
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from sybil import Example, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser

import erm.cli
import sounder.cli

PROJECT = Path(__file__).parents[1]
DOCUMENTS = ["README.md", "CONTRIBUTING.md", "calibration/README.md"]
DOCUMENTS += sorted(f"docs/{path.relative_to(PROJECT / 'docs')}" for path in (PROJECT / "docs").rglob("*.md"))
RECEIVERS = {"RX2_L", "RX5_L", "RX7_L", "RX9_L"}  # of the demo: those that the documents name
READ = (".h5", ".csv", ".toml", ".geojson")
WRITTEN = (
    "--out",
    "--rps",
    "--figure",
    "--statistics",
    "--point-data",
    "--mpcs",
)  # what follows these is made by the command
STUDY = "erm letter"  # ten minutes; `tests/sounder/campaign/test_letter_study.py` runs all parts of it


def run(line: str, folder: Path) -> tuple[int, str]:
    """Run a command line as a shell would, in this process; return its exit code and what it says on stderr."""
    command, *words = shlex.split(line, comments=True)
    with chdir(folder), redirect_stderr(io.StringIO()) as errors, pytest.MonkeyPatch.context() as patch:
        arguments = [name for word in words for name in sorted(glob.glob(word)) or [word]]
        patch.setattr(sys, "argv", [command, *arguments])
        with pytest.raises(SystemExit) as stop:
            {"sounder": sounder.cli, "erm": erm.cli}[command].main()
    plt.close("all")
    return int(stop.value.code or 0), errors.getvalue()


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Path:
    """Folder with the project's data, and in ``demo-output`` what ``make demo`` leaves of a few receivers."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("calibration", "examples"):
        shutil.copytree(PROJECT / name, folder / name)
    scene = folder / "examples" / "scenes" / "uma.toml"
    head, *receivers = re.split(r"(?=^\[\[receivers\]\])", scene.read_text(encoding="utf-8"), flags=re.MULTILINE)
    last, rest = re.split(r"(?=^\[environment)", receivers.pop(), maxsplit=1, flags=re.MULTILINE)
    kept = [text for text in [*receivers, last] if re.search(r'name = "(\w+)"', text)[1] in RECEIVERS]
    head = head.replace("snapshots = 8", "snapshots = 2")
    scene.write_text("".join([head, *kept, rest]), encoding="utf-8")
    campaign = folder / "examples" / "campaigns" / "demo.toml"
    campaign.write_text(f'{campaign.read_text(encoding="utf-8")}\n[figures]\npositions = "none"\n', encoding="utf-8")
    demo = "sounder simulate examples/scenes/uma.toml --out demo-output"
    process = "sounder process raw/*.h5 --calibration back-to-back.h5 --out products"
    for command, place in ((demo, folder), (process, folder / "demo-output")):
        code, errors = run(command, place)
        assert code == 0, errors
    table, _ = erm.read_mpcs(sorted((folder / "demo-output" / "products").glob("*.h5")))
    last = table["position"].values == "RX9_L"
    erm.write_mpcs(table.isel(mpc=~last), folder / "demo-output" / "mpcs.csv")  # for a user's own tables of MPCs
    erm.write_mpcs(table.isel(mpc=last), folder / "demo-output" / "more.csv")
    return folder


def absent(line: str, folder: Path) -> list[str]:
    """Files that a command line reads and that are not there."""
    words = shlex.split(line, comments=True)
    read = [word for before, word in pairwise(words) if word.endswith(READ) and before not in WRITTEN]
    return [word for word in read if not glob.glob(word, root_dir=folder)]


@pytest.mark.slow
@pytest.mark.parametrize("document", DOCUMENTS)
def test_examples_of_documents_run(document, project, monkeypatch, subtests):
    folder = project / "demo-output"

    def shell(example: Example) -> None:
        for line in example.parsed.splitlines():
            if not re.match(r"(sounder|erm) ", line):
                continue
            with subtests.test(line):
                if line.startswith(STUDY) or (missing := absent(line, folder)):
                    pytest.skip(f"{document}: {line}: {'takes long' if line.startswith(STUDY) else missing}")
                code, errors = run(line, folder)
                assert code == 0, f"{line}\n{errors}"

    def write(example: Example) -> None:
        # a file whose name stands in the line above its content
        above = example.document.text[: example.region.start].rstrip().splitlines()[-1]
        if name := re.match(r"`(\w+\.toml)`", above):
            (folder / name[1]).write_text(example.parsed, encoding="utf-8")

    monkeypatch.chdir(project)
    parsers = [PythonCodeBlockParser(), CodeBlockParser("sh", shell), CodeBlockParser("toml", write)]
    for example in Sybil(parsers).parse(PROJECT / document).examples():
        with subtests.test(f"line {example.line}"):
            example.evaluate()
    plt.close("all")


@pytest.mark.slow
@pytest.mark.parametrize("notebook", sorted(path.name for path in (PROJECT / "examples" / "notebooks").glob("*.py")))
def test_notebooks_run(notebook, project, monkeypatch):
    monkeypatch.chdir(project)
    names = runpy.run_path(str(PROJECT / "examples" / "notebooks" / notebook))
    assert [names.get(name) for name in ("failures", "problems", "complaints") if names.get(name)] == []
    if notebook == "your_own_sounder.py":
        assert float(names["wall"]["offset"]) == pytest.approx(-12.0, abs=0.05)


@pytest.mark.parametrize("package", [sounder, erm])
def test_every_public_function_has_an_example(package):
    names = [name for name in package.__all__ if not name.startswith("__")]
    assert [name for name in names if ">>>" not in getattr(package, name).__doc__] == []


def test_the_files_that_the_page_on_the_architecture_names_exist():
    text = (PROJECT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert [name for name in re.findall(r"`(src/[\w/.]+)`", text) if not (PROJECT / name).exists()] == []
