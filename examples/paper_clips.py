"""Three paper clips, linked and touching, and the pose that brings the last one to the hand.

Each clip is threaded through both others. The red one is held; the lower end of the blue one is drawn to the hand.
Prints the solution and writes paper_clips.html into the working directory: open it in any browser and turn it around.
"""

from __future__ import annotations

import assembly as asm


def paper_clips() -> asm.Assembly:
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)  # [mm]
    red = asm.Body("red", clip, fixed=True)
    green = asm.Body("green", clip, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    blue = asm.Body("blue", clip, position=(4.0, 3.0, -28.0), quaternion=(0.649, -0.063, -0.147, 0.744))
    chain = asm.Assembly([red, green, blue])
    chain.constrain(asm.Contact(red, green), asm.Contact(green, blue), asm.Contact(red, blue))
    chain.minimize(asm.PointDistance(blue.point(0, 0, -15), target=(12.0, 4.0, -40.0)))
    return chain


def main() -> asm.Solution:
    chain = paper_clips()
    solution = chain.solve()
    print(solution)
    asm.view.save_html("paper_clips.html", chain, solution)
    return solution


if __name__ == "__main__":
    main()
