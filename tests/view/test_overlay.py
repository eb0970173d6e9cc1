"""Pictures that speak: names, legend, axes, a scale bar, what hides, and where nothing is said."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import assembly as asm
from assembly.view.commands import commands
from assembly.view.item import FIELD_OF_VIEW
from assembly.view.mesh import body_mesh
from assembly.view.overlay import legend_rows
from assembly.view.picture import draw
from assembly.view.said_in_window import axes_of, round_length, said_in_window

Style = asm.view.Style


def told(page):
    """What a page has to say."""
    (text,) = re.findall(r'id="said">(.*?)</script>', page.read_text(encoding="utf-8"))
    return json.loads(text)


def item(picture, *path):
    return next(i for i in picture.items if i.path == path)


def test_everything_has_a_name(balls, four_bar, tmp_path):
    asm.view.save_html(tmp_path / "a.html", balls, balls.solve(), style=Style(unit="</script> mm"))
    said = told(tmp_path / "a.html")
    things = {path.removeprefix("/assembly/"): thing for path, thing in said["things"].items()}
    assert things["bodies/red"] == {"said": "red, fixed", "kind": "bodies", "label": "red"}
    contact = things["contacts/red-green/point"]
    assert re.fullmatch(r"contact red-green, gap -?[\d.e-]+ </script> mm", contact["said"])
    assert contact["label"] == "red-green" and contact["hides"]
    assert "label" not in things["contacts/red-green/other point"]
    assert things["targets/target 1/target"]["said"] == "target 1, of a point of blue"
    assert said["unit"] == "</script> mm" and set(said["on"]) == {"axes", "scale"}
    joints = {i.path[1]: i.said for i in draw(four_bar, four_bar.solve()).items if i.kind == "joints"}
    assert set(joints) == {"crank", "cross", "ball", "rocker"}
    # Hinges have an angle, in degrees.
    assert re.fullmatch(r"crank: Revolute of ground and blue, angle -?\d+\.\d deg", joints["crank"])
    assert "label" in vars(item(draw(four_bar), "joints", "cross", "ball"))


def test_a_legend_has_the_colors(balls):
    rows = legend_rows(draw(balls, balls.solve()))
    assert [text for _, text, _ in rows] == ["red, fixed", "green", "blue", "contact", "target"]
    assert rows[2] == ("#296bd9", "blue", "body")
    crowd = asm.Assembly([asm.Body(str(k), position=(k, 0, 0)) for k in range(50)])
    assert ("", "and 10 more", "body") in legend_rows(draw(crowd))


def test_contacts_that_a_clearance_finds_have_one_name_a_pair():
    floor = asm.Body("floor", asm.shapes.box(4.0, 4.0, 1.0), fixed=True)
    box = asm.Body("box", asm.shapes.box(1.0, 1.0, 1.0), position=(0.0, 0.0, 1.0))
    scene = asm.Assembly([floor, box])
    scene.constrain(asm.Clearance())
    contacts = [i for i in draw(scene, scene.solve()).items if i.kind == "contacts"]
    assert len({i.path[1] for i in contacts}) > 1
    assert [i.label for i in contacts if i.label] == ["floor-box"]


# What the overlay shows, after the mouse was at places in the page and boxes were clicked.
LOOK = """
// Virtual time may pass without a frame, in which the viewer takes the size of its window.
viewer.set_3d_pane_size();
const canvas = viewer.renderer.domElement, part = id => document.getElementById(id), found = [];
const box = canvas.getBoundingClientRect();
const pixel = mesh => {
  const at = mesh.getWorldPosition(new MeshCat.THREE.Vector3()).project(viewer.camera);
  return [(at.x + 1) / 2 * box.width, (1 - at.y) / 2 * box.height];
};
const mesh = path => [...overlay.meshes.keys()].find(each => each.uuid === "/assembly/" + path);
const hover = (x, y) => {
  canvas.dispatchEvent(new PointerEvent("pointermove", {clientX: x, clientY: y}));
  overlay.draw();
  return part("hover").hidden ? "" : part("hover").textContent;
};
const click = name => { document.querySelector(`#choices input[name=${name}]`).click(); overlay.draw(); };
setTimeout(() => {
  overlay.draw();
  const [x, y] = pixel(mesh("bodies/green"));
  found.push(hover(x, y), hover(3, 3));
  const [u, v] = pixel(mesh("contacts/red-green/point"));
  found.push(hover(u, v));
  click("front");
  found.push(hover(u, v));
  const shown = () => overlay.labels.filter(each => !each.name.hidden).map(each => each.name.textContent);
  const before = shown();
  click("bodies");
  const name = overlay.labels.find(each => each.name.textContent === "green").name.getBoundingClientRect();
  found.push(before, shown(), Math.hypot(name.x + name.width / 2 - x, name.y + name.height / 2 - y));
  found.push(part("bar").clientWidth, part("bar").textContent, part("bar").firstChild.value, part("legend").hidden);
  click("legend");
  found.push(part("legend").hidden, [...part("legend").children].map(each => each.textContent));
  document.title = JSON.stringify(found);
}, 300);
"""


def test_a_browser_says_names_and_lengths(balls, browser, tmp_path):
    asm.view.save_html(tmp_path / "a.html", balls, balls.solve(), style=Style(unit="mm"))
    found = json.loads(browser.title_after(tmp_path / "a.html", LOOK))
    green, nothing, hidden, seen, before, after, off, wide, _, length, closed, opened, legend = found
    assert (green, nothing) == ("green", "")
    # Between two balls that touch one of them is in front of the point, until it is to be seen through.
    assert hidden in ("green", "red, fixed") or hidden.startswith("contact")
    assert seen.startswith("contact red-green, gap")
    assert before == [] and sorted(after) == ["blue", "green", "red"]
    # In the middle of its ball, to pixels.
    assert off < 2.0
    assert closed and opened is False
    assert legend == ["red, fixed", "green", "blue", "contact", "target"]
    # The bar is as long as it says where the middle of the scene is: the window is 500 pixels high.
    picture = draw(balls, balls.solve())
    pixels = 250.0 / np.tan(np.deg2rad(FIELD_OF_VIEW / 2.0)) / np.linalg.norm(picture.eye) * picture.scale
    value, unit = length.split()
    assert unit == "mm" and wide == pytest.approx(float(value) * pixels, abs=1.5)
    assert 30.0 < wide <= 111.0


def test_styles_of_bodies(balls):
    picture = draw(balls, style=Style(opacity={"green": 0.25}, edges=False))
    assert [item(picture, "bodies", name).opacity for name in ("red", "green", "blue")] == [1.0, 0.25, 1.0]
    assert {item(draw(balls, style=Style(opacity=0.5)), "bodies", n).opacity for n in ("red", "blue")} == {0.5}
    box = asm.Assembly([asm.Body("box", asm.shapes.box(1.0, 1.0, 1.0))])
    assert draw(box).items[0].lines is not None and draw(box, style=Style(edges=False)).items[0].lines is None
    coarse, fine = (len(draw(balls, style=Style(angle=a)).items[0].mesh.vertices) for a in (30.0, 3.0))
    assert coarse < 200 < 5000 < fine
    solution = balls.solve()
    assert not [i for i in draw(balls, solution, style=Style(glyphs="none")).items if i.kind == "contacts"]
    front = draw(balls, solution, style=Style(glyphs="in front"))
    assert all(i.in_front == (i.kind == "contacts") for i in front.items)


def test_a_far_target_leaves_the_parts_as_large(balls):
    near = draw(balls)
    wish = balls.objectives[0][1]
    wish.target = (5.0, 0.0, 400.0)
    far = draw(balls)
    wish.target = (5.0, 0.0, 4000.0)
    farther = draw(balls)
    # It makes room for 1.5 radii of the parts, however far it is; and it is drawn where it is.
    assert near.scale > far.scale == pytest.approx(farther.scale, rel=0.02)
    assert far.scale > 0.5 * near.scale
    ratio = item(farther, "targets", "target 1", "target").position[2] / far.scale
    assert ratio == pytest.approx(4000.0, rel=1e-2)


def test_teeth_have_edges():
    teeth = asm.curves.polygon([(0, 0), (4, 0), (4, 2), (2, 1), (0, 2)])
    body = asm.Body("part", asm.shapes.extrusion(teeth, 3.0))
    lines = draw(asm.Assembly([body])).items[0].lines
    ends = lines.points[lines.segments]
    upright = np.abs(ends[:, 0] - ends[:, 1])[:, 2] > 2.0
    # The wall is one surface, with an edge at each of its five corners.
    assert upright.sum() == 5


def test_a_dome_among_many_faces_is_round():
    pins = {
        f"pin {k}": [face.transformed(np.eye(3), (9.0 * np.cos(k), 9.0 * np.sin(k), 0.0)) for face in pin]
        for k, pin in enumerate([asm.shapes.solid_cylinder(0.5, 2.0)] * 12)
    }
    body = asm.Body("part", asm.shapes.joined(dome=asm.shapes.sphere(5.0), **pins))
    mesh, alone = body_mesh(body), body_mesh(asm.Body("dome", asm.shapes.sphere(5.0)))
    radius = np.linalg.norm(mesh.vertices, axis=1)
    # As many vertices as a ball alone has.
    assert (np.abs(radius - 5.0) < 1e-9).sum() == len(alone.vertices) > 1000


def test_a_window_has_names_and_a_length(balls):
    picture = draw(balls, style=Style(labels=["bodies"], unit="mm"))
    found = list(said_in_window(picture))
    texts = {c["path"]: c["object"]["textures"][0]["text"] for c in found if "textures" in c.get("object", {})}
    assert texts["/assembly/bodies/green/name"] == "green"
    arms, length = axes_of(picture)
    assert texts["/assembly/axes/x/name"] == f"x  {length:g} mm" and texts["/assembly/axes/z/name"] == "z"
    # Along their axes, as long as is said.
    for arm, way in zip(arms, np.eye(3), strict=True):
        along = (arm.points - arm.position) @ way
        assert along.max() / picture.scale == pytest.approx(length, rel=1e-12)
    # A name hangs below its body, whose scale it takes back.
    (matrix,) = [c["matrix"] for c in found if c["path"] == "/assembly/bodies/green/name" and "matrix" in c]
    scale = item(picture, "bodies", "green").scale
    assert np.reshape(matrix, (4, 4))[0, 0] * scale[0] == pytest.approx(0.16, rel=1e-12)
    bare = draw(balls, style=Style(axes=False, scale_bar=False))
    assert list(said_in_window(bare)) == [] and len(list(commands(bare))) > 0
    assert [round_length(x) for x in (0.99, 1.0, 3.7, 80.0)] == [0.5, 1.0, 2.0, 50.0]


def test_driven_values_are_said(browser, tmp_path):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    hinge = asm.Revolute(ground.frame(), arm.frame((1.0, 0.0, 0.0)), name="hinge", angle=0.0)
    scene.constrain(hinge)
    solutions = []
    for angle in np.linspace(0.0, 1.0, 5):
        hinge.angle = float(angle)
        solutions.append(scene.solve())
    asm.view.animate(scene, iter(solutions), tmp_path / "a.html")
    script = "setTimeout(() => { animator.update(); follow(); document.title = part.frame.value; }, 300);"
    assert browser.title_after(tmp_path / "a.html", script, "#frame=2") == "hinge.angle 28.6 deg"
    hinge.angle = None
    asm.view.animate(scene, solutions, tmp_path / "a.html", seconds=8.0)
    assert browser.title_after(tmp_path / "a.html", script, "#frame=2") == "4.00 of 8.00 s"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"labels": "bodies"}, "labels is 'bodies'; expected True, False or a list of some of 'bodies'"),
        ({"labels": [np.ones(2)]}, r"labels has array\(\[1., 1.\]\)"),
        ({"labels": ["names"]}, "labels has 'names'; expected some of 'bodies', 'joints', 'contacts', 'targets'"),
        ({"glyphs": np.array(["none", "none"])}, "glyphs is array"),
        ({"glyphs": "behind"}, "glyphs is 'behind'; expected one of 'occluded', 'in front', 'none'"),
        ({"opacity": 1.5}, "opacity is 1.5; expected a number from 0 to 1"),
        ({"opacity": {"red": np.nan}}, r"opacity\['red'\] is nan"),
        ({"angle": 0.0}, "angle is 0; expected 0.5 to 45 degrees"),
        ({"legend": 1}, "legend is 1; expected True or False"),
        ({"unit": 3}, "unit is 3; expected a string"),
        ({"unit": "\ud800"}, "unit is "),
    ],
)
def test_options_are_checked(options, message):
    with pytest.raises((TypeError, asm.errors.InputError), match=message):
        Style(**options)


def test_styles_are_of_the_scene(balls, tmp_path):
    with pytest.raises(asm.errors.InputError, match="opacity has 'gray'; expected one of 'red', 'green', 'blue'"):
        asm.view.save_html(tmp_path / "a.html", balls, style=Style(opacity={"gray": 0.5}))
    with pytest.raises(TypeError, match="style is 'plain'; expected an assembly.view.Style"):
        asm.view.save_html(tmp_path / "a.html", balls, style="plain")
    assert not any(tmp_path.iterdir())
