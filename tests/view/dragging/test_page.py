"""A scripted mouse drags a paper clip in Chromium: it moves, contacts hold, and no wire crosses."""

import itertools
import re
import runpy
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import assembly as asm
from assembly.view.mesh import body_mesh
from tests.view.chromium import decoded

pytest.importorskip("viser", reason="the page is viser's: extra `live`")
# Seconds for a page to come up where a processor draws it that others use as well.
PATIENCE = 300.0
EXAMPLE = Path(__file__).parents[3] / "examples" / "take_hold.py"


@pytest.fixture(scope="module")
def clips():
    return runpy.run_path(str(EXAMPLE))["two_clips"]()


def wait_for(what, patience=PATIENCE, every=0.05):
    end = time.monotonic() + patience
    while not what():
        assert time.monotonic() < end, "it did not come"
        time.sleep(every)


def on_screen(page, client, points):
    """Pixels (n, 2) of points of the scene."""
    camera = client.camera
    w, x, y, z = camera.wxyz
    turn = asm.Pose(quaternion=(w, x, y, z)).matrix[:3, :3]
    seen = (page._frame.there(points) - np.array(camera.position)) @ turn
    focal = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
    return focal * seen[:, :2] / seen[:, 2:] + 0.5 * np.array([camera.image_width, camera.image_height])


def shows_a_body(browser, tab, picture, x, y):
    """Whether a picture of the page has a color at a pixel of the layout: backgrounds and notices have none."""
    browser.shot(tab, picture)
    pixels = decoded(picture).astype(int)
    row, column = int(0.5 * y), int(0.5 * x)
    if not (0 <= row < pixels.shape[0] and 0 <= column < pixels.shape[1]):
        return False
    return np.ptp(pixels[row, column]) > 30


def drag(page, client, browser, tab, body, inside, picture):
    """Have a scripted mouse take the lowest or highest place of a body, so many pixels inside, and pull it aside.

    The button stays down; returns where the mouse is. The page is looked at before: a mouse that presses what is not
    drawn yet, or before the page has its camera, turns the camera instead. What is drawn slowly answers slowly: a mouse
    that lets go before is answered by nothing, ever.
    """
    row = page.q[page._session.scene.bodies.index(body)]
    corners = asm.Pose(row[:3], row[3:]).apply(body_mesh(body).vertices)
    waits = (3.0 * 2.0 ** min(k, 4) for k in itertools.count())
    begun = page._server.initial_camera
    ends, tried = [], itertools.count()

    def grabbed():
        if not np.allclose(client.camera.position, begun.position, atol=1e-3):
            # Not there yet, or turned by a mouse that missed: from there a body may be behind another one.
            if ends:
                client.camera.position, client.camera.look_at = begun.position, begun.look_at
            time.sleep(0.5)
            return False
        pixels = on_screen(page, client, corners)
        # Where a notice or another body is before the lowest place, the highest one may be free.
        lowest = next(tried) % 2 == 0
        x, y = pixels[pixels[:, 1].argmax() if lowest else pixels[:, 1].argmin()] - (0.0, inside if lowest else -inside)
        if not shows_a_body(browser, tab, picture, x, y):
            time.sleep(0.5)
            return False
        browser.mouse(tab, "mouseMoved", x, y, pressed=False)
        browser.mouse(tab, "mousePressed", x, y)
        for k in range(1, 16):
            browser.mouse(tab, "mouseMoved", x + 4.0 * k, y - 2.0 * k)
            time.sleep(0.03)
        ends.append((x + 60.0, y - 30.0))
        end = time.monotonic() + next(waits)
        while page.shown.held != body.name and time.monotonic() < end:
            time.sleep(0.05)
        if page.shown.held != body.name:
            browser.mouse(tab, "mouseReleased", *ends[-1])
        return page.shown.held == body.name

    wait_for(grabbed)
    return ends[-1]


def test_a_mouse_drags_a_clip(browser, clips, tmp_path):
    start = clips.solve().q
    with (
        asm.view.live(clips, start, port=0) as page,
        # So wide that the clip does not go behind the notice of a browser without a GPU, which comes after a while.
        browser.visited(page.url.replace("localhost", "127.0.0.1"), width=800) as tab,
    ):
        wait_for(lambda: page._server.get_clients())
        (client,) = page._server.get_clients().values()
        # The lower end of the clip, a little inside of its outline.
        drag(page, client, browser, tab, clips["green"], 4.0, tmp_path / "picture.png")
        wait_for(lambda: np.abs(page.q[1] - start[1]).max() > 0.5)
        shown = page.shown
        assert shown.violation < 1e-9 and np.isfinite(shown.q).all()
        browser.mouse(tab, "mouseReleased", 0.0, 0.0)
        wait_for(lambda: page.shown.holder is None)
        moved = page.q
    # What the page showed is a pose of the scene: contacts hold, and nothing crosses.
    assert np.array_equal(moved[0], start[0]) and not np.array_equal(moved[1], start[1])
    checked = clips.solve(moved, max_iterations=0)
    assert checked.feasibility < 1e-9 and checked.crossings == ()


def middle_of_red(chromium, tab, picture):
    """The median place of the red pixels of a page, (2,); NaN without any. The orange of a notice is none."""
    chromium.shot(tab, picture)
    red, green, blue = (decoded(picture)[:, :, k].astype(float) for k in range(3))
    rows, columns = np.nonzero((red > 60.0) & (red > 3.0 * np.maximum(green, blue)))
    return np.array([np.median(columns), np.median(rows)]) if len(rows) > 100 else np.full(2, np.nan)


def test_two_browsers_see_the_same_scene(browser, tmp_path):
    """Two people's browsers: in one a mouse drags, and the picture of the other follows."""
    floor = asm.Body("floor", asm.shapes.plane(6.0, 6.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.7), position=(-1.0, 0.0, 0.7))
    ball.color = (0.9, 0.05, 0.05)
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball))
    picture = tmp_path / "picture.png"
    with asm.view.live(scene, port=0) as page:
        address = page.url.replace("localhost", "127.0.0.1")
        # So wide that the ball goes neither behind the panel nor behind the notice of a browser without a GPU.
        with browser.visited(address, width=800) as tab:
            wait_for(lambda: page._server.get_clients())
            (client,) = page._server.get_clients().values()
            with browser.visited(address, width=800) as second:
                wait_for(lambda: len(page._server.get_clients()) == 2)

                def middle(q):
                    # In pixels of the picture, twice as large as those of the layout. Both look from one place.
                    return 0.5 * on_screen(page, client, q[1:2, :3])[0]

                def is_seen():
                    # As a ball off the axis is seen, and to a pixel.
                    found = [middle_of_red(browser, each, picture) for each in (tab, second)]
                    return all(np.abs(each - middle(page.q)).max() < 3.0 for each in found)

                start = page.q
                wait_for(is_seen, every=0.5)
                end = drag(page, client, browser, tab, ball, 12.0, picture)
                wait_for(lambda: np.abs(middle(page.q) - middle(start)).max() > 15.0)
                assert page.shown.holder == client.client_id and page.shown.violation < 1e-10
                browser.mouse(tab, "mouseReleased", *end)
                wait_for(lambda: page.shown.holder is None)
                wait_for(is_seen, every=0.5)


def test_a_browser_that_leaves_lets_go_and_others_go_on(browser):
    floor = asm.Body("floor", asm.shapes.plane(6.0, 6.0), fixed=True)
    balls = [asm.Body(n, asm.shapes.sphere(0.5), position=(x, 0.0, 0.5)) for n, x in (("red", -1.5), ("blue", 1.5))]
    scene = asm.Assembly([floor, *balls])
    scene.constrain(*(asm.Contact(floor, ball) for ball in balls))
    with asm.view.live(scene, port=0) as page:
        with browser.visited(page.url.replace("localhost", "127.0.0.1")):
            wait_for(lambda: page._server.get_clients())
            (number,) = page._server.get_clients()
            page._session.ask(lambda: page._session.grab("red", np.array([-1.5, 0.0, 1.0]), number))
            page._session.ask(lambda: page._session.grab("blue", np.array([1.5, 0.0, 1.0]), number + 1))
            for client, x in ((number, -1.0), (number + 1, 1.0)):
                page._session.ask(lambda c=client, x=x: page._session.move(np.array([x, 0.0, 1.0]), c))
            wait_for(lambda: np.abs(page.q[1:, 0] - [-1.5, 1.5]).min() > 0.3)
            shown = page.shown
            assert shown.who == f"red (browser {number}), blue (browser {number + 1})" and shown.violation < 1e-10
        wait_for(lambda: len(page.shown.hands) == 1)
        assert page.shown.hands[0].body == "blue" and "the constraints hold" in page.shown.status
        page._session.ask(lambda: page._session.release(number + 1))
        wait_for(lambda: page.shown.holder is None)
        assert page.shown.status == "nothing is held"


@pytest.fixture
def crank():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground.frame(), arm.frame(), name="hinge", limits=(-1.0, 2.0)))
    return scene


def test_sliders_stand_where_joints_are(crank):
    with asm.view.live(crank, port=0) as page:
        slider = page._controls._sliders["hinge.angle"]
        page._session.ask(lambda: page._session.set_value("hinge.angle", 0.75))
        wait_for(lambda: abs(slider.value - 0.75) < 0.01)
        page._session.ask(page._session.reset)
        wait_for(lambda: abs(slider.value) < 0.01)


def test_rings_that_another_browser_takes_away_are_let_go(crank):
    with asm.view.live(crank, port=0) as page:
        arm, asked = crank["arm"], page._session.ask

        def event(phase):
            return SimpleNamespace(client_id=1, phase=phase, target=page._gizmo)

        page._clicked(arm, None)
        page._turn(event("start"))
        wait_for(lambda: page.shown.holder == 1)
        page._clicked(arm, None)
        page._turn(event("update"))
        page._turn(event("end"))
        wait_for(lambda: page.shown.holder is None)
        asked(lambda: page._session.grab("arm", None, 2))
        wait_for(lambda: page.shown.holder == 2)


def test_a_port_that_is_taken_and_closing_twice(crank):
    with asm.view.live(crank, port=0) as page:
        port = int(page.url.rsplit(":", 1)[1])
        with (
            pytest.warns(UserWarning, match=f"port {port} is in use; the page is at port"),
            asm.view.live(crank, port=port) as other,
        ):
            assert other.url != page.url
            other.close()
        other.close()
        assert page.shown.status == "SOLVED"


def test_the_page_has_names_joints_axes_and_opacities(crank):
    style = asm.view.Style(labels=["bodies"], unit="mm", opacity={"arm": 0.5}, legend=True)
    with asm.view.live(crank, port=0, style=style) as page:
        said = page._said
        assert [label.text for label in said.labels["joints"]] == ["hinge"]
        assert all(label.visible for label in said.labels["bodies"]) and not said.labels["joints"][0].visible
        assert len(said.glyphs) == 1
        assert [round(node.opacity or 1.0, 6) for node in page._nodes.values()] == [1.0, 0.5]
        (length,) = [handle.text for handle in said.axes if getattr(handle, "text", "").startswith("x")]
        assert re.fullmatch(r"x  [125][\d.e-]* mm", length) or length.startswith("x  0.")
    with pytest.raises(asm.errors.InputError, match="opacity has 'leg'; expected one of 'ground', 'arm'"):
        asm.view.live(crank, style=asm.view.Style(opacity={"leg": 0.5}))


def test_a_scene_far_from_the_origin_is_in_the_middle_of_the_page():
    far = 1e6
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(far, far, far))
    with asm.view.live(asm.Assembly([ball]), port=0) as page:
        (node,) = page._nodes.values()
        # Browsers compute with single precision, which has 0.06 there.
        assert np.abs(np.array(node.position)).max() < 1e-9
        page._session.ask(lambda: page._session.grab("ball", np.array([far, far, far + 0.5]), 1))
        page._session.ask(lambda: page._session.move(np.array([far + 1.0, far, far + 0.5]), 1))
        wait_for(lambda: page.q[0, 0] > far + 0.5)
        wait_for(lambda: node.position[0] > 0.4 * page._frame.scale)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"port": -1}, "port"),
        ({"port": 70000}, "port"),
        ({"host": ""}, "host is ''"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"host": "no-such-host.invalid"}, "host is 'no-such-host.invalid'; expected an address of this machine"),
        ({"host": "192.0.2.1"}, r"host is '192\.0\.2\.1'; expected an address of this machine"),
    ],
)
def test_arguments_are_checked(clips, options, message):
    with pytest.raises(asm.errors.InputError, match=message):
        asm.view.live(clips, **options)


def test_a_scene_is_expected():
    with pytest.raises(TypeError, match="expected an Assembly"):
        asm.view.live([])
    with pytest.raises(asm.errors.InputError, match="no bodies"):
        asm.view.live(asm.Assembly())


def test_the_command_says_what_is_wrong(tmp_path, capsys):
    from assembly.live import main

    assert main([str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err
