"""A CadQuery assembly as a scene of bodies without shapes, and the solve that moves its parts.

As `cadquery.Assembly.solve` has it: constraints are between the assembly itself and its children, of which each moves
as a whole. Parts that are Fixed stay, and so does the assembly itself; where neither is constrained, the first part
does that others are constrained to and that the world does not hold. (CadQuery keeps the first part of all where the
world holds every one of them. Here they all move then: what the world asks of that part would not hold.)
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

from assembly._garbage import uncollected
from assembly.assembly import Assembly
from assembly.cad.cadquery_joints import Maker
from assembly.cad.locations import location_of, pose_of
from assembly.cad.markers import Requirement, requirements_of
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Fixed
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.step.bodies import unique

__all__ = ["solve_cadquery"]

# Kinds that constrain one part to the world.
OF_ONE_PART = ("Fixed", "FixedPoint", "FixedAxis", "FixedRotation")
Requirements = tuple[Requirement, ...]


class _Scene:
    """What is kept of an assembly: bodies, joints, and of what they were made."""

    def __init__(self, assembly: Any, constraints: list[Any], read: list[Requirements]) -> None:
        self._root = assembly.name
        self._read = read
        self._maker = Maker()
        self._taken = {name for constraint in constraints for name in constraint.objects}
        self._numbered: set[str] = set()
        self._twins: dict[str, Body] = {}
        self._world: Body | None = None
        standing = _standing(assembly, constraints)
        # Of parts that all stand, joints hold those that a constraint is between, so that it is told if it does not.
        held = {
            name
            for constraint in constraints
            if constraint.kind != "Fixed" and standing.issuperset(constraint.objects)
            for name in constraint.objects
        }
        names = dict.fromkeys(name for constraint in constraints for name in constraint.objects)
        self.parts = {name: Body(name, fixed=name in standing and name not in held) for name in names}
        self._posts = {name: Body(unique(f"place of {name}", self._taken), fixed=True) for name in sorted(held)}
        joints = [
            joint
            for constraint, requirements in zip(constraints, read, strict=True)
            if constraint.kind != "Fixed"
            for joint in self._joints(constraint, requirements)
        ]
        joints += [Fixed(post, self.parts[name], name=f"Fixed {name}") for name, post in self._posts.items()]
        joints += [Fixed(self.parts[name], twin, name=f"{name} is rigid") for name, twin in self._twins.items()]
        bodies = [*self.parts.values(), *self._twins.values()]
        bodies += self._posts.values()
        self.scene = Assembly(bodies if self._world is None else [*bodies, self._world])
        self.scene.constrain(*joints)

    def is_of(self, assembly: Any, read: list[Requirements]) -> bool:
        """Whether the assembly still has these constraints."""
        return (
            self._root == assembly.name
            and len(self._read) == len(read)
            and all(mine is theirs for mine, theirs in zip(self._read, read, strict=True))
        )

    def _joints(self, constraint: Any, requirements: Requirements) -> list[Joint]:
        first, *others = constraint.objects
        name = unique(f"{constraint.kind} {'-'.join(constraint.objects)}", self._numbered)
        other = self._other(first, others[0]) if others else self._ground()
        return self._maker.joints(name, requirements, (self.parts[first], other))

    def _other(self, first: str, second: str) -> Body:
        """The body of the second side; of two places on one part a body that moves with it."""
        if first != second:
            return self.parts[second]
        if first not in self._twins:
            self._twins[first] = Body(unique(f"{first}, other side", self._taken))
        return self._twins[first]

    def _ground(self) -> Body:
        if self._world is None:
            self._world = Body(unique("world", self._taken), fixed=True)
        return self._world

    def begin(self, assembly: Any) -> dict[str, Pose]:
        """Put the bodies to where the parts stand, seen from where the assembly is placed, or else from the assembly.

        From outside where the assembly's own part is constrained: `FixedPoint` and its like are in those coordinates.
        """
        root = assembly.loc.wrapped if self._root in self.parts else None
        poses: dict[str, Pose] = {}
        for name, body in self.parts.items():
            location = assembly.objects[name].loc.wrapped
            if root is not None and name != self._root:
                location = root.Multiplied(location)
            poses[name] = body.pose = pose_of(location, repr(name))
        for others in (self._twins, self._posts):
            for name, other in others.items():
                other.pose = poses[name]
        return poses

    def apply(self, assembly: Any, began: dict[str, Pose], solution: Solution) -> None:
        """Move the parts that have moved."""
        root = assembly.loc.wrapped.Inverted() if self._root in self.parts else None
        for k, (name, pose) in enumerate(began.items()):
            row = solution.q[k]
            if name == self._root or (row == pose.row).all():
                continue
            location = location_of(Pose(row[:3], row[3:]))
            child = assembly.objects[name]
            child.loc = type(child.loc)(location if root is None else root.Multiplied(location))


_SCENES: WeakKeyDictionary[Any, _Scene] = WeakKeyDictionary()


def _standing(assembly: Any, constraints: list[Any]) -> set[str]:
    """Names of the parts that do not move."""
    fixed = {constraint.objects[0] for constraint in constraints if constraint.kind == "Fixed"}
    if any(assembly.name in constraint.objects for constraint in constraints):
        fixed.add(assembly.name)
    if not fixed:
        grounded = {constraint.objects[0] for constraint in constraints if constraint.kind in OF_ONE_PART}
        between = (constraint for constraint in constraints if constraint.kind not in OF_ONE_PART)
        free = (item.objects[0] for item in between if item.objects[0] not in grounded)
        fixed.update(list(free)[:1])
    return fixed


def solve_cadquery(assembly: Any, options: dict[str, Any]) -> Solution:
    """Solve a `cadquery.Assembly` in place; see `assembly.cad.solve`."""
    constraints = list(assembly.constraints)
    if not constraints:
        raise InputError(f"assembly {assembly.name!r} has no constraints; expected one, assembly.constrain(...)")
    read = [requirements_of(constraint) for constraint in constraints]
    known = _SCENES.get(assembly)
    if known is None or not known.is_of(assembly, read):
        with uncollected():
            known = _SCENES[assembly] = _Scene(assembly, constraints, read)
            began = known.begin(assembly)
            known.scene.packed()
    else:
        began = known.begin(assembly)
    solution = known.scene.solve(**options)
    if solution.success:
        known.apply(assembly, began, solution)
    return solution
