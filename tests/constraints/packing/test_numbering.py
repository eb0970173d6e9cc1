"""The order of bodies among the unknowns is scipy's reverse Cuthill-McKee order, without loading scipy for it."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee as reference

from assembly.constraints.packing.numbering import number_bodies, reverse_cuthill_mckee


def test_orders_of_random_graphs_are_those_of_scipy(cases):
    rng = np.random.default_rng(0)
    for case in range(cases(200, 5000)):
        count = int(rng.integers(1, 80))
        meets = rng.random((count, count)) < (rng.uniform(0.0, 0.3) if case % 2 else 2.0 / count)
        meets |= meets.T
        meets[np.diag_indices(count)] = meets.any(axis=1) | (rng.random(count) < 0.5)
        rows, columns = np.nonzero(meets)
        if not len(rows):
            continue
        graph = csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count))
        mine = reverse_cuthill_mckee([np.flatnonzero(row).tolist() for row in meets])
        assert mine == reference(graph, symmetric_mode=True).tolist()


def test_few_bodies_keep_their_order_and_fixed_ones_have_none():
    assert number_bodies([True, False, False], [(0, 1), (1, 2)]).tolist() == [-1, 0, 1]
    # Of a chain whose links are given in any order neighbors stand side by side.
    order = [0, 4, 1, 3, 5, 2]
    blocks = number_bodies([False] * 6, [(order[k], order[k + 1]) for k in range(5)])
    assert (np.abs(np.diff(blocks[order])) == 1).all()
    assert sorted(number_bodies([False] * 6, []).tolist()) == list(range(6))
