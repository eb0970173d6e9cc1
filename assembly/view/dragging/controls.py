"""Controls beside the picture: the status, joint coordinates as sliders, buttons, a graph of violation and time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from assembly.view.dragging.joint_values import freedoms_of, reach_of
from assembly.view.dragging.said import Said
from assembly.view.dragging.session import Session
from assembly.view.dragging.shown import Shown

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = ["Controls"]

# Points of the graph, and seconds between them.
POINTS, GRAPH_EVERY = 120, 0.2
# Seconds for which a slider that somebody has moved is not moved by the program.
LEFT_ALONE = 1.0


class Controls:
    """What stands beside the picture.

    Parameters
    ----------
    server : ViserServer
    session : Session
    said : Said
        Names and what else is shown on request.
    scale : float
        From lengths of the scene to those of the page, whose radius is 1.
    """

    def __init__(self, server: ViserServer, session: Session, said: Said, scale: float) -> None:
        self._session = session
        gui = server.gui
        self._status = gui.add_markdown("")
        self._figures = gui.add_markdown("")
        self._sliders: dict[str, Any] = {}
        self._slid_at: dict[str, float] = {}
        self._values: Mapping[str, float] = {}
        freedoms = freedoms_of(session.scene)
        if freedoms:
            with gui.add_folder("joints"):
                for name, freedom in freedoms.items():
                    low, high = reach_of(freedom, 1.0 / scale)
                    start = min(max(freedom.value or 0.0, low), high)
                    slider = gui.add_slider(name, low, high, (high - low) / 1000.0, start)
                    slider.on_update(partial(self._slid, name))
                    self._sliders[name] = slider
        with gui.add_folder("scene"):
            for label, call in (
                ("solve", session.solve),
                ("mobility", session.say_mobility),
                ("undo", session.undo),
                ("reset", session.reset),
            ):
                gui.add_button(label).on_click(partial(self._clicked, call))
            record = gui.add_checkbox("record", False)
            record.on_update(lambda event: session.ask(partial(session.record, bool(event.target.value))))
            play = gui.add_checkbox("play", False, hint="what was recorded")
            play.on_update(lambda event: session.ask(partial(session.play, bool(event.target.value))))
            said.add_boxes(gui)
        self._graph = self._new_graph(gui)
        self._history = np.zeros((3, POINTS))
        self._graphed = 0.0

    @staticmethod
    def _new_graph(gui: Any) -> Any:
        from viser import uplot

        zeros = np.zeros(POINTS)
        series = (
            uplot.Series(label="s"),
            uplot.Series(label="log10 violation", stroke="#dc2e33", scale="y"),
            uplot.Series(label="log10 tick [s]", stroke="#296bd9", scale="y"),
        )
        scales = {"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(range=(-18.0, 0.0))}
        return gui.add_uplot((np.arange(POINTS) * GRAPH_EVERY, zeros - 18.0, zeros - 18.0), series, scales=scales)

    def _clicked(self, call: Callable[[], None], event: Any) -> None:
        self._session.ask(call)

    def _slid(self, name: str, event: Any) -> None:
        # A slider that the program sets calls no callback.
        if event.client is not None:
            self._slid_at[name] = perf_counter()
            self._session.ask(partial(self._session.slide, name, float(event.target.value), event.client.client_id))

    def show(self, shown: Shown, now: float) -> None:
        """Show figures; the graph is sent less often."""
        lines = [f"**{shown.who}**"] if shown.hands else []
        lines += [shown.status] if shown.notice in ("", shown.status) else [shown.status, f"*{shown.notice}*"]
        self._status.content = "\n\n".join(lines)
        self._follow(shown.values, now)
        forces = " + ".join(f"{np.linalg.norm(hand.force):.3g}" for hand in shown.hands) or "0"
        self._figures.content = (
            f"force {forces}, violation {shown.violation:.1e}, {1e6 * shown.seconds:.0f} us, "
            f"{len(shown.contacts)} contacts"
        )
        if now - self._graphed >= GRAPH_EVERY:
            self._graphed = now
            self._history = np.roll(self._history, -1, axis=1)
            self._history[1:, -1] = np.log10(max(shown.violation, 1e-18)), np.log10(max(shown.seconds, 1e-18))
            x = np.arange(POINTS) * GRAPH_EVERY
            self._graph.data = (x, self._history[1].copy(), self._history[2].copy())

    def _follow(self, values: Mapping[str, float], now: float) -> None:
        """Have sliders where joints are."""
        if values is self._values:
            return
        left = False
        for name, slider in self._sliders.items():
            if now - self._slid_at.get(name, -np.inf) < LEFT_ALONE:
                left = True
            elif name in values:
                value = min(max(values[name], slider.min), slider.max)
                if abs(value - slider.value) > 0.5 * slider.step:
                    slider.value = value
        if not left:
            self._values = values
