"""STEP files read as bodies."""

from __future__ import annotations

import logging
import os
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from assembly._garbage import uncollected
from assembly._progress import Progress, checked_progress, watched
from assembly.errors import InputError, file_path
from assembly.kinematics.body import Body
from assembly.step.bodies import Source, Unrepaired, bodies_in
from assembly.step.documents import Damaged, Malformed, StepError, StepWarning, checked_unit, document_of
from assembly.step.occt import quiet

__all__ = ["read_step"]

_LOG = logging.getLogger("assembly.step")

# Seconds that reading a damaged file may take, with kernels compiled for the first time. OCCT may not end on such a
# file: it gets so many of them for any file, and so many more a megabyte of text, fifty times what clean files take.
PATIENCE = 240.0
FOR_OCCT = (6.0, 20.0)
# Exit codes from which on Windows means a crash; elsewhere they are negative.
ENDED = 0xC0000000
# The script of the other process. What is raised in it is raised again in the process that asked. It ends without
# running OCCT's destructors. Arrays come back as separate bytes, and so are read-only, as those of bodies are.
_APART = """
import faulthandler, os, pickle, sys
from assembly.step.occt import occt
from assembly.step.reader import bodies_of
path, unit, strict, seconds, answer = sys.argv[1:]
occt()
# OCCT's shapes are there once our own begins to read them, and it does come to an end.
faulthandler.dump_traceback_later(float(seconds), exit=True)
try:
    found = bodies_of(path, unit, strict == "True", os.path.dirname(answer), faulthandler.cancel_dump_traceback_later)
except Exception as error:
    found = error
arrays = []
rest = pickle.dumps(found, 5, buffer_callback=arrays.append)
with open(answer, "wb") as file:
    pickle.dump((rest, [bytes(array.raw()) for array in arrays]), file)
os._exit(0)
"""


def _read_apart(path: str, unit: str, strict: bool, damage: str) -> tuple[list[Body], list[str]]:
    """`bodies_of` in another process, which OCCT may end, or not end."""
    least, more = FOR_OCCT
    seconds = least + more * 1e-6 * Path(path).stat().st_size
    with TemporaryDirectory() as folder:
        answer = Path(folder) / "answer"
        try:
            ended = subprocess.run(
                [sys.executable or "python", "-P", "-c", _APART, path, unit, str(strict), str(seconds), str(answer)],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path))},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=False,
                timeout=PATIENCE,
                text=True,
                errors="replace",
            )
        except subprocess.TimeoutExpired:
            raise StepError(f"{damage}, and reading the rest took more than {PATIENCE:g} seconds") from None
        except OSError as error:
            raise StepError(f"{damage}, and no other process can be started to read it: {error}") from None
        if ended.returncode == 1 and "Timeout (" in ended.stderr:
            raise StepError(f"{damage}, and OCCT has not read the rest in {seconds:.0f} seconds")
        if 0 < ended.returncode < ENDED:
            raise StepError(f"{damage}, and another process cannot read it: {ended.stderr.strip()[-200:]}")
        if ended.returncode != 0:
            raise StepError(f"{damage}, and OCCT cannot read the rest")
        rest, arrays = pickle.loads(answer.read_bytes())
    found = pickle.loads(rest, buffers=arrays)
    if isinstance(found, Exception):
        raise found
    return found  # type: ignore[no-any-return]  # It is what the child found.


def read_step(
    path: str | PathLike[str], *, unit: str = "mm", strict: bool = True, progress: Progress = False
) -> list[Body]:
    """The solids of a STEP file, a body each.

    A part that the file's assembly uses several times becomes several bodies that share their faces. Geometry stays in
    the part's own coordinates; the body's pose is its placement in the assembly. Where that mirrors or scales, the body
    is an image of the part. Names are those of the parts, with "nut" followed by "nut 2"; faces have their names in the
    file, or "face 1", "face 2" in its order (always around voids, whose names OCCT does not read). `body.color` and
    `face.color` are the file's, or None.

    Planes, cylinders, cones, spheres, tori, swept surfaces and splines are exact rational surfaces, and so are their
    trims, up to curves around an axis that have no rational form (helices, intersections): those are followed to 1e-10
    of the face's extent in (u, v). Ends of edges that the file leaves apart within its tolerance are joined. Trims that
    leave their surface and ends that do not meet are accepted within the file's tolerance, up to a hundredth of the
    part's size. Where a file has edges beside its surfaces, faces end where the surfaces cross. Faces are a little
    smaller than the patches of their surfaces. Shells and faces outside of any solid become bodies too. Wires, points
    and annotations that bound no face are not read. Files of parts that the file refers to are looked for in its
    folder.

    Parameters
    ----------
    path
        A file of AP203, AP214 or AP242.
    unit : {"mm", "um", "cm", "m", "in", "ft"}
        Lengths are converted to it, whatever the file's own unit.
    strict : bool
        Whether to raise if a face cannot be read or the text is damaged. Otherwise these faces and statements are left
        out, and warnings say which and why.
    progress : bool or callable
        True shows a progress bar; a function is called with the numbers of faces read and of all faces.

    Returns
    -------
    list of Body
        In the order of the file.

    Raises
    ------
    StepError
        Not a STEP file, nothing in it, a text that is damaged in a line, or faces that cannot be read, named with the
        reasons.
    FileNotFoundError
        No such file.
    ImportError
        OCCT is not installed: pip install "assembly-solver[step]"; tqdm is not, with progress=True.

    Warns
    -----
    StepWarning
        Faces that are left out, or approximated with an error of more than 1e-7 mm (offset surfaces); damage to the
        file; missing files that it refers to.
    """
    checked_unit(unit)
    if not isinstance(strict, (bool, np.bool_)):
        raise InputError(f"strict is {strict!r}; expected True or False")
    checked_progress(progress)
    file = file_path("path", path)
    if not file.is_file():
        raise FileNotFoundError(f"path is {str(file)!r}; {'a folder' if file.is_dir() else 'no such file'}")
    damage = ""
    begin = perf_counter()
    try:
        bodies, left = bodies_of(str(file), unit, bool(strict), progress=progress)
    except Damaged as reason:
        damage = str(reason)
        if strict and isinstance(reason, Malformed):
            raise StepError(f"{damage}; pass strict=False to read the undamaged part") from None
    if damage:
        bodies, left = _read_apart(str(file), unit, bool(strict), damage)
        left.append(f"{damage}, and what OCCT makes of the rest was read")
    for line in left:
        warnings.warn(line, StepWarning, stacklevel=2)
    _LOG.info("%s: %d bodies, read in %.2f s", file.name, len(bodies), perf_counter() - begin)
    return bodies


def bodies_of(
    path: str,
    unit: str,
    strict: bool,
    folder: str | None = None,
    loaded: Callable[[], None] = lambda: None,
    progress: Progress = False,
) -> tuple[list[Body], list[str]]:
    """The bodies of a file, also of one that is damaged if there is a folder, and what there is to warn of.

    `loaded` is called when OCCT has read the file.
    """
    damaged = folder is not None

    def read(repairs: bool) -> tuple[list[Body], list[str]]:
        document = document_of(path, folder, repairs=repairs)
        loaded()
        with watched(progress, "reading", document.faces, "face") as advance:
            found = Source(
                Path(path),
                document.made,
                document.faces,
                tuple(document.missing),
                damaged,
                (),
                advance,
                repairs,
                document.others,
            )
            return bodies_in(found, 1.0 / checked_unit(unit), strict)

    with quiet(), uncollected():
        # OCCT's repairs are slow, and few files need them.
        with suppress(Unrepaired):
            return read(repairs=damaged)
        return read(repairs=True)
