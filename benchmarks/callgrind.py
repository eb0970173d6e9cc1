"""Instructions that a process executes, as Valgrind's Callgrind counts them: between two calls, not of a whole process.

A program under Valgrind speaks to it by a sequence of instructions that does nothing elsewhere (valgrind/callgrind.h).
"""

from __future__ import annotations

import ctypes
import mmap
import platform
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["Counter", "command", "read_counts", "why_not"]

# mov rax, rdi; xor edx, edx; rol rdi by 3, 13, 61, 51; xchg rbx, rbx; mov rax, rdx; ret
_REQUEST = bytes.fromhex("4889f8 31d2 48c1c703 48c1c70d 48c1c73d 48c1c733 4887db 4889d0 c3")
_RUNNING = 0x1001
# Callgrind's own requests, in the order of its header from the first one on.
_ZERO, _DUMP_AT, _START, _STOP = (0x43540000 + k for k in (1, 3, 4, 5))


def why_not() -> str:
    """Why instructions cannot be counted here; empty where they can."""
    if platform.machine().lower() not in ("x86_64", "amd64") or sys.platform != "linux":
        return "no instruction counts here: they are for Linux on x86-64"
    if shutil.which("valgrind") is None:
        return "no instruction counts here: Valgrind is not installed"
    return ""


def command(output: Path) -> list[str]:
    """What to put before a program's command so that its counts are written beside `output`."""
    tool = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--quiet"]
    return [*tool, f"--callgrind-out-file={output}"]


class Counter:
    """Counts the instructions of calls in this process, which runs under Callgrind."""

    def __init__(self) -> None:
        self._code = mmap.mmap(-1, mmap.PAGESIZE, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
        self._code.write(_REQUEST)
        place = ctypes.addressof(ctypes.c_char.from_buffer(self._code))
        self._ask = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p)(place)
        if not self._request(_RUNNING):
            raise RuntimeError("this process does not run under Valgrind")

    def _request(self, number: int, text: bytes = b"") -> int:
        words = (ctypes.c_uint64 * 6)(number)
        words[1] = ctypes.cast(ctypes.c_char_p(text), ctypes.c_void_p).value or 0
        return int(self._ask(ctypes.addressof(words)))

    def count(self, name: str, call: Callable[[], Any]) -> Any:
        """What a call returns; its instructions are written under a name."""
        self._request(_ZERO)
        self._request(_START)
        result = call()
        self._request(_STOP)
        self._request(_DUMP_AT, name.encode())
        return result


def read_counts(output: Path) -> dict[str, int]:
    """The instructions of every call, by name."""
    counts = {}
    for path in output.parent.glob(f"{output.name}.*"):
        text = path.read_text()
        name = re.search(r"^desc: Trigger: Client Request: (.*)$", text, re.MULTILINE)
        total = re.search(r"^totals: (\d+)$", text, re.MULTILINE) or re.search(r"^summary: (\d+)", text, re.MULTILINE)
        if name and total:
            counts[name[1]] = int(total[1])
    return counts
