"""Makers of common shapes, all of them exact rational surfaces, and of solids with trimmed faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.geometry.shapes.path import Path as Path
    from assembly.geometry.shapes.solids import cam as cam
    from assembly.geometry.shapes.solids import extrusion as extrusion
    from assembly.geometry.shapes.solids import plate as plate
    from assembly.geometry.shapes.solids import plate_with_slot as plate_with_slot
    from assembly.geometry.shapes.solids import solid_cylinder as solid_cylinder
    from assembly.geometry.shapes.solids import trimmed_plane as trimmed_plane
    from assembly.geometry.shapes.surfaces import box as box
    from assembly.geometry.shapes.surfaces import cone as cone
    from assembly.geometry.shapes.surfaces import cylinder as cylinder
    from assembly.geometry.shapes.surfaces import ellipsoid as ellipsoid
    from assembly.geometry.shapes.surfaces import paper_clip as paper_clip
    from assembly.geometry.shapes.surfaces import pipe as pipe
    from assembly.geometry.shapes.surfaces import plane as plane
    from assembly.geometry.shapes.surfaces import sphere as sphere
    from assembly.geometry.shapes.surfaces import torus as torus
    from assembly.geometry.shapes.swept import joined as joined
    from assembly.geometry.shapes.swept import loft as loft
    from assembly.geometry.shapes.swept import revolution as revolution
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "Path": "assembly.geometry.shapes.path",
            "box": "assembly.geometry.shapes.surfaces",
            "cam": "assembly.geometry.shapes.solids",
            "cone": "assembly.geometry.shapes.surfaces",
            "cylinder": "assembly.geometry.shapes.surfaces",
            "ellipsoid": "assembly.geometry.shapes.surfaces",
            "extrusion": "assembly.geometry.shapes.solids",
            "joined": "assembly.geometry.shapes.swept",
            "loft": "assembly.geometry.shapes.swept",
            "paper_clip": "assembly.geometry.shapes.surfaces",
            "pipe": "assembly.geometry.shapes.surfaces",
            "plane": "assembly.geometry.shapes.surfaces",
            "plate": "assembly.geometry.shapes.solids",
            "plate_with_slot": "assembly.geometry.shapes.solids",
            "revolution": "assembly.geometry.shapes.swept",
            "solid_cylinder": "assembly.geometry.shapes.solids",
            "sphere": "assembly.geometry.shapes.surfaces",
            "torus": "assembly.geometry.shapes.surfaces",
            "trimmed_plane": "assembly.geometry.shapes.solids",
        },
    )
