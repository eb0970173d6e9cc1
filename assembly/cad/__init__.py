"""Parts and assemblies of CadQuery and build123d, in memory: solved in place, and as bodies.

Neither of the two libraries is imported by this package: who calls it has one of them already.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.cad.build123d_parts import from_build123d as from_build123d
    from assembly.cad.cadquery_parts import from_cadquery as from_cadquery
    from assembly.cad.placing import place as place
    from assembly.cad.shapes import from_occt as from_occt
    from assembly.cad.solving import solve as solve
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "from_build123d": "assembly.cad.build123d_parts",
            "from_cadquery": "assembly.cad.cadquery_parts",
            "from_occt": "assembly.cad.shapes",
            "place": "assembly.cad.placing",
            "solve": "assembly.cad.solving",
        },
    )
