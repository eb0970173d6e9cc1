"""Scenes as text: an assembly written to a JSON file, and read back to the last bit.

A file is one object, and every field must be there:

    format       "assembly-scene"
    version      5
    surfaces     [{name, degree [p, q], knots [U, V], control_points [n_u][n_v][3], weights [n_u][n_v]}]
    faces        [{surface, name, reversed, color [red, green, blue], outer (a loop), holes [loops]}]
    bodies       [{name, fixed, position [3], quaternion [w, x, y, z], color [red, green, blue], density,
                  picture, shape [faces]}]
    constraints  [{type, name, and the fields of the type}]
    objective    [{type, sign, and the fields of the type}]

Fields of a constraint by its type:

    contact         a {body, face}, b {body, face}, unilateral, edges, minimum
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
    point_on_line   point, frame, slide, limits, distance, distance_limits
    point_on_plane  point, frame, offset, x, x_limits, y, y_limits
    distance        point_a, point_b, value, limits
    angle           frame_a, frame_b, value, limits
    gear            a {joint, freedom}, b {joint, freedom}, ratio, offset
    rack_pinion     pinion {joint, freedom}, rack {joint, freedom}, radius, offset
    constant_velocity  frame_a, frame_b, axes, swing, swing_limits, azimuth, azimuth_limits
    linear          a {joint, freedom}, b {joint, freedom}, ratio, offset
    flush           face_a, face_b, axes, offset, x, x_limits, y, y_limits, angle, angle_limits
    coaxial         a, b, axes, angle, angle_limits, slide, slide_limits
    insert          hole, shank, seats, axes, offset, angle, limits
    concentric      a, b, swing, swing_limits, azimuth, azimuth_limits, twist, twist_limits
    width           slot, tab, axes, offset, x, x_limits, y, y_limits, angle, angle_limits
    tangent         a, b, side, unilateral, touch
    symmetric       a, b, plane
    group           bodies [names], poses [poses]
    trim_contact    contact, side, loop, keep, form
    contact_place   contact, side, target [u or null, v or null], weight
    clearance       bodies [names] or null for all, minimum, exclude [[name, name]], neglect, places or null
    expression      bodies [names], function [lines], unilateral, scale, weight

Fields of a term of the objective by its type:

    point_distance  weight, body, point [3], target [3]
    frame_distance  weight, frame, target {position [3], quaternion [w, x, y, z]}, length
    weight          weight, bodies [names], direction [3]
    dexterity       weight, tip, inputs, measure, task, length, direction, axes, ignoring [names], holding [names]
    contact_place   name, contact, side, target [u or null, v or null], weight
    posture         weight, reference [n][7] or null
    expression      name, bodies [names], function [lines], unilateral, scale, weight

A loop is {tolerance, curves [{name, degree, knots, control_points [n][2], weights [n]}]}, as `Loop` takes them. A
face's `surface` is an index into `surfaces`, and a body's `shape` are indices into `faces`, so that what many bodies
share is there once. A `picture` is {vertices [n][3], triangles [m][3], colors [n][3] or null}, or null. Names of
surfaces, faces and curves, and colors, are null where none were given, `outer` where the edge of the surface is meant;
the face of a contact's side is null where the nearest is to be found. A trim or a place refers to a contact of the same
file that stands before it; its `side` is "a" or "b", its `loop` "outer" or the index of a hole of that side's face, or
a loop of its own. Frames, and the points of joints, are {body, origin [3], axes [x, y, z]} in body coordinates, the
axes unit vectors at right angles. The `axes` of a joint are "aligned", "opposed" or "nearest". What a mate ties
(`seats`, `slot` and `tab`: two each) is {body, face}, {body, edge}, {body, vertex} or {body, point [3]}, or a frame:
faces by name, edges and vertices by their number in `body.edges` and `body.vertices`. A driven value is a number, or
null where the coordinate is free; limits are [lower, upper], null for a side without limit, or null without limits;
angles are in radians. A coupling refers to joints of the same file, which may stand after it. The `function` of an
expression is the text of `Expression.document()`. A sign is 1 (minimized) or -1 (maximized). Numbers are the shortest
decimals that give back the same doubles. A dexterity's tip is a frame, its inputs are [{joint, freedom}], its
direction numbers or null; its `axes` are letters of "xyz", of a pose two words, of linear and angular axes; what it
ignores and what is holding are constraints of the file.

Older versions are read, too. Version 4 had no places of contacts and no least gaps of contacts, and dexterities had no
`axes`, `ignoring` and `holding`; version 3 had no pictures, no distances from lines and no `touch`; version 2 had no
densities; version 1 had no faces, colors, loops, edges and trims either, and a `shape` was [{surface, name, reversed}].
"""

from __future__ import annotations

from assembly.scene_file.document import load, save

__all__ = ["load", "save"]
