"""Mass properties of a body, from its density and what its faces enclose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.errors import KnownSettings, positive
from assembly.kinematics.changes import count_number

if TYPE_CHECKING:
    from assembly.proximity.features.mass import MassProperties
    from assembly.selection.faces import Faces

__all__ = ["Weighed"]

Array = NDArray[np.float64]


class Weighed(KnownSettings):
    """A named thing of a density whose faces may enclose a volume; see `Body`."""

    _name: str
    _density: float
    _faces: Faces

    @property
    def density(self) -> float:
        """Mass a volume; settable, as bodies of files have one."""
        return self._density

    @density.setter
    def density(self, value: float) -> None:
        self._density = positive("density", value)
        count_number(self)

    @property
    def mass_properties(self) -> MassProperties:
        """Volume, area, mass, center of mass and inertia at once, and how wrong the volume may be.

        Raises
        ------
        InputError
            A body whose faces enclose nothing: without a shape, open, or with normals that look inward.
        """
        from assembly.proximity.features.mass import mass_properties

        return mass_properties(self._name, tuple(side.face for side in self._faces), self._density)

    @property
    def area(self) -> float:
        """Area of all faces; of an open body as well."""
        return float(sum(side.face.area() for side in self._faces))

    @property
    def volume(self) -> float:
        """What the faces enclose; see `mass_properties`."""
        return self.mass_properties.volume

    @property
    def mass(self) -> float:
        """Density times volume; see `mass_properties`."""
        return self.mass_properties.mass

    @property
    def center_of_mass(self) -> Array:
        """Center of mass in body coordinates, (3,); see `mass_properties`."""
        return self.mass_properties.center_of_mass

    @property
    def inertia(self) -> Array:
        """Inertia about the center of mass along the body's axes, (3, 3); see `mass_properties`."""
        return self.mass_properties.inertia
