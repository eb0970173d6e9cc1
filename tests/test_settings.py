"""Names of settings, and values that were taken in silence or failed far from where they were given."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.test_bad_input import contact, pair


@pytest.mark.parametrize(
    ("make", "name", "settable"),
    [
        (lambda: asm.Revolute(*pair()), "angle_limits", "'angle', 'enabled', 'limits'"),
        (lambda: asm.Distance(*pair(), 1.0), "distance", "'enabled', 'limits', 'value'"),
        (lambda: asm.PointDistance(pair()[1].point(0, 0, 0), (0, 0, 0)), "targets", "'target'"),
        (lambda: contact(), "least", "'enabled', 'minimum'"),
        (lambda: pair()[1], "position", "'color', 'density', 'fixed', 'picture', 'pose'"),
    ],
    ids=["joint", "value", "objective", "contact", "body"],
)
def test_settings_of_another_name_are_refused(make, name, settable):
    one = make()
    with pytest.raises(AttributeError, match=f"{type(one).__name__} has no '{name}'; expected {settable}"):
        setattr(one, name, (1.0, 2.0))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: asm.Assembly(5), "bodies is 5; expected bodies, at least one"),
        (lambda: asm.Assembly(pair()[0]), "bodies is Body.*; expected bodies, at least one"),
        (lambda: asm.Clearance(pair()[0]), "bodies is Body.*; expected two bodies or more"),
        (lambda: asm.Loop(3), "loop is 3; expected one NurbsCurve or several"),
    ],
)
def test_what_cannot_be_gone_through_is_named(call, message):
    with pytest.raises(TypeError, match=message):
        call()


@pytest.mark.parametrize("weights", [[1e-320, 1e-320], [1e300, 1.0], [1.0, 1e308]])
def test_weights_whose_products_overflow_or_vanish(weights):
    with pytest.raises(InputError, match=r"weights\[[01]\] is .*; expected weights from 1e-100 to 1e\+100"):
        asm.NurbsCurve([(0, 0), (1, 1)], [0, 0, 1, 1], 1, weights)


@pytest.mark.parametrize("value", ["0.5", ["0.1", "0.2"], True, 10**400])
def test_parameters_are_numbers(value):
    with pytest.raises(InputError, match="expected real numbers"):
        asm.NurbsCurve([(0, 0), (1, 1)], [0, 0, 1, 1], 1).evaluate(value)


def test_an_arc_of_next_to_nothing_is_one_piece():
    path = asm.shapes.Path().line(1.0).arc(1.0, 1e-12, (1.0, 0.0, 0.0))
    assert len(path.pieces) == 2


@pytest.mark.parametrize("what", ["task", "measure"])
def test_words_of_a_dexterity_are_words(what):
    arm = asm.Body("arm")
    hinge = asm.Revolute(asm.Body("ground", fixed=True), arm)
    with pytest.raises(InputError, match=f"{what} is .*; expected one of"):
        asm.Dexterity(arm.point(1, 0, 0), [hinge], **{what: np.zeros(2)})


@pytest.mark.parametrize("length", [1e300, 1e-300])
def test_lengths_whose_squares_overflow_or_vanish(length):
    with pytest.raises(InputError, match="length is .*; expected a length from 1e-100"):
        asm.FrameDistance(asm.Body("b"), asm.Pose(), length)


def test_a_title_is_a_string(tmp_path):
    with pytest.raises(InputError, match="title is 3; expected a string or None"):
        asm.view.save_html(tmp_path / "a.html", asm.Assembly(pair()), title=3)
