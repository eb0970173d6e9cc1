"""What a page says over its picture: names under the mouse and beside things, a legend, axes, a scale bar.

The page gets a script of its own and, as JSON, what there is to say; the script finds the meshes of meshcat's viewer by
their paths. Boxes in the corner turn names, legend, axes and what is in front on and off.
"""

from __future__ import annotations

from json import dumps
from typing import Any

from assembly.view.commands import path_of
from assembly.view.item import Color, Item, Picture
from assembly.view.picture import PENETRATING, TOUCHING
from assembly.view.skeleton import COLOR

__all__ = ["legend_rows", "overlay"]

# Rows of a legend; a longer one says how many are missing.
_LISTED = 40

_OVERLAY = """<div id="overlay">
<style>
#overlay { position: fixed; inset: 0; pointer-events: none; overflow: hidden; font: 13px sans-serif; color: #23262d; }
#overlay > * { position: absolute; }
#overlay .name, #hover { white-space: nowrap; }
#overlay .name { padding: 0 3px; border-radius: 4px; background: rgba(255, 255, 255, 0.65); }
#hover, #legend { padding: 4px 8px; border-radius: 6px; background: rgba(255, 255, 255, 0.88);
  box-shadow: 0 1px 4px rgba(0, 0, 0, 0.25); }
#legend { right: 12px; top: 34px; max-height: calc(100vh - 140px); overflow: auto; pointer-events: auto; }
#legend i { display: inline-block; width: 10px; height: 10px; margin-right: 7px; border-radius: 2px; }
#legend i.glyph { border-radius: 5px; }
#choices { left: 12px; top: 8px; right: 260px; display: flex; flex-wrap: wrap; gap: 2px 10px; font-size: 12px; }
#choices label { pointer-events: auto; opacity: 0.75; white-space: nowrap; }
#choices input { margin: 0 3px 0 0; vertical-align: -2px; accent-color: #333; }
#axes { left: 10px; bottom: 44px; overflow: visible; }
#axes line { stroke: #23262d; stroke-width: 1.5; }
#axes text { font: 12px sans-serif; fill: #23262d; text-anchor: middle; dominant-baseline: central; }
#bar { left: 16px; bottom: 12px; border: solid #23262d; border-width: 0 1.5px 1.5px; height: 5px; }
#bar output { position: absolute; left: 0; bottom: 7px; white-space: nowrap; }
#overlay.above-player > #axes { bottom: 112px; }
#overlay.above-player > #bar { bottom: 80px; }
[hidden] { display: none !important; }
</style>
<svg id="axes" width="64" height="64"></svg>
<div id="bar" title="at the depth of the middle of the picture"><output></output></div>
<div id="legend"></div>
<div id="choices"></div>
<div id="hover" hidden></div>
</div>
<script type="application/json" id="said">@SAID@</script>
<script type="text/plain" class="with-viewer">
const overlay = (() => {
const said = JSON.parse(document.getElementById("said").textContent), {THREE} = MeshCat;
const part = id => document.getElementById(id), canvas = viewer.renderer.domElement;
const meshes = new Map();
viewer.scene.traverse(each => { if (each.uuid in said.things) meshes.set(each, said.things[each.uuid]); });
const on = new Set(said.on), labels = [];
part("overlay").className = part("player") ? "above-player" : "";
for (const [mesh, thing] of meshes) if (thing.label) {
  const name = document.createElement("div");
  name.className = "name";
  name.textContent = thing.label;
  part("overlay").prepend(name);
  labels.push({mesh, name, kind: thing.kind});
}
for (const [color, text, kind] of said.legend) {
  const row = document.createElement("div"), sign = document.createElement("i");
  sign.style.background = color;
  sign.className = kind;
  row.append(...(color ? [sign] : []), text);
  part("legend").append(row);
}
const seen = each => { for (; each; each = each.parent) if (!each.visible) return false; return true; };
// Which boxes there are: a word, what it turns on, and where there is nothing to turn on, none.
const kinds = new Set([...meshes.values()].map(thing => thing.kind));
const hiding = [...meshes.values()].some(thing => thing.hides);
const boxes = [["names", ["bodies"]], ["joints' names", ["joints"]], ["contacts' names", ["contacts"]],
  ["targets' names", ["targets"]], ["legend", ["legend"]], ["axes", ["axes"]], ["scale", ["scale"]],
  ["see through", ["front"]]];
for (const [word, parts] of boxes) {
  if (["bodies", "joints", "contacts", "targets"].includes(parts[0]) && !kinds.has(parts[0])) continue;
  if (parts[0] === "front" && !hiding) continue;
  const label = document.createElement("label"), box = document.createElement("input");
  box.type = "checkbox";
  box.name = parts[0];
  box.checked = parts.every(each => on.has(each));
  box.onchange = () => { parts.forEach(each => box.checked ? on.add(each) : on.delete(each)); choose(); };
  label.append(box, word);
  part("choices").append(label);
}
function choose() {
  part("legend").hidden = !on.has("legend");
  part("axes").toggleAttribute("hidden", !on.has("axes"));
  part("bar").hidden = !on.has("scale");
  for (const [mesh, thing] of meshes) if (thing.hides) {
    const {material} = mesh;
    // Transparent things are drawn last.
    const front = on.has("front");
    Object.assign(material, front ? {transparent: true, opacity: 0.85} : {transparent: false, opacity: 1});
    material.depthTest = !front;
    material.needsUpdate = true;
  }
  viewer.set_dirty();
  last = "";
}
const point = new THREE.Vector3(), way = new THREE.Vector3(), ray = new THREE.Raycaster();
let mouse = null, last = "";
canvas.addEventListener("pointermove", event => { mouse = event; last = ""; });
canvas.addEventListener("pointerleave", () => { mouse = null; last = ""; });
function hover(box) {
  let found = null;
  // A pressed button turns the picture.
  if (mouse && !mouse.buttons) {
    const at = new THREE.Vector2((mouse.clientX - box.left) / box.width * 2 - 1,
      1 - (mouse.clientY - box.top) / box.height * 2);
    ray.setFromCamera(at, viewer.camera);
    const shown = [...meshes.keys()].filter(
      mesh => seen(mesh) && mesh.material.opacity > 0 && Math.abs(mesh.matrixWorld.determinant()) > 0);
    const hits = ray.intersectObjects(shown, false);
    found = hits.find(hit => !hit.object.material.depthTest) ?? hits[0];
  }
  part("hover").hidden = !found;
  if (!found) return;
  part("hover").textContent = meshes.get(found.object).said;
  const width = part("hover").offsetWidth;
  part("hover").style.left = `${Math.min(mouse.clientX + 14, box.width - width - 8)}px`;
  part("hover").style.top = `${mouse.clientY + 16}px`;
}
function names(box) {
  const placed = [], asked = [];
  for (const each of labels) {
    each.mesh.getWorldPosition(point).project(viewer.camera);
    const shown = on.has(each.kind) && point.z < 1 && seen(each.mesh) &&
      Math.abs(each.mesh.matrixWorld.determinant()) > 0;
    each.name.hidden = !shown;
    if (shown) asked.push({each, x: (point.x + 1) / 2 * box.width, y: (1 - point.y) / 2 * box.height});
  }
  // Names that would lie on each other stand below each other.
  for (const {each, x, y} of asked.sort((a, b) => a.y - b.y)) {
    const width = each.name.offsetWidth, height = each.name.offsetHeight;
    const left = x - (each.kind === "bodies" ? width / 2 : -8);
    let top = y - (each.kind === "bodies" ? height / 2 : height);
    for (const other of placed)
      if (left < other.right && other.left < left + width && top < other.bottom && other.top < top + height)
        top = other.bottom;
    placed.push({left, right: left + width, top, bottom: top + height});
    each.name.style.left = `${left}px`;
    each.name.style.top = `${top}px`;
  }
}
function axes() {
  const lines = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis, k) => {
    // The viewer's own axes have y upward.
    way.set(...axis).transformDirection(viewer.scene.matrixWorld)
      .transformDirection(viewer.camera.matrixWorldInverse);
    const x = 32 + 24 * way.x, y = 32 - 24 * way.y;
    return `<line x1="32" y1="32" x2="${x}" y2="${y}"/>` +
      `<text x="${32 + 33 * way.x}" y="${32 - 33 * way.y}">${"xyz"[k]}</text>`;
  });
  part("axes").innerHTML = lines.join("");
}
function bar(box) {
  const depth = viewer.camera.position.distanceTo(viewer.controls.target);
  const pixels = said.scale * viewer.camera.zoom * box.height / 2 /
    Math.tan(viewer.camera.fov * Math.PI / 360) / depth;
  let size = 10 ** Math.floor(Math.log10(110 / pixels));
  size *= [5, 2, 1].find(times => times * size * pixels <= 110);
  part("bar").style.width = `${size * pixels}px`;
  const text = size >= 1e-3 && size < 1e5 ? String(Number(size.toPrecision(3))) : size.toExponential(0);
  part("bar").firstChild.value = said.unit ? `${text} ${said.unit}` : text;
}
function draw() {
  requestAnimationFrame(draw);
  const box = canvas.getBoundingClientRect();
  const now = [...viewer.camera.matrixWorld.elements, viewer.camera.zoom, viewer.animator.time, box.width, box.height,
    ...labels.map(each => seen(each.mesh))].join();
  if (now === last) return;
  last = now;
  viewer.scene.updateMatrixWorld();
  names(box);
  axes();
  bar(box);
  hover(box);
}
choose();
draw();
return {meshes, labels, on, draw};
})();
</script>
"""


def _hex(color: Color) -> str:
    return "#" + "".join(f"{round(255.0 * part):02x}" for part in color)


def legend_rows(picture: Picture) -> list[tuple[str, str, str]]:
    """Color, text and sign of what the colors of a picture mean: bodies, then glyphs."""
    bodies = [item for item in picture.items if item.kind == "bodies"]
    rows = [(_hex(item.color), item.said, "body") for item in bodies[:_LISTED]]
    if len(bodies) > _LISTED:
        rows.append(("", f"and {len(bodies) - _LISTED} more", "body"))
    there = {(item.kind, item.color) for item in picture.items}
    glyphs = (
        (("joints", COLOR), "joint"),
        (("contacts", TOUCHING), "contact"),
        (("contacts", PENETRATING), "contact, surfaces interpenetrate"),
    )
    rows += [(_hex(key[1]), text, "glyph") for key, text in glyphs if key in there]
    # Targets and ellipsoids of one color are one row; those that are called something else are that.
    others = [item for item in picture.items if item.kind in ("targets", "ellipsoids") and item.said]
    kinds = {"targets": "target", "ellipsoids": "ellipsoid"}
    words = [kinds[item.kind] if item.kind == "targets" or item.said == item.path[1] else item.said for item in others]
    marks = dict.fromkeys((item.color, word) for item, word in zip(others, words, strict=True))
    rows += [(_hex(color), word, "glyph") for color, word in marks]
    places = {
        item.color: item.said.rpartition(": ")[2] for item in picture.items if item.kind == "places" and item.said
    }
    return rows + [(_hex(color), text, "glyph") for color, text in places.items()]


def _told(item: Item) -> dict[str, Any]:
    told: dict[str, Any] = {"said": item.said, "kind": item.kind}
    if item.label:
        told["label"] = item.label
    if item.hides:
        told["hides"] = True
    return told


def overlay(picture: Picture) -> str:
    """Markup and script that say what a picture shows."""
    style = picture.style
    on = list(style.labels_asked)
    asked = {"legend": style.legend, "axes": style.axes, "scale": style.scale_bar, "front": style.glyphs == "in front"}
    on += [name for name, is_on in asked.items() if is_on]
    told = {
        "things": {path_of(item): _told(item) for item in picture.items if item.said},
        "legend": legend_rows(picture),
        "scale": picture.scale,
        "unit": style.unit,
        "on": on,
    }
    # "</script>" in a name would end the page's script.
    return _OVERLAY.replace("@SAID@", dumps(told, allow_nan=False).replace("<", "\\u003c"))
