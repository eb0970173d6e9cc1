"""Reads of damaged files in forks of a process that has imported OCCT, which takes a second in every new one."""

from __future__ import annotations

import faulthandler
import os
import signal
import subprocess
import sys
import time
import warnings
from types import SimpleNamespace


def run(command, *, timeout, **_):
    """`subprocess.run` of ``python -P -c code arguments``, as the reader calls it, and what it asks of the outcome."""
    with warnings.catch_warnings():
        # Python warns of threads, such as those of numpy's libraries; the child uses none of theirs.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            faulthandler.disable()
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(nowhere, stream)
            sys.argv, sys.stderr = ["-c", *command[4:]], os.fdopen(2, "w")
            exec(command[3], {"__name__": "__main__"})
        finally:
            # The code ends the process itself where nothing goes wrong.
            os._exit(1)
    end = time.monotonic() + timeout
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return SimpleNamespace(returncode=os.waitstatus_to_exitcode(status), stderr="")
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise subprocess.TimeoutExpired(command, timeout)
        time.sleep(0.005)


# What the reader uses of the module `subprocess`.
processes = SimpleNamespace(run=run, DEVNULL=subprocess.DEVNULL, TimeoutExpired=subprocess.TimeoutExpired)
