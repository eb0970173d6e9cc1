"""Scenes and solutions to look at, in a browser or in a file; nothing else imports this package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.view.animation import animate as animate
    from assembly.view.browser import show as show
    from assembly.view.dragging.page import Live as Live
    from assembly.view.dragging.page import live as live
    from assembly.view.in_notebook import notebook as notebook
    from assembly.view.page import save_html as save_html
    from assembly.view.playback import replay as replay
    from assembly.view.style import Style as Style
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "animate": "assembly.view.animation",
            "Live": "assembly.view.dragging.page",
            "Style": "assembly.view.style",
            "live": "assembly.view.dragging.page",
            "notebook": "assembly.view.in_notebook",
            "replay": "assembly.view.playback",
            "save_html": "assembly.view.page",
            "show": "assembly.view.browser",
        },
    )
