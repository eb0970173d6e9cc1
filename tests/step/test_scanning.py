"""Texts that the quick look takes are those in which the full one finds no fault."""

from __future__ import annotations

import random

import numpy as np
import pytest

from assembly.step import syntax
from assembly.step.scanning import PADDING, is_whole
from tests.step.test_syntax import BAD, GOOD, HEAD, LOST, TAIL

# What statements refer to.
OTHERS = b"#11 = A(1);\n#12=(B(#11)C('(#9'));\n"
MARKS = b"#'(),;=.*$/!_\"Ee+-0123456789ABC \n\t\0"


def taken(text):
    return is_whole(np.frombuffer(text + bytes(PADDING), np.uint8).copy())


@pytest.fixture
def slow(monkeypatch):
    monkeypatch.setattr(syntax, "is_whole", lambda text: False)
    return syntax.first_fault


@pytest.mark.parametrize("line", GOOD)
def test_good_statements_are_taken(line):
    assert taken(HEAD + line + b"\n" + OTHERS + TAIL)
    assert taken(HEAD + line + OTHERS + TAIL.lower() + b"#1 = (")


@pytest.mark.parametrize("line", BAD + LOST)
def test_faults_are_not(line):
    assert not taken(HEAD + b"#7 = A(1);\n" + line + b"\n#8 = A(2);\n" + TAIL)
    assert not taken((HEAD + line)[:-1])


def test_circles_of_references_are_not_taken():
    chain = b"".join(b"#%d = A(#%d);" % (k, k + 1) for k in range(20, 5_000))
    assert taken(HEAD + chain + b"#5000 = A();" + TAIL)
    assert not taken(HEAD + chain + b"#5000 = A(#4990);" + TAIL)
    assert not taken(HEAD + b"#20 = A(#999999999);" + TAIL)


@pytest.mark.parametrize("seed", range(4))
def test_no_mutation_with_a_fault_is_taken(slow, seed):
    dice = random.Random(seed)
    whole = HEAD + b"\n".join(GOOD[:1] + GOOD[2:6] + GOOD[9:]) + OTHERS + TAIL
    missed = faults = 0
    for _ in range(1_500):
        text = bytearray(whole)
        for _ in range(dice.choice((1, 1, 2))):
            k, j = dice.randrange(len(text)), dice.randrange(len(text))
            kind = dice.randrange(4)
            if kind == 0:
                text[k] = dice.choice(MARKS)
            elif kind == 1:
                del text[k : k + dice.choice((1, 1, 2, 20))]
            else:
                text[k:k] = bytes([dice.choice(MARKS)]) if kind == 2 else text[j : j + dice.choice((1, 3, 30))]
        fault = slow(bytes(text))
        faults += fault is not None
        if taken(bytes(text)):
            assert fault is None, bytes(text)
        else:
            missed += fault is None
    # What is whole and not taken is looked at twice: that is to be rare.
    assert faults > 300 and missed < 15
