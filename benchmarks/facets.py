"""Which facets of two bodies may hold a contact: descents of two trees of facets, and Coal's on the same facets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.proximity import FeatureStatus, closest_features
from assembly.proximity.bvh.box_descent import tree_distance
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.bvh.packing import pack_tree
from benchmarks.figures import figure
from benchmarks.kernels import facing_bodies

ABOUT = """\
Two paper clips of 20,000 facets each, linked and touching, and twelve torus wires of 2,000 each in a chain. From call
to call each body moves and turns a little: a random walk about where it was, a fiftieth of the wire's radius a step. A
call from Python finds all pairs of patches, of two facets each, that may hold an extremal pair with a gap within the
reach, which is given in parts of the wire's radius, apart or crossing. Coal's queries are of the same facets at the
same poses: the distance of two bodies, and all pairs of facets that cross, without regard to normals; of the twelve its
broad phase with a collision test. Trees are made of new faces, alone."""

Array = NDArray[np.float64]
Table = NDArray[np.int64]
COAL = "Coal"
# Two clips as `examples/paper_clips.py` leaves them.
CLIPS = np.array(
    [
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [-6.1852851, 4.5887573, -22.63757773, 0.90370997, 0.27977427, 0.1460756, 0.28930359],
    ]
)
CLIP_RADIUS, MAJOR, MINOR = 0.5, 1.0, 0.12


def _clip() -> tuple[Face, ...]:
    return (Face(asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=CLIP_RADIUS)),)


def _chain(count: int) -> Array:
    """Poses of wires in a chain, every other one on edge; each hangs in the one before."""
    poses = np.zeros((count, 7))
    poses[:, 0] = (2.0 * MAJOR - 2.0 * MINOR) * np.arange(count)
    poses[:, 3] = 1.0
    poses[1::2, 3:5] = np.sqrt(0.5)
    return poses


def walk(start: Array, steps: int, length: float, size: float) -> Array:
    """Poses (steps, n, 7) of bodies that move by about a length a step, and turn so that their size moves by it."""
    rng = np.random.default_rng(31)
    poses = np.empty((steps, *start.shape))
    offset = np.zeros((len(start), 6))
    home = Rotation.from_quat(start[:, 3:], scalar_first=True)
    for k in range(steps):
        offset = 0.95 * offset + length / np.sqrt(3.0) * rng.normal(size=offset.shape)
        poses[k, :, :3] = start[:, :3] + offset[:, :3]
        poses[k, :, 3:] = (Rotation.from_rotvec(offset[:, 3:] / size) * home).as_quat(scalar_first=True)
    return poses


class Descents:
    """Bodies' trees in one table and one pool, and room for so many pairs of elements."""

    def __init__(self, trees: list[FacetTree], most: int = 20_000) -> None:
        tables: list[Table] = []
        pools: list[Array] = []
        offsets = []
        for tree in trees:
            table, pool, at = pack_tree(tree, 1.0, sum(map(len, tables)), sum(map(len, pools)))
            tables.append(table)
            pools.append(pool)
            offsets.append(at)
        self.table, self.pool = np.concatenate(tables), np.concatenate(pools)
        self.offsets = np.array(offsets)
        self.stack = np.empty((256, 2), dtype=np.int64)
        self.out = np.empty((most, 2), dtype=np.int64)

    def pairs(self, q: Array, reach: float) -> int:
        """How many pairs of elements there are; they are in `out`."""
        return int(facing_bodies(self.table, self.pool, self.offsets, q, reach, self.stack, self.out))

    def lower(self, pose: tuple[tuple[float, ...], tuple[float, ...]]) -> float:
        """A lower bound of the distance of the first two."""
        trees = tuple(self.offsets[:2].tolist())
        return float(tree_distance(self.table, self.pool, trees, *pose, 1e3, self.stack))


def _seconds(call: Callable[[Any], Any], cases: Sequence[Any]) -> tuple[Array, list[Any]]:
    """Of each call, and what it returned; a call before, which may compile, is kept apart."""
    call(cases[0])
    seconds, results = np.empty(len(cases)), []
    for k, case in enumerate(cases):
        begin = perf_counter()
        result = call(case)
        seconds[k] = perf_counter() - begin
        results.append(result)
    return seconds, results


def _relative(q: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Rotation and shift of the second body seen from the first."""
    first, second = Rotation.from_quat(q[:2, 3:], scalar_first=True).as_matrix()
    return tuple((first.T @ second).ravel().tolist()), tuple((first.T @ (q[1, :3] - q[0, :3])).tolist())


class _Meshes:
    """Facets of trees as Coal's meshes."""

    def __init__(self, coal: Any, trees: list[FacetTree]) -> None:
        self.coal = coal
        meshes = {id(tree): self._mesh(tree) for tree in trees}
        self.objects = [coal.CollisionObject(meshes[id(tree)]) for tree in trees]

    def _mesh(self, tree: FacetTree) -> Any:
        points, index = np.unique(tree.triangles.reshape(-1, 3), axis=0, return_inverse=True)
        index = index.reshape(-1, 3)
        # Facets at a pole have no area.
        index = index[(index != np.roll(index, 1, axis=1)).all(axis=1)]
        mesh = self.coal.BVHModelOBBRSS()
        mesh.beginModel(len(index), len(points))
        mesh.addVertices(points)
        mesh.addTriangles(index)
        mesh.endModel()
        return mesh

    def placements(self, poses: Array) -> list[list[Any]]:
        """Coal's transforms of all bodies at all poses."""
        turns = Rotation.from_quat(poses[..., 3:].reshape(-1, 4), scalar_first=True).as_matrix()
        moves = [self.coal.Transform3s(turn, x) for turn, x in zip(turns, poses[..., :3].reshape(-1, 3), strict=True)]
        count = poses.shape[1]
        return [moves[k : k + count] for k in range(0, len(moves), count)]

    def distance(self, moves: list[Any]) -> float:
        """Of the first two bodies."""
        a, b = (one.collisionGeometry() for one in self.objects[:2])
        request, result = self.coal.DistanceRequest(), self.coal.DistanceResult()
        return float(self.coal.distance(a, moves[0], b, moves[1], request, result))

    def crossing(self, moves: list[Any]) -> int:
        """All pairs of facets of the first two bodies that cross."""
        a, b = (one.collisionGeometry() for one in self.objects[:2])
        request = self.coal.CollisionRequest(self.coal.CollisionRequestFlag.CONTACT, 1_000_000)
        result = self.coal.CollisionResult()
        self.coal.collide(a, moves[0], b, moves[1], request, result)
        return int(result.numContacts())

    def manager(self) -> Callable[[list[Any]], None]:
        """Coal's broad phase of all bodies with a collision test of what it finds, made anew by each call."""
        manager = self.coal.DynamicAABBTreeCollisionManager()
        for one in self.objects:
            manager.registerObject(one)
        manager.setup()

        def update(moves: list[Any]) -> None:
            for one, move in zip(self.objects, moves, strict=True):
                one.setTransform(move)
                one.computeAABB()
            manager.update()
            manager.collide(self.coal.CollisionCallBackDefault())

        return update


def _coal() -> Any | None:
    try:
        return import_module("coal")
    except ImportError:
        return None


def _held(descents: Descents, trees: list[FacetTree], faces: tuple[Face, ...], poses: Array) -> tuple[int, int]:
    """Of poses where bodies are apart: how many of their nearest pairs are among those found, and how many poses."""
    right = cases = 0
    for q in poses:
        nearest = closest_features(faces, faces, q[0], q[1])
        if nearest.status is not FeatureStatus.APART:
            continue
        cases += 1
        rows = descents.out[: descents.pairs(q, nearest.gap * (1.0 + 1e-9))]
        inside = np.ones(len(rows), dtype=bool)
        for k, (tree, (u, v)) in enumerate(zip(trees, nearest.parameters, strict=True)):
            box = tree.parameters[rows[:, k]]
            inside &= (box[:, 0] <= u) & (u <= box[:, 1]) & (box[:, 2] <= v) & (v <= box[:, 3])
        right += bool(inside.any())
    return right, cases


def _two_clips(quick: bool, coal: Any | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows and figures."""
    count = 1_000 if quick else 10_000
    begin = perf_counter()
    tree = FacetTree.of(_clip(), count=count)
    building = perf_counter() - begin
    trees = [tree, tree]
    descents = Descents(trees)
    poses = walk(CLIPS, 100 if quick else 4_000, 0.02 * CLIP_RADIUS, 15.0)
    peers: dict[str, float | None] = {f"{COAL} distance": None, f"{COAL} crossing facets": None}
    if coal is not None:
        meshes = _Meshes(coal, trees)
        moves = meshes.placements(poses[:: 1 if quick else 10])
        peers = {f"{COAL} distance": float(np.median(_seconds(meshes.distance, moves)[0]))}
        peers[f"{COAL} crossing facets"] = float(np.median(_seconds(meshes.crossing, moves)[0]))
    rows, figures = [], []
    for name, part in (("a quarter of", 0.25), ("one", 1.0)):
        seconds, found = _seconds(lambda q, part=part: descents.pairs(q, part * CLIP_RADIUS), list(poses))  # type: ignore[misc]  # defaults bind the loop's values
        what = f"two clips of {2 * count:,} facets each, reach {name} radius"
        rows.append({"what": what, "pairs, median": float(np.median(found)), "pairs, most": float(np.max(found))})
        figures.append(figure(what, "seconds", float(np.median(seconds)), reach=1e-4, peers=peers))
        figures.append(figure(f"{what}, 99 of 100", "seconds", float(np.quantile(seconds, 0.99))))
    seconds, lower = _seconds(descents.lower, [_relative(q) for q in poses])
    figures.append(figure("the same, a lower bound of the distance", "seconds", float(np.median(seconds))))
    right, cases = _held(descents, trees, _clip(), poses[:: 10 if quick else 40])
    figures.append(figure("clips apart: the nearest pair is in a pair found", "count", right, of=cases, reach=cases))
    figures.append(figure(f"a tree of {2 * count:,} facets", "seconds", building))
    return rows, figures


def _wires(quick: bool, coal: Any | None) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    count = 200 if quick else 1_000
    trees = [FacetTree.of((Face(asm.shapes.torus(MAJOR, MINOR)),), count=count)] * 12
    descents = Descents(trees)
    poses = walk(_chain(12), 100 if quick else 2_000, 0.02 * MINOR, MAJOR)
    peers: dict[str, float | None] = {COAL: None}
    if coal is not None:
        meshes = _Meshes(coal, trees)
        peers = {COAL: float(np.median(_seconds(meshes.manager(), meshes.placements(poses[:: 1 if quick else 4]))[0]))}
    rows, figures = [], []
    for name, part in (("a quarter of", 0.25), ("one", 1.0)):
        seconds, found = _seconds(lambda q, part=part: descents.pairs(q, part * MINOR), list(poses))  # type: ignore[misc]  # defaults bind the loop's values
        what = f"twelve wires, {2 * count:,} facets each, all 66 pairs of bodies, reach {name} radius"
        rows.append({"what": what, "pairs, median": float(np.median(found)), "pairs, most": float(np.max(found))})
        figures.append(figure(what, "seconds", float(np.median(seconds)), peers=peers))
    return rows, figures


def run(quick: bool) -> dict[str, Any]:
    """Times and counts."""
    coal = _coal()
    # What compiles, compiles before.
    FacetTree.of(_clip(), count=100)
    clips, wires = _two_clips(quick, coal), _wires(quick, coal)
    return {"about": ABOUT, "rows": clips[0] + wires[0], "figures": clips[1] + wires[1]}
