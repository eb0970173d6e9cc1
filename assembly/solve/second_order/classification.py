"""What a stationary point is: a minimum, one of many, or a saddle, which has lower poses beside it.

With Z a basis of the motions that keep the rows which push (two-sided ones, and one-sided ones with a force), and H the
Hessian of the Lagrangian, the signs of Z^T H Z decide. One-sided rows that touch without a force bound a cone; a
negative form counts where it is so within the cone. Where rows depend on each other their multipliers are open, and
some motions that keep them to first order do not exist: a minimum needs for each of them one set of multipliers for
which the form is positive. See docs/derivations.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.scene import Packed
from assembly.constraints.program.records import MOVING
from assembly.solve.dense.rank import orthonormal
from assembly.solve.second_order.dense import CUT, DEPENDENT, LocalModel, null_space

__all__ = ["SecondOrder", "Verdict", "Way", "judge", "judge_kink"]

Array = NDArray[np.float64]
# Curvature over the largest that counts as none; where Hessians are differences. Negative curvature of more than CLEAR
# is there for certain: beside a pose that is singular it may be a trace of higher orders.
FLAT, DIFFERENCED, CLEAR = 1e-8, 1e-4, 1e-5
# How far is sampled along motions of no curvature, lengths over the size and radians; mixtures of them besides.
SAMPLES, MIXTURES = (1e-2, 3e-2, 1e-1), 4
# By how much more than in proportion to the way it falls, from sample to sample: what rows that all but depend on each
# other leave of it is in proportion.
FASTER = 4.0
# Of so many one-sided rows without a force all faces of their cone are judged. A way breaks none by more.
FACES, WITHIN = 8, 1e-9
# Ways of negative curvature that are followed; what it is capped at, because kinks seem steeper than anything.
WAYS, STEEPEST = 3, 10.0
# Curvatures that are the same: of their directions a basis is taken that rounding does not choose. Digits of these.
ALIKE, DIGITS = 1e-6, 6
# Steps toward multipliers of which the form is not negative: of one combination of rows halvings of its range; how much
# of a combination counts.
HALVINGS, RANGE, CLIMBS, BENDS = 70, 1e6, 40, 1e-6
# Dense decompositions of more unknowns take longer than a solve.
MOST_UNKNOWNS = 360


class SecondOrder(StrEnum):
    """What a stationary point was found to be."""

    MINIMUM = "minimum"
    """Curvature is positive along all motions that are left."""
    NOT_ISOLATED = "not isolated"
    """No curvature is negative; along some motions there is none."""
    UNDECIDED = "undecided"
    """Derivatives of second order do not decide; no lower pose was found."""
    SADDLE = "saddle"
    """Lower poses are beside it."""
    NO_OBJECTIVE = "no objective"
    """None was asked for: constraints hold, and the least move is a preference that is not proved."""


@dataclass(frozen=True, eq=False)
class Way:
    """A direction of length one in the unknowns, the curvature along it, and how far to go first."""

    direction: Array
    curvature: float
    share: float = 0.02


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a point is, and the ways along which lower poses are expected, the steepest first.

    Where rows depend on each other, so that multipliers are open, `forces` are those (m,) with the least negative form.
    """

    kind: SecondOrder
    ways: list[Way] = field(default_factory=list)
    forces: Array | None = None


def judge(packed: Packed, state: Array, sample: bool) -> tuple[Verdict, LocalModel | None]:
    """What the stationary point of a state, or one near it, is; with `sample` motions of no curvature are followed."""
    if 6 * packed.table[MOVING] + 4 * packed.pair_rows > MOST_UNKNOWNS:
        model = LocalModel.coarse(packed, state)
        return (Verdict(SecondOrder.UNDECIDED) if model is None else judge_coarse(model)), model
    model = LocalModel.at(packed, state)
    return (Verdict(SecondOrder.UNDECIDED) if model is None else judge_model(model, sample)), model


def judge_model(model: LocalModel, sample: bool) -> Verdict:
    """The same of a model."""
    pushing = model.pushing
    basis = null_space(model.jacobian[pushing], len(model.gradient))
    if not basis.shape[1]:
        return Verdict(SecondOrder.MINIMUM)
    form = _symmetric(basis.T @ model.hessian @ basis)
    values, vectors = np.linalg.eigh(form)
    flat = (DIFFERENCED if model.packed.end_effectors else FLAT) * max(1.0, float(np.abs(model.hessian).max()))
    # Rows without a force that no such motion changes to first order say by their curvature which ones exist.
    closed = model.touching & ~pushing
    closed[closed] = np.linalg.norm(model.jacobian[closed] @ basis, axis=1) <= DEPENDENT
    forces: Array | None = None
    if values[0] < -flat:
        bends = _bends(model, pushing | closed, basis)
        if bends:
            form, forces = _least_negative(model, form, bends)
            values, vectors = np.linalg.eigh(form)
    depends = forces is not None
    if values[0] > flat:
        return Verdict(SecondOrder.MINIMUM, forces=forces)
    cone = model.jacobian[model.touching & ~pushing & ~closed]
    ways = list(_downward(form, basis, cone, flat)) if values[0] < -flat else []
    if ways and depends:
        # A way may exist to first order only, and lead nowhere; motions that exist are found by trying.
        ways = ways[:WAYS] + _sampled(model, _canonical(basis), cone, MIXTURES * basis.shape[1], FASTER).ways
    if ways:
        is_certain = not depends and ways[0].curvature < -CLEAR * max(1.0, float(np.abs(model.hessian).max()))
        return Verdict(SecondOrder.SADDLE if is_certain else SecondOrder.UNDECIDED, ways)
    if values[0] < -flat and len(cone) > FACES:
        return Verdict(SecondOrder.UNDECIDED)
    zeros = vectors[:, np.abs(values) <= flat]
    if not zeros.shape[1]:
        return Verdict(SecondOrder.MINIMUM, forces=forces)
    if not sample:
        return Verdict(SecondOrder.NOT_ISOLATED, forces=forces)
    return _sampled(model, _canonical(basis @ zeros), cone, MIXTURES, FASTER)


def judge_coarse(model: LocalModel) -> Verdict:
    """Of a large scene: whether its least curvature is negative."""
    curvature, direction = model.least_curvature()
    if not curvature < -FLAT:
        return Verdict(SecondOrder.UNDECIDED)
    ways = [Way(np.round(d, DIGITS), curvature) for d in (direction, -direction)]
    is_certain = curvature < -CLEAR and not (model.touching & ~model.pushing).any()
    return Verdict(SecondOrder.SADDLE if is_certain else SecondOrder.UNDECIDED, ways)


def judge_kink(packed: Packed, state: Array) -> tuple[Verdict, LocalModel | None]:
    """Ways down from a pose that holds and at which the objective has no derivatives: all motions are sampled."""
    model = LocalModel.at_kink(packed, state)
    if model is None:
        return Verdict(SecondOrder.UNDECIDED), None
    basis = null_space(model.jacobian[~model.one_sided], len(model.gradient))
    cone = model.jacobian[model.one_sided & model.touching]
    return _sampled(model, _canonical(basis), cone, MIXTURES, 0.0), model


def _symmetric(matrix: Array) -> Array:
    return 0.5 * matrix + 0.5 * matrix.T


@dataclass(frozen=True, eq=False)
class _Bend:
    """A combination z of rows that vanishes, z^T J = 0, and what it adds to the form: Z^T (z . c'') Z.

    Along a motion that says how much the rows cannot be kept along it.
    """

    forces: Array
    form: Array

    def share_left(self, model: LocalModel, forces: Array, sign: float = 1.0) -> float:
        """How much of the combination multipliers may get before one of a one-sided row pulls."""
        change = sign * self.forces[model.one_sided]
        grows = change > BENDS
        return float((np.maximum(-forces[model.one_sided][grows], 0.0) / change[grows]).min(initial=RANGE))


def _bends(model: LocalModel, pushing: NDArray[np.bool_], basis: Array) -> list[_Bend]:
    """What open multipliers of the rows that push may change of the form."""
    rows = np.flatnonzero(pushing)
    lengths = np.linalg.norm(model.jacobian[rows], axis=1)
    scales = np.where(lengths > DEPENDENT, 1.0 / np.maximum(lengths, DEPENDENT), 1.0)
    scaled = np.where((lengths > DEPENDENT)[:, None], model.jacobian[rows] * scales[:, None], 0.0)
    left, values, _ = np.linalg.svd(scaled, full_matrices=True)
    bends: list[_Bend] = []
    for z in left[:, int(np.count_nonzero(values > DEPENDENT)) :].T:
        forces = np.zeros(len(model.forces))
        forces[rows] = z * scales
        other = model.under(model.forces + forces)
        if other is not None:
            form = _symmetric(basis.T @ (other.hessian - model.hessian) @ basis)
            if np.abs(form).max() > BENDS:
                bends.append(_Bend(forces, form))
    return bends


def _least_negative(model: LocalModel, form: Array, bends: list[_Bend]) -> tuple[Array, Array]:
    """The form with those multipliers of which its least eigenvalue, concave in them, is greatest; and these."""
    if len(bends) == 1:
        share = _along(model, form, bends[0])
        return form + share * bends[0].form, model.forces + share * bends[0].forces
    forces = model.forces
    best, highest = (form, forces), -np.inf
    for _ in range(CLIMBS):
        values, vectors = np.linalg.eigh(form)
        least = float(values[0])
        if least > highest:
            best, highest = (form, forces), least
        slopes = np.array([vectors[:, 0] @ bend.form @ vectors[:, 0] for bend in bends])
        square = float(slopes @ slopes)
        if least > 0.0 or square < BENDS**2:
            break
        # As far as makes this direction positive by as much as it was negative.
        wanted = (0.1 - 2.0 * least) / square
        whole = _upward(model, forces, slopes, bends)
        share = min(wanted, whole.share_left(model, forces))
        form = form + share * whole.form
        forces = forces + share * whole.forces
    return best


def _upward(model: LocalModel, forces: Array, slopes: Array, bends: list[_Bend]) -> _Bend:
    """The combination along slopes, without what would make a one-sided row pull that has no force to lose."""
    all_forces = [bend.forces for bend in bends]
    mixed = _mixed(slopes, all_forces)
    for _ in bends:
        held = model.one_sided & (forces >= 0.0) & (mixed > BENDS)
        if not held.any():
            break
        grows = np.array(all_forces)[:, held].T
        slopes = slopes - np.linalg.lstsq(grows, grows @ slopes, rcond=CUT)[0]
        mixed = _mixed(slopes, all_forces)
    return _Bend(mixed, _mixed(slopes, [bend.form for bend in bends]))


def _mixed(shares: Array, parts: list[Array]) -> Array:
    mixed: Array = np.tensordot(shares, np.array(parts), axes=1)
    return mixed


def _along(model: LocalModel, form: Array, bend: _Bend) -> float:
    """How much of one combination does so, by bisection on the slope of the least eigenvalue."""
    low, high = -bend.share_left(model, model.forces, -1.0), bend.share_left(model, model.forces)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        vector = np.linalg.eigh(form + middle * bend.form)[1][:, 0]
        low, high = (middle, high) if vector @ bend.form @ vector > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _downward(form: Array, basis: Array, cone: Array, flat: float) -> Iterator[Way]:
    """Directions that break no row of the cone along which the form is negative; of few rows those on all its faces.

    A least direction of the form within the cone is one on a face: an eigenvector of the form on the motions that keep
    some of the rows.
    """
    kept_rows = (kept for k in range(len(cone) + 1) for kept in combinations(range(len(cone)), k))
    for kept in islice(kept_rows, 2**FACES):
        face = null_space(cone[list(kept)] @ basis, len(form)) if kept else np.eye(len(form))
        if not face.shape[1]:
            continue
        values, vectors = np.linalg.eigh(face.T @ form @ face)
        downward = values < -flat
        for curvature, alike in _alike(values[downward], vectors[:, downward]):
            for direction in _canonical(basis @ face @ alike).T:
                for d in (direction, -direction):
                    if (cone @ d >= -WITHIN).all():
                        yield Way(np.round(d, DIGITS), max(curvature, -STEEPEST))


def _alike(values: Array, vectors: Array) -> Iterator[tuple[float, Array]]:
    """The first few values, those that are the same up to rounding at a time, with their vectors (columns)."""
    at = 0
    while at < min(len(values), WAYS):
        count = int(np.count_nonzero(values[at:] <= values[at] + ALIKE * abs(values[at])))
        yield float(values[at]), vectors[:, at : at + count]
        at += count


def _canonical(directions: Array) -> Array:
    """An orthonormal basis of a span (columns) that does not depend on how it is given."""
    return orthonormal(directions.T).T


def _sampled(model: LocalModel, motions: Array, cone: Array, mixtures: int, growth: float) -> Verdict:
    """What the objective does along motions (columns), on both sides, and along random mixtures of them.

    It falls along one where it does so by more than `growth` times as much at one sample as at the one before.
    """
    rng = np.random.default_rng(0)
    count = motions.shape[1]
    mixed = rng.normal(size=(count, mixtures if count > 1 else 0))
    lines = np.hstack([motions, motions @ (mixed / np.linalg.norm(mixed, axis=0))])
    ways: list[Way] = []
    level = True
    for line in np.round(np.hstack([lines, -lines]).T, DIGITS):
        if (cone @ line < -WITHIN).any():
            continue
        falls = [0.0]
        for share in SAMPLES:
            there = model.neighbor(line, share)
            if there is None or there.rise > 0.0:
                level = False
                break
            falls.append(-there.rise)
        if len(falls) > 2 and falls[-1] > growth * falls[-2]:
            share = SAMPLES[len(falls) - 2]
            ways.append(Way(line, -2.0 * falls[-1] / share**2, share))
        level = level and not any(falls)
    # A fall is followed before it is believed: rows that depend on each other are off by more than rounding of others.
    kind = SecondOrder.NOT_ISOLATED if level else SecondOrder.UNDECIDED
    return Verdict(kind, sorted(ways, key=lambda way: way.curvature))
