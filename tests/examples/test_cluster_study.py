"""The example of a study on a cluster, with few designs on two workers."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location

import pytest

from tests.examples.running import EXAMPLES


@pytest.mark.filterwarnings("ignore")
def test_the_bits_are_those_of_one_process(monkeypatch, capsys):
    pytest.importorskip("distributed", reason="distributed, of the extra cluster, is not installed")
    monkeypatch.setenv("PYTHONPATH", str(EXAMPLES.parent))
    monkeypatch.syspath_prepend(str(EXAMPLES))
    spec = spec_from_file_location("cluster_study", EXAMPLES / "cluster_study.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    spread = module.main(count=200, workers=2)
    assert len(spread) == 200 and capsys.readouterr().out.splitlines()[-1] == "the same bits"
