"""The names of OCCT that this package uses, whichever of its versions is installed; imported at first use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from types import SimpleNamespace
from typing import Any

__all__ = ["occt", "parts", "quiet", "settings"]

_MODULES = (
    "BRep",
    "BRepBuilderAPI",
    "BRepGProp",
    "BRepLib",
    "BRepTools",
    "GProp",
    "Geom",
    "Geom2d",
    "GeomAbs",
    "GeomConvert",
    "IGESCAFControl",
    "IGESControl",
    "IFSelect",
    "Interface",
    "Message",
    "Quantity",
    "STEPCAFControl",
    "STEPControl",
    "StepGeom",
    "StepShape",
    "TCollection",
    "TDF",
    "TDataStd",
    "TDocStd",
    "TopAbs",
    "TopExp",
    "TopLoc",
    "TopoDS",
    "XCAFApp",
    "XCAFDoc",
    "gp",
)
# Wheels of OCCT: CadQuery's, and build123d's and our own.
PACKAGES = ("cadquery-ocp", "cadquery-ocp-novtk")
# Our name, and what it is called in OCCT 8 (all in one module) and in OCCT 7.
_CONTAINERS = {
    "Points": ("Array1_gp_Pnt", "TColgp", "TColgp_Array1OfPnt"),
    "Points2d": ("Array1_gp_Pnt2d", "TColgp", "TColgp_Array1OfPnt2d"),
    "PointNet": ("Array2_gp_Pnt", "TColgp", "TColgp_Array2OfPnt"),
    "Reals": ("Array1_double", "TColStd", "TColStd_Array1OfReal"),
    "RealNet": ("Array2_double", "TColStd", "TColStd_Array2OfReal"),
    "Integers": ("Array1_int", "TColStd", "TColStd_Array1OfInteger"),
    "Texts": (
        "DataMap_TCollection_AsciiString_TCollection_AsciiString",
        "Resource",
        "Resource_DataMapOfAsciiStringAsciiString",
    ),
    "Labels": ("Sequence_TDF_Label", "TDF", "TDF_LabelSequence"),
    "ShapeMap": ("IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher", "TopTools", "TopTools_IndexedMapOfShape"),
}


@cache
def occt() -> Any:
    """OCCT's classes and values as attributes of one object.

    Raises
    ------
    ImportError
        OCCT is not installed; the message says how to get it.
    """
    try:
        import_module("OCP")
    except ImportError as error:
        raise ImportError(what_lacks()) from error
    names: dict[str, Any] = {}
    for module in _MODULES:
        names.update(vars(import_module(f"OCP.{module}")))
    try:
        containers: Any = import_module("OCP.collections")
    except ImportError:
        containers = None
    for name, (eight, module, seven) in _CONTAINERS.items():
        names[name] = getattr(containers, eight) if containers else getattr(import_module(f"OCP.{module}"), seven)
    # Both versions know the casts; they differ in the suffix that marks a static function.
    for kind in ("Edge", "Face", "Shell", "Solid", "Vertex", "Wire"):
        names[f"as_{kind.lower()}"] = getattr(names["TopoDS"], f"{kind}_s", None) or getattr(names["TopoDS"], kind)
    return SimpleNamespace(**names)


def what_lacks() -> str:
    """What to do where OCCT cannot be imported.

    CadQuery and build123d bring it in one of two packages with the same files, of which a third one would break both.
    """
    found = []
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found.append(f"{package} {version(package)}")
    if len(found) == 2:
        return (
            f"{' and '.join(found)} are installed, whose files overwrite each other: "
            f"pip uninstall {' '.join(PACKAGES)}, then pip install --force-reinstall the one that is needed, "
            "cadquery-ocp for CadQuery, cadquery-ocp-novtk for build123d or neither; the two libraries need an "
            "environment each"
        )
    return (
        'OCCT is not installed: pip install "assembly-solver[step]"; beside CadQuery or build123d, which bring it, '
        "install assembly-solver without extras"
    )


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OCCT from printing its statistics."""
    printers = occt().Message.DefaultMessenger_s().ChangePrinters()
    kept = [printers.Value(k) for k in range(1, printers.Upper() + 1)]
    printers.Clear()
    try:
        yield
    finally:
        for printer in kept:
            printers.Append(printer)


@contextmanager
def settings(values: Mapping[str, int]) -> Iterator[None]:
    """Have OCCT's global settings at other values."""
    table = occt().Interface_Static
    before = {key: table.IVal_s(key) for key in values}
    for key, value in values.items():
        table.SetIVal_s(key, value)
    try:
        yield
    finally:
        for key, value in before.items():
            table.SetIVal_s(key, value)


def parts(shape: Any, kind: Any, outside: Any = None) -> list[Any]:
    """The parts of a kind (`TopAbs_FACE` ...) of a shape that are in none of another, in the order of the shape."""
    o = occt()
    found = []
    explorer = o.TopExp_Explorer(shape, kind, o.TopAbs_SHAPE if outside is None else outside)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found
