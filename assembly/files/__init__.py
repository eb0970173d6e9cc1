"""Files of other programs, beside STEP: robots (URDF), and triangles of scenes (glTF, STL)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.files.gltf import write_gltf as write_gltf
    from assembly.files.robot import Inertial as Inertial
    from assembly.files.robot import Robot as Robot
    from assembly.files.stl import write_stl as write_stl
    from assembly.files.urdf_reader import read_urdf as read_urdf
    from assembly.files.urdf_writer import write_urdf as write_urdf
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "Inertial": "assembly.files.robot",
            "Robot": "assembly.files.robot",
            "read_urdf": "assembly.files.urdf_reader",
            "write_gltf": "assembly.files.gltf",
            "write_stl": "assembly.files.stl",
            "write_urdf": "assembly.files.urdf_writer",
        },
    )
