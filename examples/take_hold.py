"""Two paper clips to take hold of: drag the green one with the mouse, and it slides along the red one, which is fixed.

Serves a page until Ctrl-C. A click on a clip shows axes and rings by which it is moved and turned; the clips keep
touching, and nothing crosses.
"""

from __future__ import annotations

import assembly as asm


def two_clips() -> asm.Assembly:
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)  # [mm]
    red = asm.Body("red", clip, fixed=True)
    green = asm.Body("green", clip, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    scene = asm.Assembly([red, green])
    scene.constrain(asm.Contact(red, green), asm.Clearance())
    return scene


def main() -> None:
    with asm.view.live(two_clips()) as page:
        print(f"open {page.url} in a browser; Ctrl-C ends it")
        try:
            page.wait()
        except KeyboardInterrupt:
            print("the green clip is at", page.q[1])


if __name__ == "__main__":
    main()
