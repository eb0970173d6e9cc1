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
