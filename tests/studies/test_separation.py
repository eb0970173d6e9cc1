"""Bodies that cross at the start: whether ways apart are looked for as long as there is time."""

from __future__ import annotations

import pytest

import assembly as asm
from assembly.solve.interruption import Interruption
from assembly.studies import separation


@pytest.fixture
def asked(monkeypatch):
    """How many pairs were looked at, in a list of one number."""
    count, crossing = [0], separation._crossing

    def counting(*arguments):
        count[0] += 1
        return crossing(*arguments)

    monkeypatch.setattr(separation, "_crossing", counting)
    return count


def stack(count):
    """Boxes of which each is deep in the next, all kept apart."""
    scene = asm.Assembly(asm.Body(f"{k}", asm.shapes.box(1, 1, 1), (0.0, 0.0, 0.4 * k)) for k in range(count))
    scene.constrain(asm.Clearance())
    return scene


def test_bodies_are_moved_apart(asked):
    scene = stack(3)
    poses = separation.separated(scene, scene.q, {}, Interruption())
    assert poses is not None and asked[0] >= 3
    heights = sorted(poses[:, 2])
    assert all(upper - lower >= 1.0 - 1e-9 for lower, upper in zip(heights, heights[1:], strict=False))


def test_no_pair_is_looked_at_where_time_is_over(asked, monkeypatch):
    scene = stack(3)
    limit = Interruption(time_limit=1e6)
    over = iter([False, False, True])
    monkeypatch.setattr(limit, "is_over", lambda: next(over))
    assert separation.separated(scene, scene.q, {}, limit) is None
    assert asked[0] == 2
