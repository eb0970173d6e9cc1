"""Saved pages: whole, reproducible, and seen by a browser that has no network."""

from __future__ import annotations

import base64
import colorsys
import gzip
import re

import numpy as np
import pytest
import umsgpack

import assembly as asm
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.view.commands import ROOT, commands
from assembly.view.picture import draw


def drawn(page):
    """The commands in a page's text, each behind its length."""
    (text,) = re.findall(r'id="packed-drawing">([A-Za-z0-9+/=]+)<', page)
    data, found = gzip.decompress(base64.b64decode(text)), []
    while data:
        length = int.from_bytes(data[:4], "big")
        found.append(umsgpack.unpackb(data[4 : 4 + length]))
        data = data[4 + length :]
    return found


def array(data):
    dtype = {0x16: "<u4", 0x17: "<f4"}[data["array"].type]
    return np.frombuffer(data["array"].data, dtype)


def test_a_page_holds_the_picture(balls, tmp_path):
    solution = balls.solve()
    asm.view.save_html(tmp_path / "balls.html", balls, solution)
    found = drawn((tmp_path / "balls.html").read_text(encoding="utf-8"))
    picture = draw(balls, solution)
    assert len(found) == len(list(commands(picture)))
    objects = {c["path"]: c["object"] for c in found if c["type"] == "set_object"}
    places = {c["path"]: c["matrix"] for c in found if c["type"] == "set_transform"}
    assert len(objects) == len(places) == len(picture.items)
    for item in picture.items:
        path = "/".join([ROOT, *item.path])
        # Columns after each other, as the viewer wants them.
        assert np.reshape(places[path], (4, 4)).T == pytest.approx(item.matrix, abs=0)
        data = objects[path]["geometries"][0]["data"]
        # Single precision is the browser's.
        vertices = array(data["attributes"]["position"]).reshape(-1, 3)
        assert vertices == pytest.approx(item.mesh.vertices, rel=1e-6, abs=1e-6 * np.abs(item.mesh.vertices).max())
        assert np.linalg.norm(array(data["attributes"]["normal"]).reshape(-1, 3), axis=1) == pytest.approx(1, abs=1e-6)
        assert (array(data["index"]).reshape(-1, 3) == item.mesh.triangles).all()


def test_a_page_refers_to_nothing_outside(balls, tmp_path):
    asm.view.save_html(tmp_path / "balls.html", balls)
    page = (tmp_path / "balls.html").read_text(encoding="utf-8")
    (packed,) = re.findall(r'id="packed-viewer">([A-Za-z0-9+/=]+)<', page)
    viewer = gzip.decompress(base64.b64decode(packed)).decode()
    # The namespace of XHTML in the viewer's script is a name, not a place.
    assert set(re.findall(r"https?://[^\s\"'`<>)]+", viewer)) <= {"http://www.w3.org/1999/xhtml"}
    page = re.sub(r">[A-Za-z0-9+/=]+<", "><", page)
    assert "http" not in page
    markup = re.sub(r"<script>.*?</script>", "", page, flags=re.S)
    assert not re.search(r"\b(src|href|srcset|@import|url)\b", markup)
    # What is packed is run by a script that is ours, and what is said is data for another one.
    assert set(re.findall(r"<script([^>]*)>", page)) == {
        "",
        ' type="text/plain" id="packed-viewer"',
        ' type="text/plain" id="packed-drawing"',
        ' type="application/json" id="said"',
        ' type="text/plain" class="with-viewer"',
    }
    ours = "".join(
        re.findall(r"<script(?: type=\"text/plain\" class=\"with-viewer\")?>(.*?)</script>", page, flags=re.S)
    )
    assert "handle_command_bytearray" in ours and not re.search(r"connect|fetch|import", ours)


def test_pages_of_the_same_scene_are_the_same(balls, tmp_path):
    for name in ("one", "two"):
        asm.view.save_html(str(tmp_path / name), balls, title="balls")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    asm.view.save_html(tmp_path / "one", balls, title="<balls> & co")
    assert "<title>&lt;balls&gt; &amp; co</title>" in (tmp_path / "one").read_text(encoding="utf-8")


def test_saving_starts_nothing_and_does_not_import_meshcat(run_python, tmp_path):
    code = f"""
import subprocess, sys
def refuse(*args, **kwargs):
    raise AssertionError("a process was started")
subprocess.Popen = refuse
import assembly as asm
asm.view.save_html({str(tmp_path / "page.html")!r}, asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))]))
print([m for m in ("meshcat", "zmq", "tornado", "casadi") if m in sys.modules])
"""
    assert run_python(code).strip() == "[]"


def test_a_name_with_a_slash_is_one_name():
    scene = asm.Assembly([asm.Body("left/hand", asm.shapes.sphere(1.0))])
    paths = [c["path"] for c in commands(draw(scene)) if c["type"] == "set_object"]
    assert paths == [ROOT + "/bodies/left\N{DIVISION SLASH}hand"]


def test_nothing_is_written_for_a_bad_scene(tmp_path):
    with pytest.raises(ValueError, match="scene has no bodies"):
        asm.view.save_html(tmp_path / "page.html", asm.Assembly())
    assert not (tmp_path / "page.html").exists()


def test_a_browser_shows_every_body(balls, photo, tmp_path):
    asm.view.save_html(tmp_path / "balls.html", balls, balls.solve())
    pixels = photo(tmp_path / "balls.html")
    colors = np.unique(pixels.reshape(-1, 3), axis=0)
    assert len(colors) > 300  # smooth shading, not flat shapes
    strong = pixels[np.ptp(pixels.astype(int), axis=2) > 60] / 255.0
    hues = np.array([360.0 * colorsys.rgb_to_hsv(*color)[0] for color in strong])
    columns = np.nonzero(np.ptp(pixels.astype(int), axis=2) > 60)[1]
    middles = []
    for hue in (0.0, 145.0, 217.0):
        near = np.abs((hues - hue + 180.0) % 360.0 - 180.0) < 20.0
        assert near.sum() > 500
        middles.append(np.median(columns[near]))
    # Left to right as they stand.
    assert middles[0] + 50 < middles[1] < middles[2] - 50
    # The background is light, and bodies reach neither side.
    assert pixels[:, [0, -1]].min() > 200


def test_no_body_no_hue(photo, tmp_path):
    # The test above can fail: a scene of one red ball has neither green nor blue in it.
    asm.view.save_html(tmp_path / "ball.html", asm.Assembly([asm.Body("red", asm.shapes.sphere(1.0))]))
    pixels = photo(tmp_path / "ball.html").astype(int)
    strong = np.ptp(pixels, axis=2) > 60
    assert strong.mean() > 0.1
    assert (pixels[strong].argmax(axis=1) == 0).all()


def test_a_browser_shows_an_ellipsoid_and_what_is_behind_it(photo, tmp_path):
    scene = asm.Assembly([asm.Body("green", asm.shapes.sphere(0.5))])
    veil = Ellipsoid((0, 0, 0), np.eye(3), (2, 2, 2), (1, 0, 0))
    asm.view.save_html(tmp_path / "veil.html", scene, ellipsoids=veil)
    pixels = photo(tmp_path / "veil.html").astype(int)
    height, width, _ = pixels.shape
    rows = pixels[height // 2 - 15 : height // 2 + 15]
    # The ball in the middle keeps something of its color, the veil beside it is red, and beside that it is light.
    middle, beside = (
        np.median(rows[:, width // 2 + x - 15 : width // 2 + x + 15].reshape(-1, 3), axis=0) for x in (0, -75)
    )
    assert middle[1] > middle[2] + 20
    assert beside[0] > beside[1] + 40 and abs(beside[1] - beside[2]) < 40
    assert pixels[:, [0, -1]].min() > 200


def test_a_page_needs_nothing_of_what_the_server_needs(run_python, tmp_path):
    code = f"""
import sys
for name in ("tornado", "zmq", "IPython", "PIL", "pyngrok"):
    sys.modules[name] = None
import assembly as asm
asm.view.save_html({str(tmp_path / "ball.html")!r}, asm.Assembly([asm.Body("ball", asm.shapes.sphere(1.0))]))
"""
    run_python(code)
    assert (tmp_path / "ball.html").stat().st_size > 100_000
