"""The set of places that a tip can reach: cells found by warm solves, and their area or volume."""

from __future__ import annotations

from assembly.studies.reachable.result import Workspace
from assembly.studies.reachable.search import workspace

__all__ = ["Workspace", "workspace"]
