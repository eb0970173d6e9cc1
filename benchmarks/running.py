"""One benchmark in an interpreter of its own, so that none warms or breaks another; and the examples, to measure."""

from __future__ import annotations

import traceback
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from multiprocessing import get_context
from pathlib import Path
from typing import Any

__all__ = ["example", "run_apart"]

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def example(name: str) -> Any:
    """The module of an example."""
    spec = spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run_apart(module: str, quick: bool) -> dict[str, Any]:
    """What `run(quick)` of a module returns; what goes wrong is a result too, under "error"."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        try:
            return process.submit(_run_here, module, quick).result()
        except BrokenProcessPool as error:  # the interpreter itself ended, as compiled peers can make it
            return {"error": f"{type(error).__name__}: {error}"}


def _run_here(module: str, quick: bool) -> dict[str, Any]:
    try:
        result: dict[str, Any] = import_module(module).run(quick)
    except Exception:
        return {"error": traceback.format_exc()}
    return result
