"""Arrays that are carved from a block of memory do not keep it: no kernel carves from a block that it makes itself."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

from assembly._carve import uncounted
from assembly._kernel import kernel

ROOT = Path(__file__).resolve().parent.parent.parent
SOURCES = {path: ast.parse(path.read_text()) for path in sorted((ROOT / "assembly").rglob("*.py"))}


def name_of(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else ""


def calls_in(*nodes: ast.AST) -> list[ast.Call]:
    return [part for node in nodes for part in ast.walk(node) if isinstance(part, ast.Call)]


def is_made(node: ast.expr) -> bool:
    """Whether an expression is a new array of NumPy's: `np.empty(n)` and its like."""
    function = node.func if isinstance(node, ast.Call) else None
    return isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name) and function.value.id == "np"


def is_inlined(function: ast.FunctionDef) -> bool:
    """Whether a kernel becomes a part of its callers, so that what it carves is theirs."""
    settings = [word for call in function.decorator_list if isinstance(call, ast.Call) for word in call.keywords]
    return any(word.arg == "inline" for word in settings)


def functions_of(trees: list[ast.Module]) -> list[ast.FunctionDef]:
    """All kernels; functions of Python may have their names."""
    functions = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [node for node in functions if any(ast.unparse(way).startswith("kernel") for way in node.decorator_list)]


def carving(functions: list[ast.FunctionDef]) -> set[str]:
    """Names of what returns arrays that nobody keeps: `carve`, `uncounted`, and inlined kernels that call such."""
    found = {"carve", "uncounted"}
    while True:
        more = {
            function.name
            for function in functions
            if is_inlined(function)
            and any(isinstance(node, ast.Call) and name_of(node) in found for node in ast.walk(function))
        }
        if more <= found:
            return found
        found |= more


def borrowed(trees: list[ast.Module]) -> list[str]:
    """Kernels that carve from blocks of their own."""
    functions = functions_of(trees)
    names = carving(functions)
    wrong = []
    for function in functions:
        own = {
            target.id
            for node in ast.walk(function)
            if isinstance(node, ast.Assign) and is_made(node.value)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for node in ast.walk(function):
            if isinstance(node, ast.Call) and name_of(node) in names:
                given = [*node.args, *(word.value for word in node.keywords)]
                if any(is_made(value) or (isinstance(value, ast.Name) and value.id in own) for value in given):
                    wrong.append(function.name)
    return wrong


def record_views(trees: list[ast.Module]) -> set[str]:
    """Names of functions that `record_view` makes, and of kernels that return what one of them reads."""
    found = {"carve", "uncounted"} | {
        target.id
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) and name_of(node.value) == "record_view"
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    returned = [
        (function.name, name_of(node.value))
        for function in functions_of(trees)
        for node in ast.walk(function)
        if isinstance(node, ast.Return) and isinstance(node.value, ast.Call)
    ]
    while True:
        more = {name for name, called in returned if called in found}
        if more <= found:
            return found
        found |= more


def assigned(function: ast.FunctionDef) -> list[tuple[ast.expr, ast.expr]]:
    """Targets and values of a function's assignments, those of tuples one by one."""
    pairs = []
    for node in ast.walk(function):
        if isinstance(node, ast.Assign):
            target, value = node.targets[-1], node.value
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs += list(zip(target.elts, value.elts, strict=True))
            else:
                pairs.append((target, value))
    return pairs


def root_of(node: ast.expr) -> str:
    """The variable of `name.field[...]`."""
    while isinstance(node, (ast.Attribute, ast.Subscript)):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def lending(trees: list[ast.Module]) -> set[str]:
    """Names of functions that `lent_array` makes, and of inlined kernels of these alone: Python keeps their arrays."""
    found = {
        part.id
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and any(name_of(x) == "lent_array" for x in calls_in(node.value))
        for target in node.targets
        for part in ast.walk(target)
        if isinstance(part, ast.Name)
    }
    kernels = [each for each in functions_of(trees) if is_inlined(each)]
    while True:
        # Named tuples, which have capital letters, hold what they are given.
        more = {
            each.name
            for each in kernels
            if any(name_of(call) in found for call in calls_in(*each.body))
            and all(name_of(call) in found or name_of(call)[:1].isupper() for call in calls_in(*each.body))
        }
        if more <= found:
            return found
        found |= more


def outliving(trees: list[ast.Module]) -> list[str]:
    """Records and carved arrays that a kernel uses after the last use of what it made, and they are in."""
    views, wrong = record_views(trees), []
    functions = functions_of(trees)
    makers = {each.name for each in functions if "allocates=True" in ast.unparse(each.decorator_list[0])}
    makers -= lending(trees)
    for function in functions:
        if function.name not in makers:
            continue
        pairs = assigned(function)
        last: dict[str, int] = {}
        for node in ast.walk(function):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                last[node.id] = max(last.get(node.id, 0), node.lineno)
        own: set[str] = set()
        while True:
            # What is made here, and tuples of that.
            more = {
                part.id
                for target, value in pairs
                if is_made(value)
                or (
                    isinstance(value, ast.Call)
                    and name_of(value) not in views
                    and (name_of(value) in makers or any(is_made(x) or root_of(x) in own for x in value.args))
                )
                for part in ast.walk(target)
                if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
            }
            if more <= own:
                break
            own |= more
        for target, value in pairs:
            if isinstance(target, ast.Name) and isinstance(value, ast.Call) and name_of(value) in views:
                block = root_of(value.args[0])
                if block in own and last.get(target.id, 0) > last[block]:
                    wrong.append(f"{function.name}: {target.id} of {block}")
    return wrong


def test_no_kernel_uses_a_record_of_a_block_that_it_made_and_uses_no_more():
    """Numba frees an array after its last use; a record is an address in it."""
    assert {"search_state_at", "frame_at", "segment_at", "cell_in"} <= record_views(list(SOURCES.values()))
    assert outliving(list(SOURCES.values())) == []


@pytest.mark.parametrize(
    ("body", "wrong"),
    [
        ("block = np.zeros(9)\n    a = record_at(block, 0)\n    return a.one", ["outer: a of block"]),
        ("block, n = np.zeros(9), 1\n    a, b = record_at(block, 0), n\n    use(block)\n    return a.one",
         ["outer: a of block"]),
        ("all = Search(table, np.zeros(9))\n    a = first_in(all)\n    use(all)\n    return a.one",
         ["outer: a of all"]),
        ("block = np.zeros(9)\n    all = Search(block)\n    a = first_in(all)\n    use(all)\n    return a.one",
         ["outer: a of all"]),
        ("block = np.zeros(9)\n    a = record_at(block, 0)\n    a.one = 1.0\n    return use(block)", []),
        # The caller holds it.
        ("a = record_at(table, 0)\n    return a.one", []),
        # Python holds it.
        ("all = lent_search(table)\n    a = first_in(all)\n    use(all)\n    return a.one", []),
        ("all = own_search(table)\n    a = first_in(all)\n    use(all)\n    return a.one", ["outer: a of all"]),
    ],
)  # fmt: skip
def test_the_check_sees_records_that_outlive_their_block(body, wrong):
    text = f"""
record_at = record_view(RECORD)

@kernel(inline=True)
def first_in(search):
    return record_at(search.block, 0)

rows, numbers = lent_array("f8", 1), lent_array("i8", 1)

@kernel(inline=True, allocates=True)
def lent_search(table):
    return Search(rows(table, 0), numbers(table, 1))

@kernel(inline=True, allocates=True)
def own_search(table):
    return Search(rows(table, 0), np.zeros(9))

@kernel(inner=True, allocates=True)
def outer(table, doubles):
    {body}
"""
    assert outliving([ast.parse(text)]) == wrong


def test_no_kernel_carves_from_a_block_of_its_own():
    names = carving(functions_of(list(SOURCES.values())))
    assert {"carve", "shape_of", "carve_all", "carve_points"} <= names
    assert borrowed(list(SOURCES.values())) == []


@pytest.mark.parametrize(
    ("body", "wrong"),
    [
        ("return inner(table, doubles)", []),
        ("return inner(table, np.empty(9))", ["outer"]),
        ("block = np.zeros(9)\n    a = inner(table, block)\n    return a[0]", ["outer"]),
        ("return carve(np.empty(9), 0, (3, 3))", ["outer"]),
        ("block = uncounted(np.zeros(9))\n    return block[0]", ["outer"]),
        # Called, and not inlined: the block is an argument for as long as the call lasts.
        ("return called(table, np.empty(9))", []),
    ],
)
def test_the_check_sees_blocks_that_are_made_on_the_spot(body, wrong):
    text = f"""
@kernel(inline=True)
def inner(table, doubles):
    return carve(doubles, 0, (3, 3))

@kernel(inner=True)
def called(table, doubles):
    return inner(table, doubles)[0, 0]

@kernel(inner=True, allocates=True)
def outer(table, doubles):
    {body}
"""
    assert borrowed([ast.parse(text)]) == wrong


@kernel(allocates=True)
def raise_all(array, other):
    same = uncounted(array)
    pair = (same, uncounted(other))
    for k in range(same.shape[0]):
        for i in range(same.shape[1]):
            pair[0][k, i] += pair[1][0]
    return same[0, 0]


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="Python counts references for itself")
def test_an_uncounted_array_is_the_array_and_lets_go_of_it():
    array, other = np.zeros((2, 3)), np.ones(1)
    assert raise_all(array, other) == 1.0
    references = sys.getrefcount(array), sys.getrefcount(other)
    for _ in range(50):
        raise_all(array, other)
    np.testing.assert_array_equal(array, np.full((2, 3), 51.0))
    # A call holds its arguments: none of them was kept, none let go of twice.
    assert (sys.getrefcount(array), sys.getrefcount(other)) == references
