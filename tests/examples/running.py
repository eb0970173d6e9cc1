"""Run an example as a user does, in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from importlib.util import module_from_spec, spec_from_file_location
from io import StringIO
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def run_example(
    name: str,
    folder: Path,
    also: Sequence[str] = (),
    main: Callable[[ModuleType], Any] = lambda module: module.main(),
) -> SimpleNamespace:
    """The example's module, what its main returned, the lines it printed, and the page it wrote, beside other files."""
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as printed:
        patch.chdir(folder)
        result = main(module)
    assert sorted(path.name for path in folder.iterdir()) == sorted([f"{name}.html", *also])
    page = (folder / f"{name}.html").read_text(encoding="utf-8")
    return SimpleNamespace(module=module, result=result, lines=printed.getvalue().splitlines(), page=page)
