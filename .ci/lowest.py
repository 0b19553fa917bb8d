"""Print the lowest version of each dependency that pyproject.toml admits, as constraints for pip."""

import tomllib
from pathlib import Path

from packaging.requirements import Requirement

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
for line in sum(project["optional-dependencies"].values(), project["dependencies"]):
    requirement = Requirement(line)
    (lowest,) = (one.version for one in requirement.specifier if one.operator == ">=")
    print(f"{requirement.name}=={lowest}")
