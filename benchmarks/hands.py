"""Scenes that a hand drags: linked rings, a chain of paper clips, twelve rings, a ball in a bowl; and who judges them.

Every scene has a grip, the point that the hand has hold of, and a judge that knows nothing of the library's kernels:
the least gap of all pairs of bodies anywhere, negative where one is in another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from benchmarks.center_lines import paper_clip_wire, torus_wire
from benchmarks.running import example
from benchmarks.scenes import MAJOR, MINOR, linked_wires
from benchmarks.wire_oracle import WireOracle

__all__ = [
    "BOWL",
    "Drag",
    "LinkedRings",
    "ball_in_bowl",
    "bowl_distance",
    "linked_rings",
    "paper_clips",
    "ring_chain",
]

Array = NDArray[np.float64]
NEAR, TAUT = 0.3, 3.0
WIRE = 0.5  # radius of the clips' wire [mm]


@dataclass(frozen=True, eq=False)
class Drag:
    """A scene, the hand's hold on it, and what judges a pose.

    Attributes
    ----------
    scene : Assembly
    grip : PointDistance
        Its target is where the hand is.
    deepest : callable
        The least gap anywhere at poses (n, 7).
    links : callable
        Linking numbers of all pairs there; zeros where wires have ends.
    """

    scene: asm.Assembly
    grip: asm.PointDistance
    deepest: Callable[[Array], float]
    links: Callable[[Array], NDArray[np.int64]]

    @property
    def hold(self) -> Array:
        """Where the grip is at the start, world coordinates."""
        return self.grip.point.body.pose.apply(self.grip.point.coordinates)


@dataclass(frozen=True, eq=False)
class LinkedRings:
    """Starts of three linked rings and where the hand draws the last one to.

    Attributes
    ----------
    drag : Drag
    q : (n, 3, 7)
    targets : (n, 3)
    starts : list of dict
        Parameters of the nearest pair of every contact.
    links : (n, 3)
        Linking numbers at the start.
    """

    drag: Drag
    q: Array
    targets: Array
    starts: list[dict[str, Array]]
    links: NDArray[np.int64]


def linked_rings(count: int, distance: float) -> LinkedRings:
    """Random starts of `benchmarks.wires`; targets at a distance of NEAR, or TAUT, which is out of reach."""
    wires = linked_wires(count)
    assert wires.objective is not None
    oracle = WireOracle([torus_wire(MAJOR, MINOR)] * 3)
    drag = Drag(wires.scene, wires.objective, oracle.deepest, oracle.links)
    links = np.array([oracle.links(q) for q in wires.q])
    return LinkedRings(drag, wires.q, wires.targets(distance), wires.starts, links)


def paper_clips() -> Drag:
    """The chain of the example, the hand at the lower end of the blue clip [mm]."""
    chain: asm.Assembly = example("paper_clips").paper_clips()
    ((_, grip),) = chain.objectives
    assert isinstance(grip, asm.PointDistance)
    oracle = WireOracle([paper_clip_wire(33.0, 8.0, WIRE)] * len(chain.bodies))
    return Drag(chain, grip, oracle.deepest, oracle.links)


def ring_chain(count: int = 12, seed: int = 1) -> Drag:
    """A chain of rings, each through the next, the first one fixed, the hand at the far side of the last one."""
    rng = np.random.default_rng(seed)
    ring = asm.shapes.torus(MAJOR, MINOR)
    upright = Rotation.from_euler("x", 90.0, degrees=True)
    bodies = []
    for k in range(count):
        # Every second one stands upright; at this pitch rings that are linked are two thirds of a radius apart.
        place = np.array([1.35 * k, 0.0, 0.0]) + rng.uniform(-0.1, 0.1, 3)
        turn = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, 3)) * upright ** (k % 2)
        bodies.append(asm.Body(f"ring {k + 1}", ring, place, turn.as_quat(scalar_first=True), fixed=k == 0))
    scene = asm.Assembly(bodies)
    hold = bodies[-1].point(MAJOR, 0.0, 0.0)
    grip = asm.PointDistance(hold, bodies[-1].pose.apply(hold.coordinates))
    scene.minimize(grip)
    oracle = WireOracle([torus_wire(MAJOR, MINOR)] * count)
    return Drag(scene, grip, oracle.deepest, oracle.links)


@dataclass(frozen=True)
class Bowl:
    """z = steepness (x^2 + y^2) up to a rim, the inside of it, and the radius of a ball that fits in [mm]."""

    steepness: float = 0.03
    rim: float = 20.0
    ball: float = 5.0

    def face(self) -> asm.Face:
        """A patch with S(u, v) = (u, v, z), trimmed by the round rim; its outward side is up."""
        half = 1.2 * self.rim
        x, y = np.meshgrid(*2 * [np.array([-half, 0.0, half])], indexing="ij")
        # The middle Bezier coefficient of x^2 over [-half, half] is -half^2.
        square = half**2 * np.array([1.0, -1.0, 1.0])
        z = self.steepness * (square[:, None] + square[None, :])
        knots = np.array([-half] * 3 + [half] * 3)
        corners = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
        turns = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
        rim = asm.NurbsCurve(self.rim * corners, turns, 2, [1.0, 0.5**0.5] * 4 + [1.0])
        return asm.Face(asm.NurbsSurface(np.dstack([x, y, z]), (knots, knots), (2, 2)), rim, name="bowl")


BOWL = Bowl()
# How the ball is turned: its poles are no special places of the motion.
POLES = (0.6, 0.7, 0.0)


def bowl_distance(place: Array, bowl: Bowl = BOWL) -> float:
    """Distance of a point from the bowl, from either side: at a foot of the parabola, or at the rim.

    Feet at r from the axis are roots of 2 k^2 r^3 + (1 - 2 k z) r - rho.
    """
    rho, z, k = float(np.hypot(place[0], place[1])), float(place[2]), bowl.steepness
    roots = np.roots([2.0 * k * k, 0.0, 1.0 - 2.0 * k * z, -rho])
    # Of a double root rounding makes two that are not quite real; any point of the bowl is at least as far as the foot.
    r = np.append(np.clip(roots.real, -bowl.rim, bowl.rim), [-bowl.rim, bowl.rim])
    return float(np.hypot(r - rho, k * r * r - z).min())


def ball_in_bowl(touching: bool = True) -> Drag:
    """A ball in the bowl, kept touching it or not, the hand at the ball's center."""
    bowl = asm.Body("bowl", BOWL.face(), fixed=True)
    ball = asm.Body(
        "ball", asm.shapes.sphere(BOWL.ball), (2.0, 1.0, 6.0), Rotation.from_rotvec(POLES).as_quat(scalar_first=True)
    )
    scene = asm.Assembly([bowl, ball])
    if touching:
        scene.constrain(asm.Contact(bowl, ball, "touch"))
    grip = asm.PointDistance(ball.point(0.0, 0.0, 0.0), ball.pose.position)
    scene.minimize(grip)

    def deepest(q: Array) -> float:
        return bowl_distance(q[1, :3]) - BOWL.ball

    def links(q: Array) -> NDArray[np.int64]:
        return np.zeros(1, dtype=np.int64)

    return Drag(scene, grip, deepest, links)
