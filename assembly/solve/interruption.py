"""What can end a solve early: a time limit, a callback of the user's, Ctrl-C.

The compiled loop runs without the interpreter. Every 50 ms at most (`solve/loop/pauses.py`) it calls an address in its
settings: there the interpreter runs again, so that handlers of signals do, and an answer other than 0 ends the loop. An
update of very many pairs of bodies asks as often; what it returns is whole, but where an exception throws it away.

Decompositions of large matrices run in a thread of their own, as they let nobody ask (`wait_for`).
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator
from time import perf_counter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from assembly._address import callback_address
from assembly.errors import InputError, number
from assembly.proximity.manager.parameters import SLICE
from assembly.proximity.manager.records import ABORTED, ENDS, GOES_ON
from assembly.solve.loop.settings import ASK_ADDRESS, COUNT, OBJECTIVE, OUT_OF_TIME, VIOLATION
from assembly.solve.scene import Status

__all__ = ["CTRL_C", "Interruption"]

Array = NDArray[np.float64]
Callback = Callable[[int, float, float], object]
Answer = TypeVar("Answer")
STATUSES = tuple(Status)


class Interruption:
    """Whom a solve asks whether it is to go on.

    Parameters
    ----------
    time_limit : float, optional
        Seconds from now.
    callback : callable, optional
        Called with the iteration, the objective and the feasibility [the scene's unit]; True ends the solve. In an
        update before the first iteration they are not known: nan and inf.

    Attributes
    ----------
    reason : str or None
        ``"time limit"`` or ``"callback"`` where that ended a solve.
    callback : callable, optional
        See above.
    watched : tuple of array and int, optional
        For a callback: the state of the loop that runs, and where in it results begin, which say how far it is.
    """

    def __init__(self, time_limit: float | None = None, callback: Callback | None = None) -> None:
        self._deadline = np.inf
        if time_limit is not None:
            limit = number("time_limit", time_limit)
            if not limit > 0.0:
                raise InputError(f"time_limit is {limit:g}; expected a number of seconds above 0")
            self._deadline = perf_counter() + limit
        if callback is not None and not callable(callback):
            raise TypeError(f"callback is {callback!r}; expected a function of iteration, objective and feasibility")
        self.callback = callback
        self.watched: tuple[Array, int] | None = None
        self._error: BaseException | None = None
        self.reason: str | None = None
        answers = self._answers()
        next(answers)
        # Calling the generator's own method runs no instruction outside the `try` in it, where a signal's handler could
        # raise an exception that nobody catches.
        self._function = ctypes.CFUNCTYPE(ctypes.c_int64)(answers.__next__)
        self._address = callback_address(self._function)

    def settings(self, settings: Array) -> Array:
        """Settings of a loop that asks here."""
        return self.fill(settings.copy())

    def fill(self, settings: Array) -> Array:
        """The settings themselves, with the address to ask at."""
        settings[ASK_ADDRESS] = self._address
        return settings

    @property
    def is_limited(self) -> bool:
        """Whether there is a time limit."""
        return self._deadline < np.inf

    def is_over(self) -> bool:
        """Whether no other attempt is to be made; the exception of a callback, or a signal's, is raised here."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        if self.reason is None and perf_counter() > self._deadline:
            self.reason = "time limit"
        return self.reason is not None

    def check(self, what: str) -> None:
        """Raise TimeoutError where the time limit is over before `what` is known; what a signal raised is raised, too.

        For what has no part that means anything by itself, as a rank has none.
        """
        if self.is_over():
            raise TimeoutError(f"{what} is not known yet when time_limit is over; raise time_limit or leave it out")

    def wait_for(self, what: str, compute: Callable[[], Answer]) -> Answer:
        """The answer of a call that is long and without the interpreter's lock, as decompositions are; see `check`.

        It runs in another thread. One that is not waited for any more goes on to its end, and nobody hears of it.
        """
        answers: list[Answer] = []
        errors: list[BaseException] = []

        def work() -> None:
            try:
                answers.append(compute())
            except BaseException as error:
                errors.append(error)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        while thread.is_alive():
            thread.join(1e-9 * SLICE)
            self.check(what)
        if errors:
            raise errors[0]
        return answers[0]

    def status(self, code: int) -> Status:
        """The status of a solve by the loop's code."""
        if code != OUT_OF_TIME:
            return STATUSES[code]
        return Status.STOPPED if self.reason == "callback" else Status.TIME_LIMIT

    def _answers(self) -> Iterator[int]:
        answer = GOES_ON
        while True:
            try:
                yield answer
                # What threw a solve away throws away all that it asks for on its way out.
                answer = self._ask() if self._error is None else ABORTED
            except GeneratorExit:
                return
            except BaseException as error:
                self._error, answer = error, ABORTED

    def _ask(self) -> int:
        if perf_counter() > self._deadline:
            self.reason = "time limit"
        elif self.reason is None and self.callback is not None and self.watched is not None:
            state, results_at = self.watched
            progress = state[results_at:]
            if self.callback(int(progress[COUNT]), float(progress[OBJECTIVE]), float(progress[VIOLATION])):
                self.reason = "callback"
        return GOES_ON if self.reason is None else ENDS


class _CtrlC(Interruption):
    """That of solves without a limit or a callback: in the main thread alone, where handlers of signals run.

    Settings that many solves share are filled once.
    """

    def settings(self, settings: Array) -> Array:
        if threading.get_ident() == threading.main_thread().ident:
            return settings
        settings = settings.copy()
        settings[ASK_ADDRESS] = 0.0
        return settings

    def is_over(self) -> bool:
        """As any other's, but that only an exception of a signal's handler can end it."""
        return self._error is not None and super().is_over()


CTRL_C = _CtrlC()
