"""Figures and the page they are printed on."""

from __future__ import annotations

import json
import math

import pytest

from benchmarks import counts, report
from benchmarks.__main__ import write
from benchmarks.figures import figure, met, quantity


@pytest.mark.parametrize(
    ("unit", "measured", "reach", "of", "verdict"),
    [
        ("seconds", 39e-9, 40e-9, None, True),
        ("seconds", 41e-9, 40e-9, None, False),
        ("error", 1e-8, 1e-8, None, True),
        ("ratio", 1.1, 1.05, None, False),
        ("count", 50, 50, 50, True),
        ("count", 49, 50, 50, False),
        ("count", 49, None, 50, None),
        ("error", math.nan, 1e-8, None, False),
    ],
)
def test_what_counts_as_reached(unit, measured, reach, of, verdict):
    assert met(figure("x", unit, measured, reach=reach, of=of)) is verdict


@pytest.mark.parametrize(("unit", "of"), [("count", None), ("seconds", 3)])
def test_only_counts_are_out_of_a_number(unit, of):
    with pytest.raises(ValueError, match=f"of is {of} with unit '{unit}', expected"):
        figure("x", unit, 1.0, of=of)


@pytest.mark.parametrize(
    ("value", "unit", "of", "text"),
    [
        (3.46e-8, "seconds", None, "34.6 ns"),
        (1e-6, "seconds", None, "1 us"),
        (5.5e-3, "seconds", None, "5.5 ms"),
        (12.0, "seconds", None, "12 s"),
        (48, "count", 50, "48 of 50"),
        (1.23e-13, "error", None, "1.2e-13"),
        (1.034, "ratio", None, "1.03"),
        (None, "seconds", None, "absent"),
        (math.nan, "error", None, "none"),
    ],
)
def test_quantities(value, unit, of, text):
    assert quantity(value, unit, of) == text


def test_a_table_has_goals_misses_and_absent_peers():
    figures = [
        figure("a | b", "seconds", 5e-8, reach=4e-8, peers={"scipy": 1e-6, "OCCT": None}),
        figure("cases", "count", 2, of=3),
    ]
    assert report.lines({"figures": figures}) == [
        "| what | reach | measured | peer |",
        "| --- | --- | --- | --- |",
        r"| a \| b | 40 ns | 50 ns (not reached) | scipy 1 us; OCCT absent |",
        "| cases |  | 2 of 3 |  |",
    ]


def test_a_failure_is_said():
    result = {"error": "Traceback ...\n  File ...\nValueError: no luck\n"}
    assert report.lines(result) == ["This benchmark failed: `ValueError: no luck`"]


def test_the_page_is_written_from_the_json(tmp_path, monkeypatch, capsys):
    versions = {"numpy": "2.4.6", "coal": "absent"}
    machine = {"processor": "Abacus 3", "python": "3.11.1", "versions": versions, "cores": 2}
    results = {"start": {"about": "Whole processes.", "figures": [figure("import", "seconds", 1e-2)]}}
    (tmp_path / "all.json").write_text(json.dumps({"machine": machine, "benchmarks": results}))
    monkeypatch.setattr(report, "RESULTS", tmp_path / "all.json")
    monkeypatch.setattr(report, "PAGE", tmp_path / "performance.md")
    monkeypatch.setattr(report, "README", tmp_path / "README.md")
    monkeypatch.setattr(counts, "STORED", tmp_path / "counts.json")
    monkeypatch.setattr(report, "TOLD", (("an import", "start", "import"), ("another", "start", "not measured")))
    (tmp_path / "README.md").write_text("before\n<!-- figures -->\nold\n<!-- /figures -->\nafter\n")
    assert report.main() == 0
    text = (tmp_path / "performance.md").read_text()
    assert "Machine: Abacus 3. Python 3.11.1, numpy 2.4.6." in text
    assert text.index("## Start") < text.index("Whole processes.") < text.index("| import |  | 10 ms |  |")
    assert str(tmp_path) in capsys.readouterr().out
    readme = (tmp_path / "README.md").read_text()
    assert readme.startswith("before\n<!-- figures -->\nMedians on one core of an Abacus 3, ")
    assert "| an import | 10 ms |  |\n\n" in readme and "another" not in readme and "old" not in readme
    assert readme.endswith(": 0 of its 0\ngoals are reached.\n<!-- /figures -->\nafter\n")


@pytest.mark.parametrize("text", ["", "<!-- figures -->\n", "<!-- figures -->\n<!-- /figures --><!-- /figures -->"])
def test_a_readme_without_its_marks_is_refused(text):
    with pytest.raises(ValueError, match="marks of figures, expected one of each"):
        report.with_block(text, "figures")


def test_goals_that_are_reached_are_counted():
    machine = {"processor": "Abacus 3"}
    rows = [figure("a", "seconds", 1.0, reach=2.0), figure("b", "seconds", 3.0, reach=2.0), figure("c", "seconds", 1.0)]
    assert ": 1 of its 2\ngoals" in report.block({"machine": machine, "benchmarks": {"start": {"figures": rows}}})


def test_counts_are_a_section_of_the_page():
    machine = {"processor": "Abacus 3", "python": "3.11.1", "versions": {}, "cores": 2}
    work = {"stamp": {"numpy": "2.4.6"}, "missing": "no instructions", "work": {"a call": {"bounds": 12_345}}}
    text = report.page({"machine": machine, "benchmarks": {}}, work)
    assert "## Counts\n\nCounted with numpy 2.4.6." in text
    assert "| a call |  |  |  | 12,345 |  |  |  |\n\nNo instructions.\n" in text


@pytest.mark.parametrize(("others", "said"), [(0.02, False), (0.97, True), (None, True)])
def test_a_busy_machine_is_said(others, said):
    machine = {"processor": "Abacus 3", "python": "3.11.1", "versions": {}, "cores": 2}
    section = {"date": "2026-01-02", "others": others, "took_seconds": 90.0}
    text = report.page({"machine": machine, "benchmarks": {"start": section, "pairs": {"took_seconds": 30.0}}})
    assert ("**Provisional:** measured 2026-01-02" in text) is said
    assert ("other programs used" in text.split("## Start")[1]) is (others is not None)
    assert "measured 2026-01-02 in 90 s" in text and "All sections together take 2 minutes." in text


def test_a_section_names_versions_that_are_not_those_of_the_heading():
    versions = {"assembly": "absent", "numpy": "2.4.6", "coal": "3.0.3"}
    machine = {"processor": "Abacus 3", "python": "3.11.1", "versions": versions, "cores": 2}
    sections = {
        "start": {"date": "2026-01-02", "others": 0.02, "versions": versions},
        "pairs": {
            "date": "2026-01-03",
            "others": 0.02,
            "versions": {"assembly": "0.1", "numpy": "2.5.0", "coal": "absent"},
        },
    }
    text = report.page({"machine": machine, "benchmarks": sections})
    assert text.count("other versions") == 1 and "; other versions: numpy 2.5.0." in text.split("## Pairs")[1]


def test_a_section_measured_anew_takes_the_place_of_the_stored_one(tmp_path):
    first = {"quick": False, "machine": {}, "benchmarks": {"start": {"date": "then"}, "pairs": {"date": "then"}}}
    write(first, tmp_path, None)
    path = write({**first, "machine": {"cores": 9}, "benchmarks": {"start": {"date": "now"}}}, tmp_path, "start")
    assert json.loads(path.read_text())["machine"] == {}
    stored = json.loads(path.read_text())["benchmarks"]
    # In the order of the page.
    assert list(stored.items()) == [("pairs", {"date": "then"}), ("start", {"date": "now"})]
    assert write({**first, "quick": True}, tmp_path, "start").name == "start-quick.json"
