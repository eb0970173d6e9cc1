"""A robot arm comes from a URDF file and reaches over a wall: its links keep clear of it, its joints keep their limits.

The file has links with exact shapes (cylinders and balls), and joints with limits. The tool is drawn up from the table,
over the wall and down behind it.
Prints where the tool is and how far from its target; writes urdf_arm.html, which plays the motion in a browser,
urdf_arm.glb for other viewers, and the robot as it was read to urdf_arm_again.urdf.
Needs pip install "assembly-solver[robots,meshes]".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import assembly as asm


def link(name: str, length: float, radius: float) -> str:
    """A rod along x from a ball at its joint, in meters as the file has it."""
    place = f'<origin xyz="{length / 2} 0 0" rpy="0 {np.pi / 2} 0"/>'
    rod = f'{place}<geometry><cylinder radius="{radius}" length="{length}"/>'
    ball = f'<geometry><sphere radius="{1.5 * radius}"/>'
    shapes = "".join(f"<collision>{shape}</geometry></collision>" for shape in (rod, ball))
    return f'<link name="{name}">{shapes}</link>'


def joint(name: str, parent: str, child: str, place: str, axis: str, limits: tuple[float, float]) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>'
        f'<axis xyz="{axis}"/><limit lower="{limits[0]}" upper="{limits[1]}" effort="0" velocity="0"/></joint>'
    )


def robot_text() -> str:
    parts = [
        '<link name="base"><collision><origin xyz="0 0 0.1"/>'
        '<geometry><cylinder radius="0.06" length="0.2"/></geometry></collision></link>',
        '<link name="turret"/>',
        link("upper arm", 0.5, 0.03),
        link("forearm", 0.4, 0.025),
        link("hand", 0.12, 0.02),
        joint("waist", "base", "turret", "0 0 0.25", "0 0 1", (-3.0, 3.0)),
        joint("shoulder", "turret", "upper arm", "0 0 0", "0 1 0", (-2.2, 0.5)),
        joint("elbow", "upper arm", "forearm", "0.5 0 0", "0 1 0", (-0.2, 2.6)),
        joint("wrist", "forearm", "hand", "0.4 0 0", "0 1 0", (-1.6, 1.6)),
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def main() -> tuple[asm.Robot, asm.Assembly, list[asm.Solution], np.ndarray]:
    Path("urdf_arm.urdf").write_text(robot_text())
    robot = asm.read_urdf("urdf_arm.urdf")
    asm.write_urdf("urdf_arm_again.urdf", robot)
    # The file has it stretched out, through the wall: it begins upright instead.
    robot.joint("shoulder").angle = -1.5
    upright = robot.assembly().solve()
    robot.joint("shoulder").angle = None
    for body in robot.bodies:
        body.pose = upright.pose(body)
    wall = asm.Body("wall", asm.shapes.box(40, 500, 430), position=(420, 0, 215), fixed=True, color=(0.7, 0.6, 0.5))
    scene = robot.assembly()
    scene.add(wall)
    for name in ("upper arm", "forearm", "hand"):
        scene.constrain(asm.Clearance([wall, robot.body(name)], minimum=10.0, name=f"{name} and wall"))
    tool = robot.body("hand").point(120, 0, 0)
    hand = asm.PointDistance(tool, target=(0, 0, 0))
    scene.minimize(hand, asm.Posture(weight=1e-4))
    # Up from the table before the wall, over it, and down behind it.
    corners = np.array([(250, 0, 300), (300, -150, 600), (650, 0, 500), (650, 150, 200), (900, 150, 200)], dtype=float)
    way = np.concatenate(
        [np.linspace(a, b, 12, endpoint=False) for a, b in zip(corners[:-1], corners[1:], strict=True)]
    )
    solutions: list[asm.Solution] = []
    for target in way:
        hand.target = target
        solutions.append(scene.solve(solutions[-1] if solutions else None))
    for target, solution in list(zip(way, solutions, strict=True))[::6]:
        found = solution.pose("hand").apply(tool.coordinates)
        off = np.linalg.norm(found - target)
        print(f"{solution.status.name}  tool at", *(f"{x:8.2f}" for x in found), f" {off:7.3f} mm from its target")
    asm.view.animate(scene, solutions, "urdf_arm.html")
    asm.write_gltf("urdf_arm.glb", scene, solutions)
    return robot, scene, solutions, way


if __name__ == "__main__":
    try:
        main()
    except ImportError as missing:
        raise SystemExit(str(missing)) from None
