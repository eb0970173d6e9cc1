from __future__ import annotations

import json
import sys

import pytest

from assembly.step.occt import occt
from benchmarks import report, step
from benchmarks.figures import met


def test_a_quick_run_reaches_its_goals(monkeypatch):
    pytest.importorskip("OCP", reason='STEP files need OCCT: pip install "assembly-solver[step]"')
    # The files of others are measured in whole runs.
    monkeypatch.delenv("ASSEMBLY_CAD_DATA", raising=False)
    result = json.loads(json.dumps(step.run(True)))
    assert len(result["rows"]) == 5
    assert len(report.lines(result)) == 2 + len(result["figures"])
    assert [row["what"] for row in result["figures"] if met(row) is False] == []


def test_without_occt_there_is_nothing_to_measure(monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    occt.cache_clear()
    result = step.run(True)
    assert result["figures"] == [] and result["rows"] == [{"file": "OCCT", "absent": True}]
