"""STEP files (ISO 10303-21: AP203, AP214, AP242) read as bodies and written from solved scenes, through OCCT; IGES and
BREP likewise.

OCCT comes with the extra `step` and is imported when a file is read or written.
"""

from __future__ import annotations

from assembly.step.documents import StepError, StepWarning
from assembly.step.iges_brep import read_brep, read_iges, write_brep, write_iges
from assembly.step.reader import read_step
from assembly.step.writer import write_step

__all__ = ["StepError", "StepWarning", "read_brep", "read_iges", "read_step", "write_brep", "write_iges", "write_step"]
