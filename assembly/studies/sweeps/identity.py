"""The identity of a study, so that a folder is not filled with rows of another one."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from types import FunctionType
from typing import Any

import numpy as np

import assembly
from assembly.assembly import Assembly
from assembly.derivatives.measure import Measure
from assembly.scene_file.document import scene_text
from assembly.studies.sweeps.measuring import Column
from assembly.studies.sweeps.plans import Plan

__all__ = ["manifest_of"]


def manifest_of(scene: Assembly, plan: Plan, columns: tuple[Column, ...], swept: bool = False) -> dict[str, Any]:
    """Hashes of the scene and the plan, names, versions, and whether ways have to be clear: JSON.

    Raises
    ------
    InputError
        The scene has what scene files do not hold.
    """
    manifest = {
        "format": "assembly-study",
        "version": 2,
        "scene": _scene_hash(scene),
        "plan": plan.kind,
        "seed": plan.seed,
        "rows": len(plan),
        "parameters": plan.names,
        "values": hashlib.sha256(plan.values.tobytes()).hexdigest(),
        "measures": [[column.name, column.unit, _measure_hash(column)] for column in columns],
        "assembly": assembly.__version__,
        "numba": version("numba"),
        "numpy": np.__version__,
    }
    # Folders of studies that are not swept are those of before.
    return {**manifest, "swept": True} if swept else manifest


def _scene_hash(scene: Assembly) -> str:
    """Of the scene as it is, where the study begins."""
    asked = Assembly(scene.bodies)
    asked._take_constraints(item for item in scene.constraints if item._is_asked)
    for sign, term in scene.objectives:
        (asked.minimize if sign > 0 else asked.maximize)(term)
    left = [item.name for item in scene.constraints if not item._is_asked]
    return hashlib.sha256(repr((scene_text(asked), left)).encode()).hexdigest()


def _measure_hash(column: Column) -> str:
    """Of what a measure is of; of a function of the instructions that it was compiled to."""
    of: Any = column.of
    if isinstance(of, Measure):
        things = of.thing if isinstance(of.thing, tuple) else (of.thing,)
        owners = [getattr(each, "joint", getattr(each, "body", each)) for each in things]
        places = [getattr(each, "coordinates", getattr(each, "origin", np.zeros(0))).tolist() for each in things]
        named = [
            (getattr(each, "name", ""), getattr(owner, "name", "")) for each, owner in zip(things, owners, strict=True)
        ]
        return f"{of.kind} {of.axis} {named} {places} {of.on.name if of.on else ''}"
    function = getattr(of, "func", of)
    if not isinstance(function, FunctionType):
        return f"{type(function).__module__}.{type(function).__qualname__}"
    code = function.__code__
    numbers = [each for each in code.co_consts if isinstance(each, (int, float, str))]
    parts = repr((code.co_code, code.co_names, numbers, function.__defaults__)).encode()
    return f"{function.__qualname__} {hashlib.sha256(parts).hexdigest()[:16]}"
