from __future__ import annotations

from assembly.step import occt


def test_what_lacks_is_said(run_python, tmp_path):
    code = f"""
import sys
sys.modules["OCP"] = None
import assembly as asm
assert not any(name.startswith("OCP.") for name in sys.modules)
for call in (
    lambda: asm.read_step({str(tmp_path / "a.step")!r}),
    lambda: asm.write_step({str(tmp_path / "b.step")!r}, asm.Body("ball", asm.shapes.sphere(1.0))),
):
    open({str(tmp_path / "a.step")!r}, "w").close()
    try:
        call()
    except ImportError as error:
        print(error)
"""
    said = [line for line in run_python(code).splitlines() if "pip" in line]
    assert said == 2 * [
        'OCCT is not installed: pip install "assembly-solver[step]"; beside CadQuery or build123d, which bring it, '
        "install assembly-solver without extras"
    ]


def test_two_packages_of_occt_are_told(monkeypatch):
    monkeypatch.setattr(
        occt, "version", lambda package: {"cadquery-ocp": "7.9.3", "cadquery-ocp-novtk": "8.0"}[package]
    )
    said = occt.what_lacks()
    assert said.startswith("cadquery-ocp 7.9.3 and cadquery-ocp-novtk 8.0 are installed")
    assert "pip uninstall cadquery-ocp cadquery-ocp-novtk" in said


def test_names_do_not_load_occt(run_python):
    assert run_python("import sys, assembly; assembly.read_step; print('OCP' in sys.modules)").split()[-1] == "False"
