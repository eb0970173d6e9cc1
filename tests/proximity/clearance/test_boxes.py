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
        rho, disc = rng.uniform(0.0, 0.1, (2, m))
        rulings = rng.standard_normal((m, 3))
        rulings /= np.linalg.norm(rulings, axis=1)[:, None]
        cells = corners, rho, disc, rulings
        members = [rng.permutation(m)[: rng.integers(1, m + 1)] for _ in range(6)]
        boxes = boxes_around(*cells, Groups.of(members))
        for k, group in enumerate(members):
            alone = boxes_around(*cells, Groups.of([group]))
            for all_at_once, one in zip(boxes, alone, strict=True):
                np.testing.assert_allclose(all_at_once[k], one[0], atol=1e-12)
            axes = boxes.axes[k]
            np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
            assert np.linalg.det(axes) > 0.0
            points, around = corners[group].reshape(-1, 3), np.repeat((rho + disc)[group], 4)
            off = points - boxes.center[k]

            def reach(ways, rho=rho[group], disc=disc[group], rulings=rulings[group]):
                # A disc reaches along a direction by the part of that across its ruling.
                flat = np.sqrt(1.0 - (rulings @ ways.T) ** 2)
                return np.repeat(rho[:, None] + disc[:, None] * flat, 4, axis=0)

            assert (np.abs(off @ axes.T) + reach(axes) <= boxes.half[k] + 1e-14).all()
            assert (np.linalg.norm(off, axis=1) + around <= boxes.radius[k] + 1e-14).all() or np.isclose(
                boxes.radius[k], np.linalg.norm(boxes.half[k])
            )
            assert boxes.radius[k] <= np.linalg.norm(boxes.half[k]) * (1.0 + 1e-12)
            # No larger than a box along the body's axes, by what is put up with for these.
            straight = np.ptp(np.concatenate([points - reach(np.eye(3)), points + reach(np.eye(3))]), axis=0)
            padded = [(0.5 * s + 0.025 * s.max()).prod() for s in (2.0 * boxes.half[k], straight)]
            assert padded[0] <= 1.021 * padded[1]
