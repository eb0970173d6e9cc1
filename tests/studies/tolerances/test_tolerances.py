"""Stacks of tolerances against closed forms, and against samples that are solved in full."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.studies.tolerances.first_order import FirstOrder


def stack(lengths):
    """Blocks in a row in a housing of a width: the gap that is left, and the parameters."""
    width = sum(lengths) + 1.0
    ground = asm.Body("ground", fixed=True)
    blocks = [asm.Body(f"block {k}") for k in range(len(lengths))]
    scene, before, parameters = asm.Assembly([ground, *blocks]), ground, []
    at = 0.0
    for k, (length, block) in enumerate(zip(lengths, blocks, strict=True)):
        joint = asm.Fixed(before.frame(at=(at, 0, 0)), block, f"seat {k}")
        scene.constrain(joint)
        if k:
            parameters.append(asm.Parameter(joint.frame_a, "origin", "x", name=f"L{k}"))
        before, at = block, length
    end = blocks[-1].frame(at=(lengths[-1], 0, 0))
    wall = ground.frame(at=(width, 0, 0))
    lid = asm.Body("lid", position=(width, 0, 0))
    closing = asm.Fixed(wall, lid, "wall")
    last = asm.Body("end")
    tie = asm.Fixed(end, last, "end of the row")
    whole = asm.Assembly([*scene.bodies, lid, last])
    whole.constrain(*scene.constraints, closing, tie)
    parameters.append(asm.Parameter(tie.frame_a, "origin", "x", name=f"L{len(lengths)}"))
    parameters.append(asm.Parameter(closing.frame_a, "origin", "x", name="W"))
    return whole, asm.Measure((last, lid), name="gap"), parameters


def test_a_linear_stack_is_exact():
    scene, gap, parameters = stack([3.0, 5.0, 2.0])
    sigmas = [0.01, 0.02, 0.03, 0.04]
    solution = scene.solve()
    found = asm.tolerances(scene, solution, gap, dict(zip(parameters, map(asm.Normal, sigmas), strict=True)))
    assert found.nominal[0] == pytest.approx(1.0, abs=1e-12)
    assert found.sigma[0] == pytest.approx(np.sqrt(np.sum(np.square(sigmas))), rel=1e-12)
    assert found.worst[0] == pytest.approx([1.0 - 3.0 * sum(sigmas), 1.0 + 3.0 * sum(sigmas)], abs=1e-12)
    assert found.contributions[0] == pytest.approx(np.square(sigmas) / np.sum(np.square(sigmas)), abs=1e-12)
    # Differences of derivatives that are equal but for rounding, over steps of half a sigma.
    assert abs(found.mean_shift[0]) < 1e-12


def test_samples_scatter_as_the_stack_says():
    scene, gap, parameters = stack([3.0, 5.0, 2.0])
    scatter = {parameters[0]: asm.Uniform(0.05), parameters[1]: asm.Normal(0.02), parameters[3]: asm.Uniform(0.03)}
    solution, count = scene.solve(), 4000
    one, two = (
        asm.tolerances(scene, solution, gap, scatter, samples=count, seed=3, limits={gap: (0.95, None)})
        for _ in range(2)
    )
    variance = 0.05**2 / 3.0 + 0.02**2 + 0.03**2 / 3.0
    assert one.sigma[0] ** 2 == pytest.approx(variance, rel=1e-12)
    # Three of the errors that such numbers of samples have.
    assert one.sampled_sigma[0] == pytest.approx(one.sigma[0], rel=3.0 / np.sqrt(2.0 * count))
    assert one.mean[0] == pytest.approx(1.0, abs=3.0 * one.sigma[0] / np.sqrt(count))
    gaps = one.nominal[0] + (one.samples.inputs - [p.value for p in scatter]) @ one.derivatives.matrix[0]
    np.testing.assert_allclose(one.samples.values[:, 0], gaps, rtol=0, atol=1e-11)
    assert one.yields == (gaps >= 0.95).mean()
    # The same seed, the same bits; and the scene is as it was.
    assert (one.samples.values == two.samples.values).all()
    assert scene.solve(solution).q.tobytes() == solution.q.tobytes()


def test_a_curved_measure_has_another_mean():
    """The distance of a crank's end from a point beside its pivot: second derivatives by differences of first ones."""
    ground, crank = asm.Body("ground", fixed=True), asm.Body("crank")
    scene = asm.Assembly([ground, crank])
    hinge = asm.Revolute(ground, crank, "hinge", angle=0.4)
    scene.constrain(hinge)
    height = asm.Measure(crank.point(3.0, 0.0, 0.0), "y")
    angle = asm.Parameter(hinge, "angle")
    sigma = 0.05
    found = asm.tolerances(scene, scene.solve(), height, {angle: asm.Normal(sigma)})
    # y = 3 sin a; differences of the fourth order in steps of 0.025 are off by 1e-7 of the second derivative.
    assert found.mean_shift[0] == pytest.approx(-1.5 * np.sin(0.4) * sigma**2, rel=1e-6)
    assert found.sigma[0] == pytest.approx(3.0 * np.cos(0.4) * sigma, rel=1e-12)


def test_a_stop_that_is_just_reached_counts_half():
    """A slide that is drawn against a stop, its free optimum exactly there: only a lower stop moves it."""
    ground, slider = asm.Body("ground", fixed=True), asm.Body("slider")
    slide = asm.Prismatic(ground, slider, "slide", limits=(None, 1.0))
    scene = asm.Assembly([ground, slider])
    scene.constrain(slide)
    scene.minimize(asm.PointDistance(slider.point(0, 0, 0), (0, 0, 1.0)))
    stop, place = asm.Parameter(slide, "limits", 1, name="stop"), asm.Measure(slide)
    solution = scene.solve()
    sigma = 0.1
    found = asm.tolerances(scene, solution, place, {stop: asm.Normal(sigma)}, samples=4000, seed=1)
    # min(0, x) of a normal x: mean -sigma / sqrt(2 pi), mean square sigma^2 / 2.
    assert found.mean_shift[0] == pytest.approx(-sigma / np.sqrt(2.0 * np.pi), rel=1e-9)
    assert found.sigma[0] ** 2 == pytest.approx(sigma**2 * (0.5 - 0.5 / np.pi), rel=1e-9)
    assert found.worst[0] == pytest.approx([1.0 - 3.0 * sigma, 1.0], abs=1e-9)
    # min(0, x) of x within w: mean -w / 4, mean square w^2 / 6.
    even = asm.tolerances(scene, solution, place, {stop: asm.Uniform(sigma)})
    assert even.mean_shift[0] == pytest.approx(-0.25 * sigma, rel=1e-9)
    assert even.sigma[0] ** 2 == pytest.approx(sigma**2 * (1.0 / 6.0 - 1.0 / 16.0), rel=1e-9)
    assert found.mean[0] == pytest.approx(1.0 + found.mean_shift[0], abs=3.0 * sigma / np.sqrt(4000))
    assert found.sampled_sigma[0] == pytest.approx(found.sigma[0], rel=0.05)


def test_samples_without_a_solution_are_told():
    """A rod that is now and then too short to close the loop."""
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1, 0, 0))
    scene = asm.Assembly([ground, crank, rod])
    hinge = asm.Revolute(ground, crank, "hinge", angle=1.2)
    pin = asm.Revolute(crank.frame(at=(1, 0, 0)), rod, "pin")
    way = asm.PointOnPlane(rod.point(1, 0, 0), ground.frame(z=(0, 1, 0)), "way")
    scene.constrain(hinge, pin, way)
    solution = scene.solve()
    length = asm.Parameter(way.frame_b, "origin", "x", name="rod")
    place = asm.Measure(rod, "x")
    found = asm.tolerances(scene, solution, [place, asm.Measure(pin)], {length: asm.Normal(0.05)}, samples=200, seed=2)
    # A rod shorter than the height of the pin, sin 1.2, reaches no way.
    short = found.samples.inputs[:, 0] < np.sin(1.2)
    assert 0 < short.sum() < 200 and found.samples.failed == short.sum()
    assert np.isnan(found.samples.values[short]).all() and np.isfinite(found.samples.values[~short]).all()
    assert f"{short.sum()} without a solution" in str(found)


def test_plots(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    scene, gap, parameters = stack([3.0, 5.0])
    scatter = dict.fromkeys(parameters, asm.Normal(0.01))
    found = asm.tolerances(scene, scene.solve(), gap, scatter, samples=50, limits={gap: (0.9, 1.1)})
    figure = found.plot()
    figure.savefig(tmp_path / "stack.png")
    assert len(figure.axes) == 2 and len(figure.axes[1].patches) == len(parameters)
    assert (tmp_path / "stack.png").stat().st_size > 5000


def test_bad_arguments():
    scene, gap, parameters = stack([3.0, 5.0])
    solution, scatter = scene.solve(), {parameters[0]: asm.Normal(0.01)}
    for arguments, error, text in (
        (dict(of=gap, parameters={}), TypeError, "expected a mapping of Parameter"),
        (
            dict(of=gap, parameters={parameters[0]: 0.1}),
            TypeError,
            r"parameters\['L1'\] is 0.1; expected Normal or Uniform",
        ),
        (dict(of=gap, parameters={"L1": asm.Normal(1)}), TypeError, "has the key 'L1'; expected a Parameter"),
        (dict(of=gap, parameters=scatter, samples=-1), InputError, "samples is -1"),
        (dict(of=gap, parameters=scatter, limits={gap: (0, 1)}), InputError, "limits are given without samples"),
        (
            dict(of=gap, parameters=scatter, samples=5, limits={gap: (1, 0)}),
            InputError,
            "a lower limit below the upper",
        ),
        (dict(of=gap, parameters=scatter, samples=5, limits={gap: 3}), InputError, r"is 3; expected \(lower, upper\)"),
    ):
        with pytest.raises(error, match=text):
            asm.tolerances(scene, solution, **arguments)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="sigma is"):
            asm.Normal(wrong)
        with pytest.raises(InputError, match="half_width is"):
            asm.Uniform(wrong)
    found = asm.tolerances(scene, solution, gap, scatter)
    with pytest.raises(InputError, match="no samples were drawn"):
        _ = found.yields


def test_play_between_stops_that_scatter():
    """A slider between two stops: it is anywhere between them, and each stop moves its end alone."""
    ground, slider = asm.Body("ground", fixed=True), asm.Body("slider", position=(0, 0, 0.2))
    slide = asm.Prismatic(ground, slider, "slide", limits=(-0.5, 1.0))
    scene = asm.Assembly([ground, slider])
    scene.constrain(slide)
    low, high = (asm.Parameter(slide, "limits", k, name=name) for k, name in enumerate(("low", "high")))
    scatter, place = {low: asm.Uniform(0.02), high: asm.Normal(0.05)}, asm.Measure(slide)
    solution = scene.solve()
    found = asm.tolerances(scene, solution, place, scatter, play=True, samples=2000, limits={place: (-0.4, None)})
    assert found.worst[0] == pytest.approx([-0.52, 1.15], abs=1e-12)
    assert found.mean_shift[0] == pytest.approx(0.25 - 0.2, abs=1e-9)
    variances = np.array([0.25 * 0.02**2 / 3.0, 0.25 * 0.05**2, 1.5**2 / 12.0])
    assert found.sigma[0] ** 2 == pytest.approx(variances.sum(), rel=1e-9)
    assert found.play_contributions[0] == pytest.approx(variances[2] / variances.sum(), rel=1e-9)
    assert found.contributions.sum() + found.play_contributions[0] == pytest.approx(1.0, abs=1e-14)
    # Of 2,000 samples the mean is off by 2.2 percent of the deviation, once in three runs.
    assert found.samples.failed == 0
    assert found.mean[0] == pytest.approx(0.25, abs=0.07 * found.sigma[0])
    assert found.sampled_sigma[0] == pytest.approx(found.sigma[0], rel=0.05)
    assert found.yields == pytest.approx(1.0 - 0.1 / 1.5, abs=0.02)
    assert "play from -0.5 to 1" in str(found)
    slide.limits = (-0.5, None)
    with pytest.raises(InputError, match="without a range"):
        asm.tolerances(scene, scene.solve(), place, {low: asm.Uniform(0.02)}, play=True)


def _drawn_arm(limit):
    """An arm of length 2 whose tip is drawn to (2, y), y = 1: it points there, unless a stop is before."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground, arm, "hinge", limits=(-1.0, limit)))
    goal = asm.PointDistance(arm.point(2, 0, 0), (2.0, 1.0, 0.0))
    scene.minimize(goal)
    return scene, asm.Measure(arm.point(2, 0, 0), "x"), asm.Parameter(goal, "target", "y")


@pytest.mark.parametrize(("beyond", "share"), [(0.0, 0.5), (0.003, 1.0), (1.0, 1.0), (-0.1, 0.0)])
def test_second_derivatives_are_those_of_either_side_of_a_stop(beyond, share):
    scene, tip, height = _drawn_arm(np.arctan2(1.0, 2.0) + beyond)
    solution = scene.solve(stationarity=1e-13)
    first = FirstOrder.of(scene, solution, [tip], [height], [asm.Normal(0.05)])
    # Of 4 / sqrt(4 + y^2); the stop takes the other side's share.
    bent = -4.0 * 5.0**-1.5 + 12.0 * 5.0**-2.5
    assert first.bent[0, 0] == pytest.approx(share * bent, abs=1e-3 if beyond == 0.0 else 1e-5)


def test_a_stop_next_to_a_solution_leaves_second_derivatives_open():
    scene, tip, height = _drawn_arm(np.arctan2(1.0, 2.0) + 1e-7)
    solution = scene.solve(stationarity=1e-13)
    found = asm.tolerances(scene, solution, tip, {height: asm.Normal(0.05)})
    assert np.isnan(found.mean_shift[0]) and "mean shift not known" in str(found)
