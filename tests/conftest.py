"""What every test may use."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import hypothesis
import pytest

# Before numpy is imported, here and in processes that tests start: on small matrices the threads of its library wait
# for one another, busily, which takes more time than all else in some tests.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parent.parent

# The first example of a test may compile kernels, so no deadline; the same examples in every run,
# so that a failure is one for everybody. How long examples take to draw says how busy the machine is.
hypothesis.settings.register_profile(
    "assembly",
    deadline=None,
    derandomize=True,
    max_examples=50,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.register_profile("long", hypothesis.settings.get_profile("assembly"), max_examples=150)
hypothesis.settings.load_profile("assembly")


def pytest_configure(config: pytest.Config) -> None:
    """Before modules are imported, whose tests have numbers of examples."""
    if config.getoption("--long"):
        hypothesis.settings.load_profile("long")


@pytest.fixture(scope="session")
def cases(request: pytest.FixtureRequest) -> Callable[[int, int], int]:
    """How many random cases are tried: `few`, or `many` with ``--long``; counts that are judged are in proportion."""
    return lambda few, many: many if request.config.getoption("--long") else few


@pytest.fixture(scope="session", autouse=True)
def only_declared_signatures() -> Iterator[None]:
    """After all tests of a process: the package called its kernels with the types that are compiled ahead alone."""
    yield
    decorator = sys.modules.get("assembly._kernel.decorator")
    entries = decorator.ENTRIES.values() if decorator else ()
    called = [(entry, types) for entry in entries for types in entry.compiled.overloads]
    # Kernels of tests that call an entry with a number that is written there have an entry for that number.
    called = [(entry, types) for entry, types in called if not any(hasattr(kind, "literal_value") for kind in types)]
    others = [(entry.compiled.__qualname__, types) for entry, types in called if types not in entry.argument_types()]
    assert others == [], "kernels were called with types that they do not declare"


@pytest.fixture(scope="session")
def run_python() -> Callable[..., str]:
    """Run code in a fresh interpreter with changed environment variables; what it printed.

    A variable given as None is removed. The code sees the modules of this tree, or of `path`.
    """

    def run(code: str, path: Path = ROOT, **variables: str | None) -> str:
        wanted = {**os.environ, "PYTHONPATH": str(path), "PYTHONDONTWRITEBYTECODE": "1", **variables}
        environment = {name: value for name, value in wanted.items() if value is not None}
        done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    return run


@pytest.fixture(scope="session")
def alone() -> Callable[[], AbstractContextManager[None]]:
    """A context in which no other process of tests is, for what writes into the checkout: pytest-xdist has several."""

    @contextmanager
    def held() -> Iterator[None]:
        try:
            import fcntl
        except ImportError:  # Windows
            yield
            return
        with open(ROOT / "pyproject.toml", encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield

    return held


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--long``: the stress tests try for hours, others for minutes."""
    text = "a hundred times as many random cases in stress tests, and three times as many in others"
    parser.addoption("--long", action="store_true", help=text)
