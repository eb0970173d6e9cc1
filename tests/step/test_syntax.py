"""The form of STEP files: what has it passes, what has not is named by its line, and nothing else is asked."""

from __future__ import annotations

import pytest

from assembly.step.syntax import Fault, first_fault, is_step, mended

HEAD = b"ISO-10303-21;\nHEADER;\nFILE_NAME('a (b;','2026-11-22T00:00:00',('it''s',''),$);\nENDSEC;\nDATA;\n"
TAIL = b"ENDSEC;\nEND-ISO-10303-21;\n"
GOOD = [
    b"#1 = POINT('',(1.,-2.E-3,+3));",
    b"#1=A();",
    b"#10 = ( BOUNDED_CURVE() B_SPLINE_CURVE(3,(#11,#11),.UNSPECIFIED.,.F.,*) NAMED($) );",
    b"#2 = A(LENGTH(1.5),(((#11),(#11)),()),\"0F\",!OWN('x'));",
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
    b"#7 = B(2);",
    b"#07 = B(2);",
    b"#1 = A(#1000000000000000000);",
    b"#1 = A(.1.);",
    b"#1 = A(.A.2.);",
]
LOST = [
    b"#1 = A('#7',(#9,#7));",
    b"#1 = A(2,(#1));",
    b"#1 = A(#2);#2 = B(#3);#3 = (A(#7)B(#1));",
]


# What the good ones refer to, but those that they are.
OTHERS = b"#11 = A(2);\n"


@pytest.mark.parametrize("line", GOOD)
def test_statements_of_the_standard_pass(line):
    assert first_fault(HEAD + line + b"\n" + OTHERS + TAIL) is None
    # Whatever follows the end is not of the file.
    assert first_fault(HEAD + line + OTHERS + TAIL + b"#1 = (") is None


UNENDED = [b"#1 = A(1)"]


@pytest.mark.parametrize("line", BAD)
def test_others_are_named_by_their_lines(line):
    assert first_fault(HEAD + b"#7 = A(1);\n" + line + b"\n#8 = A(2);\n" + TAIL) == Fault(7, False)


@pytest.mark.parametrize("line", LOST)
def test_references_that_lead_nowhere_are_named_by_theirs(line):
    text = HEAD + b"#7 = A(1);\n" + line + b"\n#8 = A(2);\n"
    assert first_fault(text + TAIL) == Fault(7, True)
    # What is no statement comes first: with it, nobody knows what references lead to.
    assert first_fault(text + b"#10 = A(;\n" + TAIL) == Fault(9, False)


@pytest.mark.parametrize("line", BAD + LOST)
def test_what_is_whole_is_kept(line):
    rest = b"#7 = A(1);\n", b"#8 = A(#7);\n"
    kept = mended(HEAD + rest[0] + line + b"\n" + rest[1] + TAIL)
    assert first_fault(kept) is None
    assert HEAD + rest[0] in kept and TAIL in kept
    # Without its semicolon a statement takes the next one with it.
    assert (rest[1] in kept) == (line not in UNENDED)
    assert mended(kept) == kept


def test_references_to_what_is_lost():
    lost = b"#1 = A('#9', #9,(#2, #90)); /* #9 */\n#2 = A(#1;\n#3 = A(#2);\n#3 = B(#4);\n#4 = C(#3);\n"
    lost += b"#5 = A(#6,#5,#4,#7);\n#6 = A(#5,#3);\n#7 = A(#4);\n"
    kept = b"#1 = A('#9', $,($, $)); /* #9 */\n\n#3 = A($);\n#4 = C(#3);\n"
    kept += b"#5 = A($,$,#4,#7);\n#6 = A($,#3);\n#7 = A(#4);\n"
    assert mended(HEAD + lost + TAIL) == HEAD + kept + TAIL
    # A text that ends early is ended.
    assert mended(HEAD + lost) == HEAD + kept + TAIL
    assert mended(HEAD + lost + TAIL[:8] + b"END-ISO") == HEAD + kept + TAIL


def test_statements_in_strings_are_none():
    lost = b"#1 = A(1E0,'x;#2=OTHER();',2);\n#2 = B(1);\n#3 = C(#2);\n"
    assert mended(HEAD + lost + TAIL) == HEAD + b"\n#2 = B(1);\n#3 = C(#2);\n" + TAIL
    # Strings without end are taken as they come, and of many that nothing follows each is read once.
    assert mended(HEAD + b"#1 = A(1E0,'x;\n#2 = B(1);\n") == HEAD + b"\n#2 = B(1);\n" + TAIL
    assert mended(HEAD + b"#1 = A(" + 10_000 * b"'x'," + b"/*;*/") == HEAD + TAIL


def test_files_that_end_early_or_are_none():
    whole = HEAD + b"#1 = A(1);\n" + TAIL
    assert is_step(b" /* by hand */\n" + whole) and first_fault(b" /* by hand */\n" + whole) is None
    for end in range(len(whole) - 1):
        assert first_fault(whole[:end]) is not None or whole[:end].endswith(b"END-ISO-10303-21;")
    assert not is_step(b"solid cube") and not is_step(b"") and not is_step(b"ISO-10303-28;")


def test_texts_that_look_like_statements_for_long():
    for piece in (b"(", b"(1,", b"'", b"/*", b"A", b"#1=A(" + b"1,", b"()", b"\n"):
        assert first_fault(HEAD + 100_000 * piece) == Fault(100_006 if piece == b"\n" else 6, False)
    assert first_fault(HEAD + b"#1=A(." + 1_000_000 * b"A" + b"0);" + TAIL) == Fault(6, False)
    assert first_fault(HEAD + b"#1=A" + 100_000 * b"(" + 100_000 * b")" + b";" + TAIL) is None
