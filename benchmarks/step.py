"""STEP files read and written: are all faces there, are areas and volumes OCCT's, and what does it cost."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

import assembly as asm
from benchmarks.figures import figure

ABOUT = """\
Parts made through OCCT, and the files in the folder that the environment variable ASSEMBLY_CAD_DATA names. Deviations
are relative, of each face and each body from the nearer one of OCCT's two rules of integration (its fixed rule and its
adaptive one are each off by more than 1e-6 on some faces). "Again" is after writing and reading again. OCCT's time is
that of its own shapes, which it makes of the same file before we begin."""
REACH = 1e-6


def _occt() -> Any | None:
    """OCCT's names, or None where it is not installed."""
    try:
        names = dict(vars(import_module("assembly.step.occt").occt()))
        for module in ("BRepAlgoAPI", "BRepFilletAPI", "BRepGProp", "BRepPrimAPI", "GProp", "gp"):
            names.update(vars(import_module(f"OCP.{module}")))
    except ImportError:
        return None
    return type("Occt", (), {name: staticmethod(value) if callable(value) else value for name, value in names.items()})


def _made(o: Any) -> Iterator[tuple[str, Any]]:
    """Parts whose trims cross seams, go round axes and reach poles."""

    def cylinder(at: tuple[float, float, float], along: tuple[float, float, float], radius: float) -> Any:
        place = o.gp_Ax2(o.gp_Pnt(*at), o.gp_Dir(*along))
        return o.BRepPrimAPI_MakeCylinder(place, radius, 18.0).Shape()

    block = o.BRepPrimAPI_MakeBox(4.0, 5.0, 6.0).Shape()
    rounding = o.BRepFilletAPI_MakeFillet(block)
    explorer = o.TopExp_Explorer(block, o.TopAbs_EDGE)
    while explorer.More():
        rounding.Add(0.5, o.as_edge(explorer.Current()))
        explorer.Next()
    yield "rounded box", rounding.Shape()
    drill = cylinder((-9.0, 0.2, 0.1), (1.0, 0.02, 0.0), 0.5)
    yield "drilled sphere", o.BRepAlgoAPI_Cut(o.BRepPrimAPI_MakeSphere(2.0).Shape(), drill).Shape()
    yield "drilled torus", o.BRepAlgoAPI_Cut(o.BRepPrimAPI_MakeTorus(4.0, 1.0).Shape(), drill).Shape()
    yield "crossed cylinders", o.BRepAlgoAPI_Fuse(cylinder((0.0, 0.0, -9.0), (0.0, 0.0, 1.0), 2.0), drill).Shape()
    yield "cone", o.BRepPrimAPI_MakeCone(2.0, 0.0, 5.0).Shape()


def _save(o: Any, shape: Any, path: Path) -> None:
    """A shape written through OCCT."""
    writer = o.STEPControl_Writer()
    writer.Transfer(shape, o.STEPControl_AsIs)
    writer.Write(str(path))


def _integrals(o: Any, shape: Any) -> tuple[list[float], list[float]]:
    """Areas and volumes by OCCT's two rules."""
    found = []
    for integrate in (o.BRepGProp.SurfaceProperties_s, o.BRepGProp.VolumeProperties_s):
        fixed, adaptive = o.GProp_GProps(), o.GProp_GProps()
        integrate(shape, fixed)
        integrate(shape, adaptive, 1e-9)
        found.append([fixed.Mass(), adaptive.Mass()])
    return found[0], found[1]


def _volume(body: asm.Body) -> float:
    return sum(side.face.volume_integral() for side in body.faces)


def _off(mine: float, others: list[float]) -> float:
    return min(abs(mine / other - 1.0) for other in others)


def _seconds(call: Any, repeats: int) -> tuple[float, Any]:
    """Median, and what the last call returned."""
    times, found = [], None
    for _ in range(repeats):
        begin = perf_counter()
        found = call()
        times.append(perf_counter() - begin)
    return float(np.median(times)), found


def _row(o: Any, name: str, path: Path, folder: Path, repeats: int) -> dict[str, Any]:
    """Everything of one file."""
    quiet, documents = import_module("assembly.step.occt").quiet, import_module("assembly.step.documents")
    with quiet():
        occt_seconds, _ = _seconds(lambda: documents.document_of(str(path)), repeats)
        solids = list(import_module("assembly.step.bodies").solids_of(str(path)))
    seconds, bodies = _seconds(lambda: asm.read_step(path), repeats)
    areas, volumes = [0.0], [0.0]
    for body, shape in zip(bodies, solids, strict=True):
        explorer = o.TopExp_Explorer(shape, o.TopAbs_FACE)
        for side in body.faces:
            areas.append(_off(side.face.area(), _integrals(o, explorer.Current())[0]))
            explorer.Next()
        volumes.append(_off(_volume(body), _integrals(o, shape)[1]))
    written = folder / "again.step"
    write_seconds, _ = _seconds(lambda: asm.write_step(written, bodies), repeats)
    back = asm.read_step(written)
    unique = {id(side.face) for body in bodies for side in body.faces}
    return {
        "file": name,
        "bodies": len(bodies),
        "faces": len(unique),
        "in file": documents.document_of(str(path))[1],
        "area": max(areas),
        "volume": max(volumes),
        "again": max(abs(_volume(b) / _volume(a) - 1.0) for a, b in zip(bodies, back, strict=True)),
        "pose": max(float(np.abs(b.pose.matrix - a.pose.matrix).max()) for a, b in zip(bodies, back, strict=True)),
        "read_seconds": seconds,
        "occt_seconds": occt_seconds,
        "write_seconds": write_seconds,
    }


def run(quick: bool) -> dict[str, Any]:
    """A row a file; none where OCCT is not installed."""
    o = _occt()
    if o is None:
        return {"about": ABOUT, "rows": [{"file": "OCCT", "absent": True}], "figures": []}
    given = os.environ.get("ASSEMBLY_CAD_DATA")
    repeats = 1 if quick else 5
    rows: list[dict[str, Any]] = []
    refused: list[str] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        files = []
        for part, shape in _made(o):
            with import_module("assembly.step.occt").quiet():
                _save(o, shape, folder / f"{part}.step")
            files.append((part, folder / f"{part}.step"))
        if given is not None:
            files += [(path.name, path) for path in sorted(Path(given).iterdir()) if path.suffix in (".stp", ".step")]
        # What is loaded and compiled at the first file is not timed.
        asm.read_step(files[0][1])
        for part, path in files:
            try:
                rows.append(_row(o, part, path, folder, repeats))
            except import_module("assembly.step").StepError:
                refused.append(part)
    faces, total = (sum(row[key] for row in rows) for key in ("faces", "in file"))
    largest = max(rows, key=lambda row: row["faces"])
    left = f"; not {', '.join(refused)}" if refused else ""
    figures = [
        figure(f"STEP files read, and again after writing{left}", "count", len(rows), of=len(rows) + len(refused)),
        figure(f"faces read, of {len(rows)} STEP files", "count", faces, of=total, reach=total),
        figure("area of a face, largest deviation from OCCT's", "error", max(r["area"] for r in rows), reach=REACH),
        figure("volume of a body, largest deviation from OCCT's", "error", max(r["volume"] for r in rows), reach=REACH),
        figure("volume after writing and reading again", "error", max(r["again"] for r in rows), reach=REACH),
        figure("pose after writing and reading again", "error", max(r["pose"] for r in rows), reach=1e-9),
        figure(
            f"reading {largest['file']} ({largest['faces']} faces)",
            "seconds",
            largest["read_seconds"],
            peers={"OCCT, its own shapes": largest["occt_seconds"]},
        ),
        figure(f"writing {largest['file']}", "seconds", largest["write_seconds"]),
    ]
    return {"about": ABOUT, "rows": rows, "figures": figures}
