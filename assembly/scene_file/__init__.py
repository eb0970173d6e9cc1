"""Scenes as text: an assembly written to a JSON file, and read back to the last bit.

A file is one object, and every field must be there:

    format       "assembly-scene"
    version      1
    surfaces     [{name, degree [p, q], knots [U, V], control_points [n_u][n_v][3], weights [n_u][n_v]}]
    bodies       [{name, fixed, position [3], quaternion [w, x, y, z], shape [{surface, name, reversed}]}]
    constraints  [{type, name, and the fields of the type}]
    objective    [{type, sign, and the fields of the type}]

Fields of a constraint by its type:

    contact         a {body, face}, b {body, face}, unilateral
    fixed           frame_a, frame_b, axes
    revolute        frame_a, frame_b, axes, angle, limits
    prismatic       frame_a, frame_b, axes, slide, limits
    cylindrical     frame_a, frame_b, axes, angle, angle_limits, slide, slide_limits
    screw           frame_a, frame_b, pitch, axes, angle, angle_limits, slide, slide_limits
    planar          frame_a, frame_b, axes, offset, x, x_limits, y, y_limits, angle, angle_limits
    spherical       frame_a, frame_b, swing, swing_limits, azimuth, azimuth_limits, twist, twist_limits
    universal       frame_a, frame_b, angle_a, angle_a_limits, angle_b, angle_b_limits
    parallel        frame_a, frame_b, axes, angle, limits
    perpendicular   frame_a, frame_b
    point_on_line   point, frame, slide, limits
    point_on_plane  point, frame, offset, x, x_limits, y, y_limits
    distance        point_a, point_b, value, limits
    angle           frame_a, frame_b, value, limits
    gear            a {joint, freedom}, b {joint, freedom}, ratio, offset
    rack_pinion     pinion {joint, freedom}, rack {joint, freedom}, radius, offset
    expression      bodies [names], function [lines], unilateral, scale, weight

Fields of a term of the objective by its type:

    point_distance  weight, body, point [3], target [3]
    frame_distance  weight, frame, target {position [3], quaternion [w, x, y, z]}, length
    dexterity       weight, tip (a frame), inputs [{joint, freedom}], measure, task, length, direction [3 or 6] or null
    posture         weight, reference [n][7] or null
    expression      name, bodies [names], function [lines], unilateral, scale, weight

A face's `surface` is an index into `surfaces`, so that a surface many bodies share is there once. The name of a
surface is null where none was given; the face of a contact's side is null where the nearest is to be found. Frames,
and the points of joints, are {body, origin [3], axes [x, y, z]} in body coordinates, the axes unit vectors at right
angles. The `axes` of a joint are "aligned" or "opposed". A driven value is a number, or null where the freedom is
free; limits are [lower, upper], null for a side without limit, or null without limits; angles are in radians. A
coupling refers to joints of the same file, which may stand after it. The `function` of an expression is the text of
`Expression.document()`. A sign is 1 (minimized) or -1 (maximized). Numbers are the shortest decimals that give back
the same doubles.
"""

from __future__ import annotations

from assembly.scene_file.document import load, save

__all__ = ["load", "save"]
