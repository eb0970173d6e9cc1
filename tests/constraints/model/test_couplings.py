from __future__ import annotations

import math

import pytest

import assembly as asm
from assembly.constraints.model.constraint import structure_changes
from assembly.errors import InputError

NAN, INF = math.nan, math.inf


def make(joint):
    return joint(asm.Body("ground"), asm.Body("crank"))


def wheels():
    ground, a, b = (asm.Body(name) for name in ("ground", "a", "b"))
    return asm.Revolute(ground, a), asm.Revolute(ground, b), asm.Prismatic(ground, b, name="rack")


def test_gear():
    first, second, _ = wheels()
    gear = asm.Gear(first, second.freedom(), ratio=-2, offset=0.5)
    assert gear.name == "gear ground-a-b" and [body.name for body in gear.bodies] == ["ground", "a", "b"]
    (row,) = gear.equations
    # angle_b - ratio angle_a = offset
    assert row.terms == ((1.0, second.freedom().coordinate), (2.0, first.freedom().coordinate))
    assert (row.current(), row.one_sided, row.is_drive, row.source) == (0.5, False, False, (gear, "offset"))
    before = structure_changes()
    gear.offset = 1.0
    assert row.current() == 1.0 and structure_changes() == before and gear.ratio == -2.0
    assert (gear.leader, gear.follower) == (first.freedom(), second.freedom())
    assert repr(gear) == (
        "Gear('revolute ground-a'.angle, 'revolute ground-b'.angle, -2.0, name='gear ground-a-b', offset=1.0)"
    )
    assert asm.Gear(first, second, 1.0, "train").name == "train"


def test_rack_and_pinion():
    pinion, _, rack = wheels()
    made = asm.RackPinion(pinion, rack, 3.0)
    (row,) = made.equations
    assert row.terms == ((1.0, rack.freedom().coordinate), (-3.0, pinion.freedom().coordinate))
    assert (made.name, made.radius, made.offset, row.current()) == ("rack-pinion ground-a-b", 3.0, 0.0, 0.0)
    shaft = make(asm.Cylindrical)
    assert asm.RackPinion(shaft, shaft, 3.0).bodies == shaft.bodies  # a screw, said in another way


def test_a_gear_takes_one_of_several_angles():
    first, *_ = wheels()
    cross = make(asm.Universal)
    assert asm.Gear(cross.freedom("angle_a"), cross.freedom("angle_b"), 1.0).bodies == cross.bodies
    with pytest.raises(InputError, match="^b is 'universal ground-crank'; .* is an angle; it has 'angle_a', 'angle_b'"):
        asm.Gear(first, cross, 1.0)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda a, b, rack: asm.Gear(a, b, 0), InputError, "ratio is 0; expected the turns of b per turn of a"),
        (lambda a, b, rack: asm.Gear(a, b, NAN), InputError, "ratio is nan; expected a finite real number"),
        (
            lambda a, b, rack: asm.Gear(a, b, 1.0, offset=INF),
            InputError,
            "offset is inf; expected a finite real number",
        ),
        (lambda a, b, rack: asm.Gear(a, b, 1.0, name=""), InputError, "name is ''; expected a nonempty string"),
        (lambda a, b, rack: asm.Gear(a, a, 1.0), InputError, "both sides are Freedom.*; expected two coordinates"),
        (lambda a, b, rack: asm.Gear(a, rack, 1.0), InputError, "b is 'rack'; .* is an angle; it has none"),
        (
            lambda a, b, rack: asm.Gear(rack.freedom(), a, 1.0),
            InputError,
            "a is Freedom.*; expected a joint coordinate that is an",
        ),
        (lambda a, b, rack: asm.Gear(a, "b", 1.0), TypeError, "b is 'b'; expected a joint or one of its coordinates"),
        (lambda a, b, rack: asm.RackPinion(a, rack, 0.0), InputError, "radius is 0; expected the travel of the rack"),
        (lambda a, b, rack: asm.RackPinion(a, rack, "1"), InputError, "radius is '1'; expected a finite real number"),
        (
            lambda a, b, rack: asm.RackPinion(a, b, 1.0),
            InputError,
            "rack is 'revolute ground-b'; .* slides; it has none",
        ),
        (
            lambda a, b, rack: asm.RackPinion(rack, rack, 1.0),
            InputError,
            "pinion is 'rack'; .* is an angle; it has none",
        ),
        (lambda a, b, rack: asm.RackPinion(a, make(asm.Planar), 1.0), InputError, "rack is .* it has 'x', 'y'"),
        (lambda a, b, rack: asm.RackPinion(a, None, 1.0), TypeError, "rack is None; expected a joint"),
    ],
)
def test_bad_couplings(call, error, text):
    with pytest.raises(error, match=f"^{text}"):
        call(*wheels())
