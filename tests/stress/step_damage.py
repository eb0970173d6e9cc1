"""Damaged STEP files read one after the other, a line of outcome each: what `test_step_files.py` runs in a child.

OCCT is compiled code that can take its process with it; a parent sees after which file. With the argument ``forked``
the processes that the library starts for damaged files are forks of this one, which have imported OCCT.
"""

from __future__ import annotations

import json
import sys
import traceback
import warnings

import numpy as np

from assembly.step import StepError, StepWarning, read_step, reader
from tests.step import forked


def outcome(path):
    """What became of a file: "read", "refused", or what went wrong."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", StepWarning)
            bodies = read_step(path, strict=False)
    except StepError as error:
        return "refused" if path in str(error) else f"a StepError that does not name the file: {error}"
    except Exception:
        return traceback.format_exc()
    finite = all(
        np.isfinite(body.q).all() and all(np.isfinite(face.face.surface.control_points).all() for face in body.faces)
        for body in bodies
    )
    return "read" if bodies and finite else "no bodies, or some that are not finite"


if __name__ == "__main__":
    if "forked" in sys.argv:
        reader.subprocess = forked.processes
    for line in sys.stdin:
        print(json.dumps(outcome(json.loads(line))), flush=True)
