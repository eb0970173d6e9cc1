"""A package `small` with kernels and a copy of assembly/_kernel/, and fresh processes that use both."""

from __future__ import annotations

import shutil
from pathlib import Path

KERNEL = Path(__file__).resolve().parent.parent.parent / "assembly" / "_kernel"
FILES = {
    "__init__.py": "from small import _lazy\n",
    "constants.py": "FACTOR = 2.0\n",
    "callee.py": """
from small._kernel import kernel
@kernel
def inner(x):
    return x + 1.0
@kernel(inline=True)
def helper(x):
    return x
""",
    "caller.py": """
from small._kernel import kernel
from small.callee import helper, inner
from small.constants import FACTOR
@kernel
def outer(x):
    return FACTOR * helper(inner(x))
def power(exponent):
    @kernel
    def raised(x):
        return x**exponent
    return raised
""",
    # A driver made of another file's parts, and a kernel that uses nothing of the others.
    "driver.py": """
from small._kernel import kernel
def twice(part):
    @kernel
    def driven(x):
        return part(part(x))
    return driven
""",
    "parts.py": """
from small._kernel import kernel
from small.driver import twice
@kernel(inner=True)
def step(x):
    return x + 5.0
@kernel(inner=True)
def other_step(x):
    return x + 7.0
walked, other_walked = twice(step), twice(other_step)
""",
    "alone.py": """
from small._kernel import kernel
def is_unit(name):
    return name in {"mm", "cm", "m", "km", "inch"}
def negated(is_known):
    @kernel
    def alone(x):
        return -x
    return alone
alone = negated(kernel(is_unit, inner=True))
""",
}
CALL = """
from small.caller import outer
from small._kernel.folders import entry_folder
answer = outer(3.0)
stats = outer.stats
print(answer, sum(stats.cache_hits.values()), sum(stats.cache_misses.values()), sep="|", end="|")
print(entry_folder())
"""
UNSET = dict.fromkeys(("NUMBA_DISABLE_JIT", "NUMBA_CACHE_LOCATOR_CLASSES", "XDG_CACHE_HOME", "LOCALAPPDATA"))


class Package:
    """A package `small` with kernels, a cache folder, and fresh processes that use both."""

    def __init__(self, folder: Path, run_python) -> None:
        self.folder = folder / "source" / "small"
        self.folder.mkdir(parents=True)
        for name, text in FILES.items():
            (self.folder / name).write_text(text)
        shutil.copytree(KERNEL, self.folder / "_kernel", ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(KERNEL.with_name("_lazy.py"), self.folder)
        for path in (self.folder / "_kernel").iterdir():
            path.write_text(path.read_text().replace("from assembly.", "from small."))
        self.cache = folder / "cache"
        self._run_python = run_python

    def run(self, code: str = CALL, **variables: str | None) -> str:
        settings = {**UNSET, "NUMBA_CACHE_DIR": str(self.cache), **variables}
        return self._run_python(code, path=self.folder.parent, **settings)

    def call(self, **variables: str | None) -> tuple[float, int, int, Path | None]:
        """Answer, cache hits, compilations, cache folder, of a process that calls `outer(3.0)`."""
        answer, hits, misses, folder = self.run(**variables).strip().splitlines()[0].split("|")
        return float(answer), int(hits), int(misses), None if folder == "None" else Path(folder)

    def edit(self, name: str, old: str, new: str) -> None:
        text = (self.folder / name).read_text()
        assert text.count(old) == 1
        (self.folder / name).write_text(text.replace(old, new))

    def entries(self, folder: Path) -> list[Path]:
        return sorted(folder.iterdir())
