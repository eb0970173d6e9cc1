"""A cover is screwed onto a housing, and somebody drew one of its holes 1.2 mm beside the housing's.

The report says which parts cross, touch, or nearly touch, where, and whether that is proved. One screw goes through the
cover's material, the other one has 0.4 mm of play; a weight was left inside the handle, and between the cover and the
board there is a gap of 0.3 mm. Prints the report; writes interference_report.csv, and interference_report.html for a
browser: parts that cross are red.
"""

from __future__ import annotations

import assembly as asm

LEFT, RIGHT = -35.0, 35.0  # of the holes along the housing [mm]
WRONG = 1.2  # by which the cover's right hole is off
SCREW, HOLE = 4.0, 4.4  # radii


def drawn() -> list[asm.Body]:
    """The parts where they are to stand."""
    shapes = asm.shapes
    housing = shapes.plate(100, 60, 20, [(LEFT, 0, HOLE), (RIGHT, 0, HOLE)])
    cover = shapes.plate(100, 60, 6, [(LEFT, 0, HOLE), (RIGHT + WRONG, 0, HOLE)])
    screw = shapes.solid_cylinder(SCREW, 40)
    return [
        asm.Body("housing", housing, (0, 0, 0), fixed=True),
        asm.Body("cover", cover, (0, 0, 13)),
        asm.Body("left screw", screw, (LEFT, 0, 4)),
        asm.Body("right screw", screw, (RIGHT, 0, 4)),
        asm.Body("board", shapes.box(40, 40, 2), (0, 0, 17.3)),
        asm.Body("handle", shapes.torus(14, 4), (0, 0, 22.3)),
        asm.Body("weight", shapes.sphere(2), (14, 0, 22.3)),
    ]


def main() -> asm.Interference:
    scene = asm.Assembly(drawn())
    report = asm.interference(scene, margin=0.5)
    print(report)
    report.to_csv("interference_report.csv")
    style = asm.view.Style(legend=True, unit="mm")
    asm.view.save_html("interference_report.html", scene, interference=report, style=style)
    return report


if __name__ == "__main__":
    main()
