"""The conda recipe says what pyproject says; whether it builds is tried by hand (`packaging/README.md`)."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import assembly as asm

yaml = pytest.importorskip("yaml", reason="the recipe is YAML: pip install pyyaml")
ROOT = Path(__file__).resolve().parents[2]
# Names of packages that conda has otherwise.
OTHERWISE = {"meshcat": "meshcat-python"}


def test_a_recipe_has_the_version_and_the_dependencies_of_the_project():
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == asm.__version__
    assert recipe["package"]["name"] == project["project"]["name"]
    wanted = [f"python {project['project']['requires-python']}"]
    for each in project["project"]["dependencies"]:
        name, bounds = re.fullmatch(r"([a-z-]+)(.*)", each).groups()
        wanted.append(f"{OTHERWISE.get(name, name)} {bounds}")
    assert sorted(recipe["requirements"]["run"]) == sorted(wanted)
    build = re.fullmatch(r"([a-z]+)(.*)", project["build-system"]["requires"][0]).groups()
    assert " ".join(build) in recipe["requirements"]["host"]
    assert recipe["about"]["license"] == project["project"]["license"]
    assert (ROOT / recipe["about"]["license_file"]).is_file()
