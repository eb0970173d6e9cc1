"""Studies whose rows have to be reached without going through anything."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.studies.scenes import swinging_arm


def past_a_post():
    """An arm about z and a post that it meets at `MEETS`: scene, drive, measure."""
    scene, drive = swinging_arm()
    return scene, asm.Parameter(drive, "angle", name="angle"), asm.Measure(drive, name="turned")


MEETS = 0.5 * np.pi - np.arcsin(0.15)


def test_rows_behind_what_is_in_the_way_are_blocked_and_say_by_what():
    scene, angle, turned = past_a_post()
    # Runs begin at every 32nd row, the second one here at a row that is blocked.
    plan = asm.grid({angle: np.append(np.linspace(0.0, 1.24, 32), [1.6, 1.3, 1.41, 2.4])})
    found = asm.study(scene, plan, turned, swept=True)
    beyond = found.plan.values[:, 0] > MEETS
    assert (found.table["status"] == np.where(beyond, "BLOCKED", "SOLVED")).all()
    np.testing.assert_allclose(found["turned"][~beyond], found.plan.values[~beyond, 0], rtol=0, atol=1e-12)
    assert np.isnan(found["turned"][beyond]).all()
    for message in found.table["message"][beyond]:
        assert message.startswith("blocked ") and "post and arm in each other's way near (0.09887, 0.985" in message
    solution = found.solution(5)
    assert solution.way.part == 1.0 and solution.proved
    # With steps this long a study that is not swept jumps over the post.
    jumped = asm.study(scene, asm.grid({angle: [0.0, 0.6, 1.2, 1.8]}), turned)
    assert jumped.success.all()
    stopped = asm.study(scene, asm.grid({angle: [0.0, 0.6, 1.2, 1.8]}), turned, swept=True)
    assert stopped.table["status"].tolist() == ["SOLVED", "SOLVED", "SOLVED", "BLOCKED"]
    part = float(stopped.table["message"][3].split()[1])
    assert part == pytest.approx((MEETS - 1.2) / 0.6, abs=2e-6)


def test_swept_studies_have_the_same_bits_and_folders_of_their_own(tmp_path):
    scene, angle, turned = past_a_post()
    plan = asm.grid({angle: [0.0, 0.5, 1.0, 1.5]})
    here = asm.study(scene, plan, turned, swept=True, folder=tmp_path)
    with ThreadPoolExecutor(1) as threads:
        there = asm.study(scene, plan, turned, swept=True, executor=threads)
    assert here["turned"].tobytes() == there["turned"].tobytes()
    assert here.table["message"].tolist() == there.table["message"].tolist()
    again = asm.study(scene, plan, turned, swept=True, folder=tmp_path)
    assert again["turned"].tobytes() == here["turned"].tobytes()
    with pytest.raises(InputError, match="swept"):
        asm.study(scene, plan, turned, folder=tmp_path)


def test_a_branch_that_ends_says_what_is_near():
    scene, angle, turned = past_a_post()
    found = asm.study(scene, asm.grid({angle: [1.2, 1.4, 1.6]}), turned)
    assert found.table["status"].tolist() == ["SOLVED", "SOLVED", "BRANCH_ENDED"]
    assert "; arm and post are 0.00" in found.table["message"][2]


def test_what_cannot_be_swept_raises():
    scene, angle, turned = past_a_post()
    plan = asm.grid({angle: [0.0, 0.5]})
    with pytest.raises(TypeError, match="swept is 1; expected True or False"):
        asm.study(scene, plan, turned, swept=1)
    with pytest.raises(InputError, match="swept is True with starts, between which there is no way"):
        asm.study(scene, asm.starts(4, 1), turned, swept=True)
    frame = asm.Parameter(scene.constraint("drive").frame_b, "origin", "x", name="reach")
    with pytest.raises(InputError, match="swept is True for reach, which changes the bodies or the joints"):
        asm.study(scene, asm.grid({frame: [-0.6, -0.5]}), turned, swept=True)
    scene.remove("clearance")
    with pytest.raises(InputError, match="swept is True where no clearance keeps bodies apart"):
        asm.study(scene, plan, turned, swept=True)
