"""Workspaces of arms against closed forms, and of limited ones against points thrown by their joints."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.studies.reachable.drawn_tip import DrawnTip
from assembly.studies.reachable.grid import grid_of
from assembly.studies.reachable.known_poses import KnownPoses

LONG, SHORT = 1.0, 0.6
AREA = 4.0 * np.pi * LONG * SHORT


def planar_arm(lengths, limits=None, turn=0.9):
    """Links in the x-y plane, one on the other, bent a little; and the last one's end."""
    ground = asm.Body("ground", fixed=True)
    links = [asm.Body(f"link {k}") for k in range(len(lengths))]
    scene = asm.Assembly([ground, *links])
    before, at = ground, (0.0, 0.0, 0.0)
    for k, (length, link) in enumerate(zip(lengths, links, strict=True)):
        bounds = None if limits is None else limits[k]
        scene.constrain(asm.Revolute(before.frame(at=at), link.frame(), f"joint {k}", limits=bounds))
        before, at = link, (length, 0.0, 0.0)
    links[-1].pose = asm.Pose((0, 0, 0), (np.cos(0.5 * turn), 0, 0, np.sin(0.5 * turn)))
    return scene, links[-1].point(lengths[-1], 0, 0)


def spatial_arm():
    ground = asm.Body("ground", fixed=True)
    base, upper, fore = (asm.Body(name) for name in ("base", "upper", "fore"))
    fore.pose = asm.Pose((LONG, 0, 0), (np.cos(0.4), 0, np.sin(0.4), 0))
    scene = asm.Assembly([ground, base, upper, fore])
    y = (0.0, 1.0, 0.0)
    scene.constrain(
        asm.Revolute(ground.frame(), base.frame(), "yaw"),
        asm.Revolute(base.frame(z=y), upper.frame(z=y), "shoulder"),
        asm.Revolute(upper.frame(at=(LONG, 0, 0), z=y), fore.frame(z=y), "elbow"),
    )
    return scene, fore.point(SHORT, 0, 0)


@pytest.mark.parametrize(("cell", "off"), [(0.1, 2e-3), (0.05, 5e-4)])
def test_the_area_of_two_links_is_off_by_the_square_of_the_cell(cell, off):
    """0.2 h^2 of the area: a tangent is off by h^2 / 8 times the curvature, and signs of inner and outer rim differ."""
    found = asm.workspace(*planar_arm((LONG, SHORT)), cell=cell, plane="xy")
    assert abs(found.estimate / AREA - 1.0) < off
    assert found.inner < found.estimate < found.outer and found.undecided == 0
    radii = np.linalg.norm(found.centers, axis=1)
    assert LONG - SHORT < radii.min() and radii.max() < LONG + SHORT
    # Every cell whose middle is in the ring was found.
    middles = 0.5 + np.arange(-round(2 / cell), round(2 / cell))
    x, y = np.meshgrid(cell * middles, cell * middles)
    inside = (np.hypot(x, y) < LONG + SHORT) & (np.hypot(x, y) > LONG - SHORT)
    assert len(found.cells) == inside.sum()


def test_the_boundary_is_where_the_arm_is_straight():
    found = asm.workspace(*planar_arm((LONG, SHORT)), cell=0.1, plane="xy")
    radii = np.linalg.norm(found.boundary, axis=1)
    outer = radii > 1.0
    # The tip's distance from a target is off by the root of what is left of the objective, and of its square at most.
    np.testing.assert_allclose(radii, np.where(outer, LONG + SHORT, LONG - SHORT), rtol=0, atol=1e-9)
    sign = np.where(outer, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(found.normals, sign * found.boundary / radii[:, None], rtol=0, atol=1e-6)


def test_poses_have_the_tip_in_the_middle_of_their_cells():
    scene, tip = planar_arm((LONG, SHORT))
    found = asm.workspace(scene, tip, cell=0.2, plane="xy")
    still = asm.Assembly(scene.bodies)
    still.constrain(*scene.constraints)
    for center, q in zip(found.centers, found.poses, strict=True):
        solution = still.solve(q)
        assert solution.feasibility < 1e-12
        place = solution.pose(tip.body).apply(tip.coordinates)
        np.testing.assert_allclose(place, center, rtol=0, atol=1e-6 * 0.2)


def test_rows_of_a_front_are_solves_of_their_own():
    """Within reach and beyond it, from a stop and from poses; what is kept for speed is left out of rows."""
    scene, tip = planar_arm((LONG, SHORT))
    first = scene.solve()
    place = first.pose(tip.body).apply(tip.coordinates)
    grid = grid_of("xy", place, 0.1)
    drawn = DrawnTip(scene, tip, grid)
    start = drawn.all_from(place[None] + [0.02, 0.01, 0.0], first.q[None])
    assert start.solutions[0] is None
    directions = np.arange(8) * np.pi / 4.0
    ways = np.column_stack([np.cos(directions), np.sin(directions), np.zeros(8)])
    targets = np.concatenate([place + 0.1 * ways, place + 0.5 * ways])
    starts = start.take(np.zeros(16, dtype=int))
    rows = [drawn.all_to(targets, starts), drawn.all_from(targets, starts.poses)]
    assert [each is None for each in rows[0].solutions[:8]] == [True] * 8
    left = drawn.all_to(targets, starts, alone=False)
    assert [each is None for each in left.solutions] == [True] * 16
    for own in rows:
        alone = [drawn.to(target, drawn.solution(start, 0)) for target in targets]
        assert own.is_there.tolist() == [stop.is_there for stop in alone]
        assert 8 <= own.is_there.sum() < 16 and own.has_ended.all()
        places = drawn.places(np.array([stop.poses for stop in alone]))
        assert np.abs(drawn.places(own.poses) - places).max() < 1e-8
        # What is left is what a solve of its own was made for.
        if own is rows[0]:
            assert left.is_left.tolist() == [each is not None for each in own.solutions]
    assert np.abs(places[0] - alone[0].solution.pose(tip.body).apply(tip.coordinates)).max() < 1e-14


def test_poses_of_cells_are_known_once():
    """Against one at a time: those of a cell that are nearer than a length are one, in one call as in several."""
    rng = np.random.default_rng(4)
    known, before, arm = KnownPoses((2, 3), 0.7, 0.05), {}, 0.7
    for count in (40, 1, 0, 400):
        cells = rng.integers(0, 6, (count, 2))
        poses = np.round(rng.normal(size=(count, 3, 7)), 0)
        poses[..., 3:] /= np.maximum(np.linalg.norm(poses[..., 3:], axis=2), 1.0)[..., None]
        if count == 400:
            poses[:] = poses[rng.integers(0, 4, count)] + 0.001 * rng.uniform(size=(count, 1, 1))
        expected = []
        for row, (cell, pose) in enumerate(zip(map(tuple, cells.tolist()), poses, strict=True)):
            e = pose[:, 3:]
            mark = np.hstack([pose[:, :3], 2.0 * arm * (e[:, :, None] * e[:, None]).reshape(3, 16)])
            if all(np.abs(mark - other).max() >= 0.05 for _, other in before.get(cell, ())):
                before.setdefault(cell, []).append((pose, mark))
                expected.append(row)
        assert known.add(cells @ [100, 1], cells, poses).tolist() == expected
    assert len(known) == len(before) and 36 < sum(map(len, before.values())) < 441
    cells, poses = known.in_order()
    assert list(map(tuple, cells.tolist())) == sorted(before)
    assert np.array_equal(poses, [before[cell][0][0] for cell in sorted(before)])


def test_an_arm_that_moves_along_itself():
    """Three links reach pi (1.85^2 - 0.15^2), most places in a continuum of ways."""
    found = asm.workspace(*planar_arm((LONG, SHORT, 0.25)), cell=0.1, plane="xy")
    assert found.estimate == pytest.approx(np.pi * (1.85**2 - 0.15**2), rel=2e-3)


def thrown(limits, cells_a_length=100, count=1_000_000):
    """Area of the cells that random joint angles hit, less half a cell along the boundary."""
    rng = np.random.default_rng(3)
    first, second = (rng.uniform(*bounds, count) for bounds in limits)
    x = LONG * np.cos(first) + SHORT * np.cos(first + second)
    y = LONG * np.sin(first) + SHORT * np.sin(first + second)
    low, size = -2 * cells_a_length, 4 * cells_a_length
    hit = np.zeros((size, size), dtype=bool)
    hit[(np.floor(x * cells_a_length) - low).astype(int), (np.floor(y * cells_a_length) - low).astype(int)] = True
    inner = hit[1:-1, 1:-1] & hit[2:, 1:-1] & hit[:-2, 1:-1] & hit[1:-1, 2:] & hit[1:-1, :-2]
    return inner.sum() / cells_a_length**2, hit.sum() / cells_a_length**2


@pytest.mark.parametrize("limits", [((-3.0, 3.0), (-2.5, 1.0)), ((-1.0, 2.0), (-2.0, 2.5)), ((-0.5, 0.5), (-0.5, 1.5))])
def test_limits_of_joints(limits):
    """Elbows to either side reach other places; the union of both is found, off by 1e-4 here."""
    found = asm.workspace(*planar_arm((LONG, SHORT), limits, turn=0.3), cell=0.04, plane="xy")
    low, high = thrown(limits)
    assert low < found.estimate < high


def test_one_configuration_alone_misses_places():
    limits = ((-3.0, 3.0), (-2.5, 1.0))
    one, two = (
        asm.workspace(*planar_arm((LONG, SHORT), limits, turn=0.3), cell=0.05, plane="xy", flips=count)
        for count in (0, 1)
    )
    assert one.estimate < 0.5 * two.estimate


def test_a_volume_and_a_plane_through_it():
    scene, tip = spatial_arm()
    found = asm.workspace(scene, tip, cell=0.2)
    assert found.estimate == pytest.approx(4.0 / 3.0 * np.pi * (1.6**3 - 0.4**3), rel=3e-3)
    assert found.inner < found.estimate < found.outer
    flat = asm.workspace(scene, tip, cell=0.05, plane=scene.bodies[0].frame(x=(0, 0, 1), z=(0, 1, 0)))
    assert flat.estimate == pytest.approx(AREA, rel=5e-4)
    assert np.abs(flat.centers[:, 1]).max() < 1e-12 and np.abs(flat.boundary[:, 1]).max() < 1e-9


def test_what_is_contained():
    scene, tip = spatial_arm()
    found = asm.workspace(scene, tip, cell=0.2)
    points = [[1.59, 0, 0], [1.61, 0, 0], [0, 0.41, 0], [0, 0.39, 0], [1, 0.1, 0.3], [0, 0, 5]]
    assert found.contains(points).tolist() == [True, False, True, False, True, False]
    assert found.contains([1.0, 0.0, 0.0]).shape == ()
    flat = asm.workspace(scene, tip, cell=0.2, plane="zx")
    assert flat.contains([[1.0, 0.0, 0.2], [1.0, 0.1, 0.2]]).tolist() == [True, False]


def test_clearances_hold():
    """A post beside the arm's base: a disk of the fore link's tip cannot pass it."""
    scene, tip = planar_arm((LONG, SHORT))
    ground, upper, fore = scene.bodies
    ball = asm.Body("ball", asm.shapes.sphere(0.1))
    post = asm.Body("post", asm.shapes.sphere(0.15), position=(-1.0, 0.0, 0.0), fixed=True)
    whole = asm.Assembly([ground, upper, fore, ball, post])
    whole.constrain(*scene.constraints)
    whole.constrain(asm.Fixed(fore.frame(at=(SHORT, 0, 0)), ball), asm.Clearance([ball, post]))
    ball.pose = asm.Pose(fore.pose.apply((SHORT, 0, 0)))
    found = asm.workspace(whole, ball, cell=0.1, plane="xy")
    assert found.estimate == pytest.approx(AREA - np.pi * 0.25**2, rel=4e-3)
    assert (np.linalg.norm(found.centers - post.pose.position, axis=1) >= 0.25).all()


def test_a_tip_on_a_curve_has_no_area():
    ground, crank = asm.Body("ground", fixed=True), asm.Body("crank")
    scene = asm.Assembly([ground, crank])
    scene.constrain(asm.Revolute(ground, crank))
    found = asm.workspace(scene, crank.point(1, 0, 0), cell=0.07, plane="xy")
    assert (found.estimate, found.inner, len(found.cells)) == (0.0, 0.0, 0)
    assert not found.contains([1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="no cells"):
        found.picture()


def test_tips_that_go_on_without_end():
    ground, table, carriage = asm.Body("ground", fixed=True), asm.Body("table"), asm.Body("carriage")
    scene = asm.Assembly([ground, table, carriage])
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    scene.constrain(
        asm.Prismatic(ground.frame(z=x), table.frame(z=x)), asm.Prismatic(table.frame(z=y), carriage.frame(z=y))
    )
    with pytest.raises(InputError, match="reaches more than 500 cells of 0.1; expected a larger cell"):
        asm.workspace(scene, carriage, cell=0.1, plane="xy", most=500)
    found = asm.workspace(scene, carriage, cell=0.1, plane="xy", within=((-1, -0.5, -1), (1, 0.5, 1)))
    assert len(found.cells) == 200
    # No place of it is a boundary, and cells beside the region are no part of it.
    assert found.estimate == pytest.approx(2.0, rel=1e-12)


def test_a_region_cuts_cells():
    """The upper half of the ring, and a band of 0.07 below: half the ring, and two strips 1.2 long."""
    found = asm.workspace(*planar_arm((LONG, SHORT)), cell=0.05, plane="xy", within=((-2, -0.07, -1), (2, 2, 1)))
    assert found.centers[:, 1].min() > -0.07
    # Less what circles bend away in the strips, at most 1e-3; cells are sampled at a tenth of their sides.
    assert found.estimate == pytest.approx(0.5 * AREA + 2 * 0.07 * 2 * SHORT, abs=2e-3)
    with pytest.raises(InputError, match="within has no cell beside the tip, which starts at"):
        asm.workspace(*planar_arm((LONG, SHORT)), cell=0.1, plane="xy", within=((-1, -1, -1), (0, 1, 1)))


def test_the_same_search_gives_the_same_bits():
    one, two = (asm.workspace(*planar_arm((LONG, SHORT, 0.25)), cell=0.2, plane="xy") for _ in range(2))
    assert (one.cells == two.cells).all() and (one.poses == two.poses).all() and one.estimate == two.estimate
    assert str(one) == str(two) and str(one).startswith("area 10.")


def test_pictures_and_plots(tmp_path):
    scene, tip = planar_arm((LONG, SHORT))
    found = asm.workspace(scene, tip, cell=0.1, plane="xy")
    measure = asm.Dexterity(tip, scene.constraints, "manipulability")
    values = found.dexterity(measure)
    # l1 l2 |sin elbow|, whatever way the elbow is bent.
    squares = (found.centers**2).sum(axis=1)
    cosine = (squares - LONG**2 - SHORT**2) / (2.0 * LONG * SHORT)
    np.testing.assert_allclose(values, LONG * SHORT * np.sqrt(1.0 - cosine**2), rtol=0, atol=1e-5)
    picture = found.picture(values)
    assert len(picture.triangles) == 2 * len(found.cells)
    corners = picture.vertices[picture.triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(0.01 * len(found.cells), rel=1e-12)
    pytest.importorskip("matplotlib").use("Agg")
    axes = found.plot(values)
    axes.figure.savefig(tmp_path / "reach.png")
    assert (tmp_path / "reach.png").stat().st_size > 5000
    with pytest.raises(InputError, match=r"values have the shape \(3,\); expected"):
        found.plot([1, 2, 3])


def test_sides_of_a_volume_look_outward():
    found = asm.workspace(*spatial_arm(), cell=0.4)
    picture = found.picture()
    corners = picture.vertices[picture.triangles]
    assert np.linalg.det(corners).sum() / 6.0 == pytest.approx(0.4**3 * len(found.cells), rel=1e-12)
    with pytest.raises(InputError, match="the workspace is a volume; expected an area"):
        found.plot()


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"cell": 0.0}, InputError, "cell is 0; expected a positive number"),
        ({"cell": 0.1, "plane": "xz"}, InputError, "plane is 'xz'; expected a frame of a fixed body, 'xy'"),
        ({"cell": 0.1, "flips": -1}, InputError, "flips is -1"),
        ({"cell": 0.1, "within": ((1, 1, 1), (0, 2, 2))}, InputError, "expected a lower and an upper corner"),
        ({"cell": 0.1, "within": 3}, TypeError, "within is 3; expected a lower and an upper corner"),
        ({"cell": 0.1, "within": ((0, 0, 0),)}, InputError, "expected a lower and an upper corner"),
        ({"cell": 0.1, "starts": 5}, TypeError, "starts is 5; expected poses or solutions"),
        ({"cell": 0.1, "starts": [np.zeros((2, 7))]}, InputError, "starts"),
    ],
)
def test_bad_arguments(arguments, error, text):
    scene, tip = planar_arm((LONG, SHORT))
    with pytest.raises(error, match=text):
        asm.workspace(scene, tip, **arguments)


def test_bad_tips():
    scene, tip = planar_arm((LONG, SHORT))
    with pytest.raises(InputError, match="tip is a point of 'ground', which is fixed"):
        asm.workspace(scene, scene.bodies[0], cell=0.1)
    with pytest.raises(InputError, match="tip is a point of 'other'; expected one of a body of the scene"):
        asm.workspace(scene, asm.Body("other"), cell=0.1)
    with pytest.raises(TypeError, match="tip is 3; expected a point"):
        asm.workspace(scene, 3, cell=0.1)
    with pytest.raises(InputError, match="plane is a frame of 'link 0', which moves"):
        asm.workspace(scene, tip, cell=0.1, plane=scene.bodies[1].frame())
    with pytest.raises(InputError, match=r"points are .*; expected finite coordinates"):
        asm.workspace(scene, tip, cell=0.4, plane="xy").contains([np.nan, 0, 0])
