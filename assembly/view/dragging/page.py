"""The page of a scene that is dragged: viser's server, meshes for the mouse, and controls."""

from __future__ import annotations

import socket
import threading
import warnings
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.errors import InputError, integer
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.tracking.trace import Trace
from assembly.view.dragging.controls import Controls
from assembly.view.dragging.said import Said
from assembly.view.dragging.session import Session
from assembly.view.dragging.shown import Shown
from assembly.view.item import FIELD_OF_VIEW, Stations
from assembly.view.mesh import body_mesh
from assembly.view.picture import DIRECTION, body_colors
from assembly.view.skeleton import fineness, held_points, link_mesh
from assembly.view.style import Style, checked_style

if TYPE_CHECKING:
    from viser import SceneNodeDragEvent, SceneNodePointerEvent, TransformControlsEvent, ViserServer

__all__ = ["Live", "live"]

Array = NDArray[np.float64]
# Pictures a second that browsers are sent: a new pose waits for 17 ms at most. One takes some 0.06 ms a body.
RATE = 60.0
# Most balls that stand for contacts.
MOST_CONTACTS = 40
# Most hands whose force is said.
MOST_HANDS = 8
# The radius of the scene in the page: browsers compute with single precision.
RADIUS = 1.0


def _server(host: str, port: int) -> ViserServer:
    try:
        from viser import ViserServer
    except ImportError as error:
        raise ImportError(
            'the page needs viser, which is not installed; pip install "assembly-solver[live]"'
        ) from error
    # Viser tries port after port, and would do so without end for a host that is not an address of this machine.
    try:
        family, _, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, socket.SOCK_STREAM) as free:
            free.bind(address)
    except OSError as error:
        raise InputError(
            f"host is {host!r}; expected an address of this machine, '127.0.0.1' for itself alone or '0.0.0.0' for "
            f"networks as well: {error}"
        ) from None
    # Viser prints an announcement.
    with redirect_stdout(StringIO()):
        server = ViserServer(host=host, port=port, label="assembly", verbose=False)
    if port not in (0, server.get_port()):
        # Viser takes the next free port; whoever gave others the address has to know.
        message = f"port {port} is in use; the page is at port {server.get_port()}"
        warnings.warn(message, stacklevel=3)
    return server


@dataclass(frozen=True)
class _Frame:
    """From the scene to the page: moved to the middle and scaled."""

    middle: Array
    scale: float

    def there(self, points: ArrayLike) -> Array:
        """Points of the scene in the page."""
        return (np.asarray(points, dtype=np.float64) - self.middle) * self.scale

    def back(self, points: ArrayLike) -> Array:
        """Points of the page in the scene."""
        return np.asarray(points, dtype=np.float64) / self.scale + self.middle


class Live:
    """A scene that is being dragged in browsers; made by `assembly.view.live`.

    Attributes
    ----------
    url : str
        Where browsers find the page.
    shown : Shown
        What there is to see now: poses, status, force, violation.
    """

    def __init__(self, session: Session, server: ViserServer, style: Style) -> None:
        self._session, self._server, self._style = session, server, style
        host = server.get_host()
        self.url = f"http://{'localhost' if host in ('0.0.0.0', '127.0.0.1') else host}:{server.get_port()}"
        self._ended = threading.Event()
        self._frame, self._corner, meshes = _meshes(session.scene, session.shown.q, style.angle)
        self._bodies = dict(zip(session.scene.bodies, meshes, strict=True))
        self._draw()
        self._controls = Controls(server, session, self._said, self._frame.scale)
        self._drawn: Shown | None = None
        session.start()
        self._painter = threading.Thread(target=self._paint, name="assembly page", daemon=True)
        self._painter.start()

    @property
    def shown(self) -> Shown:
        """What there is to see now."""
        return self._session.shown

    @property
    def q(self) -> Array:
        """Where the bodies stand now, (n, 7)."""
        return self._session.shown.q

    @property
    def trace(self) -> Trace:
        """The last recorded motion of the target; raises `InputError` if there is none."""
        return self._session.trace

    def wait(self) -> None:
        """Wait until `close` is called in another thread, or Ctrl-C."""
        self._ended.wait()

    def close(self) -> None:
        """End the page, its server and its threads."""
        if not self._ended.is_set():
            self._ended.set()
            self._painter.join()
            self._session.stop()
            with redirect_stdout(StringIO()):
                self._server.stop()

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Live({self._session.scene!r}, {self.url!r})"

    def _draw(self) -> None:
        """Put everything in the page that moves later on."""
        scene, server = self._server.scene, self._server
        scene.set_up_direction("+z")
        camera = server.initial_camera
        toward = np.array(DIRECTION) / np.linalg.norm(DIRECTION)
        camera.position = tuple(toward * 1.15 * RADIUS / np.sin(np.deg2rad(FIELD_OF_VIEW) / 2.0))
        camera.look_at, camera.fov = (0.0, 0.0, 0.0), float(np.deg2rad(FIELD_OF_VIEW))
        self._nodes: dict[Body, Any] = {}
        colors = list(body_colors(list(self._bodies)))
        for k, ((body, (vertices, triangles)), color) in enumerate(zip(self._bodies.items(), colors, strict=True)):
            red, green, blue = (round(255 * part) for part in color)
            opacity = self._style.opacity_of(body)
            node = scene.add_mesh_simple(
                f"/bodies/{k}",
                vertices,
                triangles,
                color=(red, green, blue),
                side="double",
                opacity=None if opacity == 1.0 else opacity,
            )
            self._nodes[body] = node
            if not body.fixed:
                node.on_drag(partial(self._dragged, body))
                node.on_click(partial(self._clicked, body))
        self._said = Said(self._session.scene, scene, self._frame.scale, self._style, colors)
        self._said.add_axes(self._frame.there(self._corner))
        self._contacts = [
            scene.add_icosphere(f"/contacts/{k}", 0.012 * RADIUS, (255, 184, 26), visible=False)
            for k in range(MOST_CONTACTS)
        ]
        self._turned: Body | None = None
        self._gizmo = scene.add_transform_controls("/gizmo", 0.25 * RADIUS, depth_test=False, visible=False)
        self._gizmo.on_update(self._turn)
        self._arrow = scene.add_arrows("/hands", np.zeros((1, 2, 3)), (40, 43, 51), visible=False)
        self._forces = [scene.add_label(f"/forces/{k}", "", visible=False) for k in range(MOST_HANDS)]
        server.on_client_disconnect(lambda client: self._session.ask(partial(self._session.release, client.client_id)))

    def _dragged(self, body: Body, event: SceneNodeDragEvent[Any]) -> None:
        session, client = self._session, event.client_id
        end = self._frame.back(event.end_position)
        if event.phase == "start":
            start = self._frame.back(event.start_position)
            session.ask(partial(session.grab, body.name, start, client))
        if event.phase == "end":
            session.ask(partial(session.release, client))
        else:
            session.ask(partial(session.move, end, client))

    def _clicked(self, body: Body, event: SceneNodePointerEvent[Any]) -> None:
        """Put axes and rings at a body, by which it is dragged and turned; a second click takes them away."""
        self._turned = None if self._turned is body else body
        self._gizmo.visible = self._turned is not None
        self._drawn = None

    def _turn(self, event: TransformControlsEvent) -> None:
        session, body, client = self._session, self._turned, event.client_id
        if client is None:
            return
        if event.phase == "end":
            # Another browser may have taken the rings away by then.
            session.ask(partial(session.release, client))
        elif body is None:
            return
        elif event.phase == "start":
            session.ask(partial(session.grab, body.name, None, client))
        else:
            target = np.append(self._frame.back(event.target.position), event.target.wxyz)
            session.ask(partial(session.move, target, client))

    def _paint(self) -> None:
        """Send what has changed, so many times a second."""
        while not self._ended.wait(1.0 / RATE):
            shown = self._session.shown
            if shown is not self._drawn:
                before = perf_counter()
                self._send(shown)
                self._controls.show(shown, before)
                self._drawn = shown

    def _send(self, shown: Shown) -> None:
        with self._server.atomic():
            places = self._frame.there(shown.q[:, :3])
            for node, place, row in zip(self._nodes.values(), places, shown.q, strict=True):
                node.position, node.wxyz = place, row[3:]
            for k, ball in enumerate(self._contacts):
                ball.visible = k < len(shown.contacts) and self._style.glyphs != "none"
                if ball.visible:
                    ball.position = self._frame.there(shown.contacts[k][0])
            if self._turned is not None and self._turned.name not in [hand.body for hand in shown.hands]:
                row = shown.q[list(self._nodes).index(self._turned)]
                self._gizmo.position, self._gizmo.wxyz = self._frame.there(row[:3]), row[3:]
            self._arrow.visible = bool(shown.hands)
            if shown.hands:
                ends = self._frame.there([[hand.point, hand.target] for hand in shown.hands])
                self._arrow.points = ends.astype(np.float32)
            for k, label in enumerate(self._forces):
                label.visible = k < len(shown.hands)
                if label.visible:
                    hand = shown.hands[k]
                    label.position, label.text = self._frame.there(hand.target), f"{np.linalg.norm(hand.force):.3g}"


def _meshes(scene: Assembly, q: Array, angle: float) -> tuple[_Frame, Array, list[tuple[Array, NDArray[np.int64]]]]:
    """The scale of the page, the lowest corner of the bodies, and the triangles of every body in the page."""
    held = held_points(scene)
    made = {body: body_mesh(body, angle=angle) for body in scene.bodies}
    stations = Stations(scene.bodies, q[None])
    seen = [
        stations.points(body, (held[body] if len(held[body]) else np.zeros((1, 3))) if mesh is None else mesh.vertices)
        for body, mesh in made.items()
    ]
    points = np.concatenate([part.reshape(-1, 3) for part in seen])
    low, high = points.min(axis=0), points.max(axis=0)
    radius = 0.5 * float(np.linalg.norm(high - low)) or 1.0
    frame = _Frame(0.5 * (low + high), RADIUS / radius)
    size = fineness(scene, held, radius)
    meshes = []
    for body, mesh in made.items():
        if mesh is None:
            ends = held[body] if len(held[body]) else np.zeros((1, 3))
            mesh = link_mesh(frame.scale * ends, size)
            meshes.append((mesh.vertices, mesh.triangles))
        else:
            meshes.append((frame.scale * mesh.vertices, mesh.triangles))
    return frame, low, meshes


def live(
    scene: Assembly,
    q0: ArrayLike | Solution | None = None,
    *,
    stiffness: float = 1.0,
    host: str = "127.0.0.1",
    port: int = 8080,
    style: Style | None = None,
) -> Live:
    """Open a page in which bodies are dragged with the mouse while contacts and clearances hold.

    The server runs beside the script until `close`, or until the script ends; `live(scene).wait()` keeps a script from
    ending. With a host other than 127.0.0.1 everybody who can reach it can drag.

    Parameters
    ----------
    scene : Assembly
        Its bodies keep their poses; `Live.q` is where they are dragged to.
    q0 : (n, 7) or Solution, optional
        Where to begin: the constraints are solved from there.
    stiffness : float
        Force over distance of the spring that the mouse draws with.
    host : str
    port : int
        0 to 65535, 0 for any. If it is in use, it is the next free one, and a warning says so.
    style : Style, optional
        Opacities, edges, names, axes with their length, legend, glyphs; boxes beside the picture change some of them.

    Returns
    -------
    Live

    Raises
    ------
    InputError, TypeError
        A scene whose constraints cannot be solved from the start, a port out of range.
    ImportError
        Without viser, of the extra `live`.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if not scene.bodies:
        raise InputError("scene has no bodies; expected one at least")
    if not isinstance(host, str) or not host:
        raise InputError(f"host is {host!r}; expected a name or an address, say '127.0.0.1'")
    look = checked_style(style, (body.name for body in scene.bodies))
    session = Session(scene, q0, stiffness)
    return Live(session, _server(host, integer("port", port, 0, 65535)), look)
