"""The rules of the house: what an import costs, which names are public, what kernels may use."""

from __future__ import annotations

import ast
import importlib
import inspect
import tomllib
from pathlib import Path

import pytest

import assembly
import assembly.cad
import assembly.proximity
import assembly.view
from assembly._kernel.decorator import Entry
from assembly._kernel.sources import source_of as source_of_kernel
from assembly._kernel.sources import sources_of
from assembly.kernels.listing import all_items

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "assembly"
HEAVY = ("casadi", "matplotlib", "meshcat", "numba", "numpy", "scipy")
LAZY = [assembly, assembly.cad, assembly.proximity, assembly.view]


def label(value: object) -> str:
    return getattr(value, "__name__", str(value))


def imported_modules(path: Path) -> set[str]:
    """Full names of everything a file imports from this package: modules, and names in them."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            names.update((node.module, *(f"{node.module}.{alias.name}" for alias in node.names)))
    return {name for name in names if name.partition(".")[0] == "assembly"}


def source_of(module: str) -> Path | None:
    """The file of a module of this package, if there is one; packages are not meant."""
    path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
    return path if path.is_file() else None


def package_of(module: str) -> Path | None:
    """The file of a package of this package, if there is one."""
    path = ROOT.joinpath(*module.split("."), "__init__.py")
    return path if path.is_file() else None


def holds_objects(path: Path) -> bool:
    """Whether a file defines classes, or functions that are no kernels."""
    return any(isinstance(node, (ast.ClassDef, ast.FunctionDef)) for node in ast.parse(path.read_text()).body)


def listed_entries() -> list[Entry]:
    """All entries of the package, imported."""
    return list({id(item.entry): item.entry for item in all_items()}.values())


def makes_kernels(path):
    """Whether a file asks for the decorator, and not for addresses of kernels alone."""
    text = path.read_text(encoding="utf-8")
    return "assembly._kernel import" in text and any(
        isinstance(node, ast.ImportFrom)
        and node.module == "assembly._kernel"
        and any(n.name == "kernel" for n in node.names)
        for node in ast.walk(ast.parse(text))
    )


KERNEL_FILES = [p for p in sorted(PACKAGE.rglob("*.py")) if makes_kernels(p)]


def test_import_is_light(run_python):
    loaded = run_python(f"import assembly, sys; print([m for m in {HEAVY} if m in sys.modules])")
    assert loaded.strip() == "[]"


def test_scripting_loads_neither_casadi_nor_meshcat(run_python):
    code = f"""
import assembly, sys
for name in assembly.__all__:
    if name not in ("reference", "view"):
        getattr(assembly, name)
print([m for m in {HEAVY} if m in sys.modules and m in ("casadi", "matplotlib", "meshcat")])
"""
    assert run_python(code).strip() == "[]"


@pytest.mark.parametrize(("package", "name"), [(p, n) for p in LAZY for n in p.__all__], ids=label)
def test_public_names_resolve(package, name):
    value = getattr(package, name)
    assert name in dir(package)
    if isinstance(value, float):
        # A constant has no name of its own.
        assert name == "deg"
        return
    assert value.__name__.rpartition(".")[2] == name
    assert value.__doc__


@pytest.mark.parametrize("package", LAZY, ids=lambda p: p.__name__)
def test_type_checkers_see_the_same_names(package):
    tree = ast.parse(Path(package.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    table = ast.literal_eval(block.orelse[0].value.args[1])
    seen = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            assert alias.asname == alias.name, "only `import name as name` is a public name to a type checker"
            module = f"{node.module}.{alias.name}"
            seen[alias.name] = module if table.get(alias.name) == module else node.module
    assert seen == table


@pytest.mark.parametrize("package", LAZY, ids=lambda p: p.__name__)
def test_unknown_names_are_attribute_errors(package):
    with pytest.raises(AttributeError, match=f"module '{package.__name__}' has no attribute 'NurbsSurfce'") as caught:
        _ = package.NurbsSurfce
    assert (caught.value.name, caught.value.obj) == ("NurbsSurfce", package)  # what "Did you mean" is made of
    with pytest.raises(ImportError):
        importlib.import_module(f"{package.__name__}.NurbsSurfce")


def test_a_name_is_imported_once(monkeypatch):
    value = assembly.errors
    monkeypatch.setattr("assembly._lazy.import_module", None)
    assert assembly.errors is value


def test_there_are_kernel_files():
    assert {"geometry/vec.py", "geometry/splines/evaluate.py"} <= {
        p.relative_to(PACKAGE).as_posix() for p in KERNEL_FILES
    }


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_the_stamp_of_the_cache_sees_all_imports(path):
    # What Python's parser finds, by names that are asked for from packages as well.
    found = {source_of(module) or package_of(module) for module in imported_modules(path)} - {None}
    packages = {source for source in found if source.name == "__init__.py"}
    assert found - packages <= sources_of(path)


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_kernels_import_by_statements_that_the_stamp_reads(path):
    # Names from modules, at the top of the file; of other libraries nothing that an edit of this one changes.
    tree = ast.parse(path.read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]
    assert all(node in tree.body for node in imports)
    for node in imports:
        if isinstance(node, ast.Import):
            assert {alias.name.partition(".")[0] for alias in node.names} <= {"math", "numpy"}
        elif node.module.partition(".")[0] == "assembly":
            modules = [source_of(node.module) or source_of(f"{node.module}.{alias.name}") for alias in node.names]
            assert node.module == "assembly._kernel" or None not in modules, "a name of a package"


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_kernels_reach_no_objects(path):
    # An entry is compiled again after an edit of any file that its module reaches: these are kernels and constants.
    door = PACKAGE / "_kernel"
    reached = {source for source in sources_of(path) if door not in source.parents and source.parent != PACKAGE}
    assert [s.name for s in reached if s not in KERNEL_FILES and (holds_objects(s) or s.name == "__init__.py")] == []


def test_an_edit_compiles_what_it_reaches():
    # How many of the entries an edit of a file compiles again.
    counts = {
        "solve/loop/direction.py": 1,
        "solve/loop/augmented_lagrangian.py": 1,
        "proximity/manager/update.py": 3,
        "proximity/extrema/face_face.py": 29,
    }
    entries = [source_of_kernel(entry.compiled.py_func) for entry in listed_entries()]
    assert len(entries) == 130
    for name, count in counts.items():
        assert sum(PACKAGE / name in sources_of(path) for path in entries) == count, name


def test_every_entry_declares_what_it_is_called_with():
    for entry in listed_entries():
        names = inspect.signature(entry.compiled.py_func).parameters
        assert entry.signatures
        assert [len(types) for types in entry.argument_types()] == [len(names)] * len(entry.signatures)
        assert len(set(entry.argument_types())) == len(entry.signatures)


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_a_file_holds_kernels_or_objects(path):
    top = ast.parse(path.read_text()).body
    assert [node.name for node in top if isinstance(node, ast.ClassDef)] == []
    for node in top:
        if isinstance(node, ast.FunctionDef):
            assert any(ast.unparse(d).startswith("kernel") for d in node.decorator_list), f"{node.name} is no kernel"


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda p: p.relative_to(PACKAGE).as_posix())
def test_kernels_do_not_count_from_the_end(path):
    # Their indices are taken as they stand; those that are computed, NUMBA_BOUNDSCHECK=1 looks at.
    places = [node.slice for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Subscript)]
    parts = [part for place in places for part in (place.elts if isinstance(place, ast.Tuple) else [place])]
    assert [ast.unparse(part) for part in parts if ast.unparse(part).startswith("-")] == []


def test_type_checking_leaves_out_the_kernel_files_only():
    configuration = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mypy"]["overrides"]
    left_out = next(o["module"] for o in configuration if o.get("ignore_errors"))
    kernels = {".".join(p.relative_to(ROOT).with_suffix("").parts) for p in KERNEL_FILES}
    assert set(left_out) == kernels


def test_readme_commands_are_what_ci_runs():
    readme = (ROOT / "README.md").read_text()
    commands = [line for line in readme.splitlines() if line.startswith("pip install")]
    tests = 'pip install ".[step,test]" && python -m tests'
    assert commands == ["pip install . && python examples/paper_clips.py", tests]
    assert "^pip install" in (ROOT / ".ci/run").read_text()


def named_offsets(path):
    """Subscripts of a kernel file by a constant's name: `block[at + NAME]`, and not a field of a record."""
    places = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Subscript)]
    return [
        ast.unparse(place)
        for place in places
        if any(isinstance(part, ast.Name) and part.id.strip("_").isupper() for part in ast.walk(place.slice))
    ]


def functions_of(path):
    """The functions of a file, with their names."""
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]


def test_tables_and_pools_are_read_by_fields():
    # What is left: the rooms of formulas, sliced where their parts begin. It may not grow.
    assert sum(len(named_offsets(path)) for path in KERNEL_FILES) <= 4


def test_kernels_return_few_values():
    # 3x3 matrices by rows are one thing each; what has more parts is a named tuple.
    many = [
        f"{path.name}: {node.name}"
        for path in KERNEL_FILES
        for node in functions_of(path)
        for end in ast.walk(node)
        if isinstance(end, ast.Return) and isinstance(end.value, ast.Tuple) and len(end.value.elts) > 4
    ]
    assert len(set(many)) <= 5, sorted(set(many))


def test_functions_have_few_parameters():
    # Keyword-only options of public calls do not count; what belongs together travels together.
    many = [
        f"{path.name}: {node.name}"
        for path in PACKAGE.rglob("*.py")
        for node in functions_of(path)
        if len([a for a in node.args.posonlyargs + node.args.args if a.arg not in ("self", "cls")]) > 8
    ]
    assert many == []


def test_functions_can_be_seen_at_once():
    long = [
        f"{path.name}: {node.name}"
        for path in PACKAGE.rglob("*.py")
        for node in functions_of(path)
        if node.end_lineno - node.lineno + 1 > 80
    ]
    assert long == []
