"""Boxes around groups of cells hold these, all groups at once as each alone, and are not much larger than need be."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from assembly.proximity.clearance.boxes import Groups, boxes_around


def test_boxes_hold_their_cells(cases):
    rng = np.random.default_rng(0)
    for _ in range(cases(20, 500)):
        m = int(rng.integers(2, 40))
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
        corners = rng.standard_normal((m, 4, 3)) * [3.0, 1.0, rng.choice([0.0, 0.1])] @ turn.T + rng.standard_normal(3)
        thick = rng.uniform(0.0, 0.2, m)
        members = [rng.permutation(m)[: rng.integers(1, m + 1)] for _ in range(6)]
        boxes = boxes_around(corners, thick, Groups.of(members))
        for k, group in enumerate(members):
            alone = boxes_around(corners, thick, Groups.of([group]))
            for all_at_once, one in zip(boxes, alone, strict=True):
                np.testing.assert_allclose(all_at_once[k], one[0], atol=1e-12)
            axes = boxes.axes[k]
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
            assert np.linalg.det(axes) > 0.0
            points, around = corners[group].reshape(-1, 3), np.repeat(thick[group], 4)
            off = points - boxes.center[k]
            assert (np.abs(off @ axes.T) + around[:, None] <= boxes.half[k] + 1e-14).all()
            assert (np.linalg.norm(off, axis=1) + around <= boxes.radius[k] + 1e-14).all() or np.isclose(
                boxes.radius[k], np.linalg.norm(boxes.half[k])
            )
            assert boxes.radius[k] <= np.linalg.norm(boxes.half[k]) * (1.0 + 1e-12)
            # No larger than a box along the body's axes, by what is put up with for these.
            straight = np.ptp(np.concatenate([points - around[:, None], points + around[:, None]]), axis=0)
            padded = [(0.5 * s + 0.025 * s.max()).prod() for s in (2.0 * boxes.half[k], straight)]
            assert padded[0] <= 1.021 * padded[1]
