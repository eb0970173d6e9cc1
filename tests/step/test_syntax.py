"""The form of STEP files: what has it passes, what has not is named by its line, and nothing else is asked."""

from __future__ import annotations

import pytest

from assembly.step.syntax import first_fault, is_step

HEAD = b"ISO-10303-21;\nHEADER;\nFILE_NAME('a (b;','2026-11-22T00:00:00',('it''s',''),$);\nENDSEC;\nDATA;\n"
TAIL = b"ENDSEC;\nEND-ISO-10303-21;\n"
GOOD = [
    b"#1 = POINT('',(1.,-2.E-3,+3));",
    b"#1=A();",
    b"#10 = ( BOUNDED_CURVE() B_SPLINE_CURVE(3,(#1,#2),.UNSPECIFIED.,.F.,*) NAMED($) );",
    b"#2 = A(LENGTH(1.5),(((#1),(#2)),()),\"0F\",!OWN('x'));",
    b"#3 = A( /* why; ( */ 1 ,\n   2 )\n ;",
    b"#4 = A('(;', ')');",
    b"#5 = A(.T.,.0,-.5E1);",
    b"#5 = A('5' box','it\\'s');",
    b"\0#5 = A(1);",
    b"#6=A('\xe9 \\X2\\00E9\\X0\\');",
]
BAD = [
    b"#1 = POINT('',(1.,2.);",
    b"#1 = POINT('',1.,2.));",
    b"#1 = A)1(;",
    b"#1 = A(1));#2 = B((1);",
    b"#1 = A(1,,2);",
    b"#1 = A(1,);",
    b"#1 = A(1 2);",
    b"#1 = A(#);",
    b"#1 = A(1.2.3);",
    b"#1 A(1);",
    b"1 = A(1);",
    b"#1 = A(1)",
    b"#1 = A('1);",
    b"#1 = A(.T);",
    b"#1 = ;",
    b"#1\n = A(1);",
    b"#1 = A(1E0);",
    b"#1 = A('5'', box');",
    b"#1 = A(B);",
]


@pytest.mark.parametrize("line", GOOD)
def test_statements_of_the_standard_pass(line):
    assert first_fault(HEAD + line + b"\n" + TAIL) is None
    # Whatever follows the end is not of the file.
    assert first_fault(HEAD + line + TAIL + b"#1 = (") is None


@pytest.mark.parametrize("line", BAD)
def test_others_are_named_by_their_lines(line):
    assert first_fault(HEAD + b"#7 = A(1);\n" + line + b"\n#8 = A(2);\n" + TAIL) == 7


def test_files_that_end_early_or_are_none():
    whole = HEAD + b"#1 = A(1);\n" + TAIL
    assert is_step(b" /* by hand */\n" + whole) and first_fault(b" /* by hand */\n" + whole) is None
    for end in range(len(whole) - 1):
        assert first_fault(whole[:end]) is not None or whole[:end].endswith(b"END-ISO-10303-21;")
    assert not is_step(b"solid cube") and not is_step(b"") and not is_step(b"ISO-10303-28;")


def test_texts_that_look_like_statements_for_long():
    for piece in (b"(", b"(1,", b"'", b"/*", b"A", b"#1=A(" + b"1,", b"()", b"\n"):
        assert first_fault(HEAD + 100_000 * piece) == (100_006 if piece == b"\n" else 6)
    assert first_fault(HEAD + b"#1=A" + 100_000 * b"(" + 100_000 * b")" + b";" + TAIL) is None
