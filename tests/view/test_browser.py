"""The visualizer: one server, started silently at the first call, drawn over at the next."""

from __future__ import annotations

import re

import pytest

import assembly as asm
from assembly.view import browser


@pytest.fixture
def stopped():
    """Stop the server of `show` after the test."""
    yield
    while browser._running:
        window = browser._running.pop().window
        window.server_proc.kill()
        window.server_proc.communicate()
        window.zmq_socket.close(linger=0)


def test_show(balls, stopped, capfd):
    first = asm.view.show(balls)
    assert capfd.readouterr() == ("", "")
    assert re.match(r"http://127\.0\.0\.1:\d+/static/", first.url())
    before = first.static_html().count("handle_command_bytearray")
    again = asm.view.show(balls, balls.solve())
    assert again.window is first.window
    after = again.static_html().count("handle_command_bytearray")
    assert after > before
    # Drawn over: what was there before is gone.
    single = asm.view.show(asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))]), visualizer=first)
    assert single.static_html().count("handle_command_bytearray") < after


def test_a_server_that_ended_is_started_again(stopped):
    scene = asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))])
    first = asm.view.show(scene).window
    first.server_proc.kill()
    first.server_proc.communicate()
    first.zmq_socket.close(linger=0)
    assert asm.view.show(scene).window is not first


def test_bad_input_starts_nothing():
    with pytest.raises(TypeError, match="scene is 3; expected an Assembly"):
        asm.view.show(3)
    with pytest.raises(TypeError, match="visualizer is 3; expected a meshcat.Visualizer"):
        asm.view.show(asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))]), visualizer=3)
    assert browser._running == []
