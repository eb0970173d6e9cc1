"""Figures 6 to 9 of Patoglu & Gillespie: a closest-point algorithm that starts anywhere on a patch.

Figure 6: a witness point meets an edge of the patch of table I, runs along it and leaves it. Figure 7: from which
starts Newton's method, Newton's method with saturation and the controller find the closest point. Figure 8: the lag
behind a point that moves, by gain, and the gain that is too large. Figure 9: a point goes around a convex solid, and
its closest feature changes from the curved face to an edge to a wall.

The paper gives neither its points nor its paths; these are ours. Prints what the figures show; with matplotlib (the
extra `plot`) it also writes patoglu_gillespie.png into the working directory.
"""

from __future__ import annotations

from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np

import assembly as asm
from assembly.proximity.controllers.bounds import final_parameters
from assembly.proximity.controllers.control import MODES

# Table I: five rows, "order 3", which is degree 2 with knots at thirds.
TABLE = [
    [(0, 0, 0), (3, 0, 2), (5, 0, 3), (8, 0, 3), (10, 0, 0)],
    [(1, 3, 3), (3, 3, 5), (5, 3, 6), (8, 3, 5), (9, 3, 3)],
    [(2, 5, 5), (3, 5, 7), (5, 5, 8), (8, 5, 7), (8, 5, 5)],
    [(1, 8, 3), (3, 8, 5), (5, 8, 6), (8, 8, 5), (9, 8, 3)],
    [(0, 10, 0), (3, 10, 2), (5, 10, 3), (8, 10, 2), (10, 10, 0)],
]
KNOTS = [0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1]
PATCH = asm.NurbsSurface(np.swapaxes(np.array(TABLE, dtype=float), 0, 1), (KNOTS, KNOTS), (2, 2))
STEP = 1e-4  # [s]
METHODS = ("newton", "newton_saturated", "controller")


def figure_6() -> asm.proximity.ControlRun:
    """Interior, edge, interior."""
    control = asm.proximity.Controller(PATCH, (0.175, 8.011, 4.576), gain=2.0, start=(0.383, 0.328))
    return control.run(5_000, dt=1e-3)


def figure_7(count: int = 21) -> dict[str, np.ndarray]:
    """For every start of a grid whether it leads to the closest point, by method."""
    u, v = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count), indexing="ij")
    starts = np.stack([u.ravel(), v.ravel()], axis=1)
    point = np.array([0.630, 1.267, 6.008])
    distance, right = {}, {}
    for method in METHODS:
        ends, rested = final_parameters(PATCH, point, starts, method)
        apart = np.linalg.norm(PATCH.evaluate(ends[:, 0], ends[:, 1]) - point, axis=1)
        distance[method] = np.where(rested, apart, np.inf)
    for method in METHODS:
        right[method] = (distance[method] < distance["controller"].min() + 1e-9).reshape(count, count)
    return right


def path_8() -> np.ndarray:
    """Poses of the point for a second: once around a circle above the patch."""
    t = 2 * np.pi * np.linspace(0.0, 1.0, round(1.0 / STEP) + 1)
    q = np.zeros((t.size, 7))
    q[:, 0], q[:, 1], q[:, 2], q[:, 3] = 5 + 1.5 * np.cos(t), 5 + 1.5 * np.sin(t), 8.3, 1.0
    return q


def figure_8() -> dict[tuple[float, bool], asm.proximity.ControlRun]:
    """Runs along the path by gain, and whether with feed-forward."""
    runs, path = {}, path_8()
    for gain, feedforward in ((0.02, False), (50.0, False), (50.0, True), (1250.0, False), (1300.0, False)):
        control = asm.proximity.Controller(PATCH, (0, 0, 0), gain=gain, feedforward=feedforward, start=(0.1, 0.2))
        runs[gain, feedforward] = control.run(len(path) - 1, q_target=path, dt=STEP)
    return runs


def dome() -> list[asm.Face]:
    """A convex solid: a curved top over a square, four walls and a floor, all of them patches."""
    t = np.array([-1.0, 0.0, 1.0])
    x, y = np.meshgrid(t, t, indexing="ij")
    # Bezier points of z = 1 - 0.3 x^2 - 0.2 y^2, for which x^2 has the points 1, -1, 1.
    z = 1.0 - 0.3 * (2 * x * x - 1) - 0.2 * (2 * y * y - 1)
    top = np.stack([x, y, z], axis=2)
    curve, line = [0, 0, 0, 1, 1, 1], [0, 0, 1, 1]
    faces = [asm.Face(asm.NurbsSurface(top, (curve, curve), (2, 2)), name="top")]
    for name, edge in (("front", top[:, 0]), ("right", top[-1]), ("back", top[::-1, -1]), ("left", top[0, ::-1])):
        floor = edge * (1.0, 1.0, 0.0) - (0.0, 0.0, 1.0)
        faces.append(asm.Face(asm.NurbsSurface(np.stack([floor, edge], 1), (curve, line), (2, 1)), name=name))
    corners = np.array([[(-1.0, -1.0, -1.0), (1.0, -1.0, -1.0)], [(-1.0, 1.0, -1.0), (1.0, 1.0, -1.0)]])
    return [*faces, asm.Face(asm.NurbsSurface(corners, (line, line), (1, 1)), name="bottom")]


def figure_9(count: int = 400) -> SimpleNamespace:
    """Closest features along a path around the solid, and what a controller on its top finds meanwhile."""
    faces = dome()
    # A point, as a ball that is too small to matter.
    tracker = asm.proximity.FeatureTracker(faces, asm.shapes.sphere(1e-3))
    control = asm.proximity.Controller(faces[0], (0, 0, 0), start=(0.05, 0.95))
    angle = np.linspace(np.radians(-10.0), np.radians(110.0), count)
    q = np.zeros((count, 7))
    q[:, 0], q[:, 1], q[:, 2], q[:, 3] = 2.4 * np.sin(angle), 0.3 * np.cos(angle), 2.4 * np.cos(angle), 1.0
    control.run(1_000, q_target=q[0])  # to rest, from a corner
    pairs = [tracker.step(q_b=row) for row in q]
    runs = [control.step(q_target=row, dt=1.0 / count) for row in q]
    return SimpleNamespace(
        features=[pair.features[0].name for pair in pairs],
        parameters=np.array([pair.parameters[0] for pair in pairs]),
        top=np.array([run.parameters[-1] for run in runs]),
        modes=[run.modes[0] for run in runs],
        times=np.linspace(0.0, 1.0, count),
    )


def changes(names: list[str]) -> list[int]:
    """Where a sequence takes a new value, its beginning included."""
    return [k for k in range(len(names)) if k == 0 or names[k] != names[k - 1]]


def picture(six: asm.proximity.ControlRun, seven: dict, eight: dict, nine: SimpleNamespace) -> None:
    """All four, a row each for the way and for the numbers."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 4, figsize=(18, 8), layout="constrained")
    t = 1e-3 * np.arange(len(six.distance))
    axes[0, 0].plot(*six.parameters.T, ".-")
    axes[0, 0].set(title="6: way on the patch", xlabel="u", ylabel="v", xlim=(-0.02, 1), ylim=(0, 1))
    axes[1, 0].plot(t, six.distance, label="|D|")
    axes[1, 0].plot(t, six.error, label="|psi|")
    axes[1, 0].step(t, six.mode[:, 0], label="mode")
    axes[1, 0].set(xlabel="t [s]")
    for place, method in zip((axes[0, 1], axes[1, 1]), ("newton", "controller"), strict=True):
        place.imshow(seven[method].T, origin="lower", extent=(0, 1, 0, 1), cmap="gray", vmin=0, vmax=1)
        place.set(title=f"7: starts that arrive, {method}", xlabel="u", ylabel="v")
    t = STEP * np.arange(round(1.0 / STEP) + 1)
    for gain in (0.02, 50.0, 1300.0):
        axes[0, 2].semilogy(t, eight[gain, False].error, label=f"K = {gain:g}")
    axes[0, 2].set(title="8: |psi|", xlabel="t [s]")
    for feedforward in (False, True):
        axes[1, 2].semilogy(t, eight[50.0, feedforward].error, label="feed-forward" if feedforward else "K = 50")
    axes[1, 2].set(xlabel="t [s]")
    axes[0, 3].plot(nine.times, nine.top, label=["u of the top", "v of the top"])
    axes[0, 3].set(title="9: around a solid", xlabel="t [s]")
    names = list(dict.fromkeys(nine.features))
    axes[1, 3].plot(nine.times, [names.index(name) for name in nine.features])
    axes[1, 3].set(yticks=range(len(names)), yticklabels=names, xlabel="t [s]")
    for place in (axes[1, 0], axes[0, 2], axes[1, 2], axes[0, 3]):
        place.legend()
    figure.savefig("patoglu_gillespie.png", dpi=80)
    pyplot.close(figure)


def main() -> SimpleNamespace:
    six, seven, eight, nine = figure_6(), figure_7(), figure_8(), figure_9()
    print("figure 6: mode, from [s]")
    names = [MODES[k] for k in six.mode[:, 0]]
    for k in changes(names):
        print(f"  {names[k]:<9}{1e-3 * k:6.3f}   |D| = {six.distance[k]:.4f}")
    print(f"  closest point at u, v = {six.parameters[-1, 0]:.4f}, {six.parameters[-1, 1]:.4f}: {six.distance[-1]:.6f}")
    print("figure 7: starts that lead to the closest point")
    for method, right in seven.items():
        print(f"  {method:<17}{right.sum():4d} of {right.size}")
    print("figure 8: |psi| over the second half of the path")
    for (gain, feedforward), run in eight.items():
        print(
            f"  K = {gain:<6g}{'feed-forward' if feedforward else '':<14}{run.error[len(run.error) // 2 :].max():.2e}"
        )
    print("figure 9: closest feature, from [s]")
    for k in changes(nine.features):
        print(f"  {nine.features[k]:<27}{nine.times[k]:.3f}")
    if find_spec("matplotlib"):
        picture(six, seven, eight, nine)
    return SimpleNamespace(six=six, seven=seven, eight=eight, nine=nine)


if __name__ == "__main__":
    main()
