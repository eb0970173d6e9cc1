"""A CadQuery assembly, a door in its frame, solved by one changed line: asm.cad.solve(assembly), not assembly.solve().

Needs CadQuery, in an environment of its own: pip install cadquery.
Prints how long both solvers take and what they leave; writes cadquery_solver.html for a browser.
"""

from __future__ import annotations

from time import perf_counter

try:
    import cadquery as cq
except ImportError:
    raise SystemExit("CadQuery is not installed; pip install cadquery, in an environment of its own") from None

import assembly as asm

HEIGHT, WIDTH, SIDE = 400.0, 200.0, 20.0  # [mm]


def profile(length: float, axis: str) -> cq.Workplane:
    plane = {"X": "YZ", "Z": "XY"}[axis]
    return cq.Workplane(plane).rect(SIDE, SIDE).rect(SIDE - 6, SIDE - 6).extrude(length)


def door() -> cq.Assembly:
    assembly = cq.Assembly(name="door")
    for name in ("left", "right"):
        assembly.add(profile(HEIGHT, "Z"), name=name, color=cq.Color("gray70"))
    for name in ("top", "bottom"):
        assembly.add(profile(WIDTH, "X"), name=name, color=cq.Color("gray50"))
    panel = cq.Workplane("XZ").rect(WIDTH, HEIGHT - 2 * SIDE).extrude(4)
    assembly.add(panel, name="panel", color=cq.Color(0.5, 0.7, 0.9))
    # The cross bars between the posts, flush with their ends.
    for bar, side in (("top", ">Z"), ("bottom", "<Z")):
        assembly.constrain(f"left@faces@{side}", f"{bar}@faces@{side}", "Axis", 0)
        assembly.constrain(f"left@faces@{side}", f"{bar}@faces@{side}", "PointInPlane")
        assembly.constrain("left@faces@<Y", f"{bar}@faces@<Y", "Axis", 0)
        assembly.constrain("left@faces@<Y", f"{bar}@faces@<Y", "PointInPlane")
        assembly.constrain(f"{bar}@faces@<X", "left@faces@>X", "PointInPlane")
    assembly.constrain("top@faces@>X", "right@faces@<X", "PointInPlane")
    for side in (">Z", "<Y"):
        assembly.constrain(f"left@faces@{side}", f"right@faces@{side}", "Axis", 0)
        assembly.constrain(f"left@faces@{side}", f"right@faces@{side}", "PointInPlane")
    # The panel in the middle, flush with the front.
    assembly.constrain("left@faces@<Y", "panel@faces@<Y", "Axis", 0)
    assembly.constrain("left@faces@<Y", "panel@faces@<Y", "PointInPlane")
    assembly.constrain("left@faces@>Z", "panel@faces@>Z", "Axis", 0)
    assembly.constrain("panel@faces@>Z", "top@faces@<Z", "PointInPlane")
    return assembly.constrain("panel@faces@<X", "left@faces@>X", "PointInPlane")


def main() -> tuple[cq.Assembly, asm.Solution]:
    asm.cad.solve(door())  # the first call loads what was compiled
    theirs, assembly = door(), door()
    begin = perf_counter()
    theirs.solve()
    middle = perf_counter()
    solution = asm.cad.solve(assembly)  # instead of assembly.solve()
    end = perf_counter()
    print(f"CadQuery's solver: {1e3 * (middle - begin):.0f} ms; ours: {1e3 * (end - middle):.0f} ms")
    print(solution)
    asm.view.save_html("cadquery_solver.html", asm.Assembly(asm.cad.from_cadquery(assembly)))
    return assembly, solution


if __name__ == "__main__":
    main()
