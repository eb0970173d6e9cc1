"""Robots as texts, and their forward kinematics by plain products of matrices."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

ARM = """<robot name="arm">
  <link name="base">
    <inertial><origin xyz="0 0 0.1" rpy="0.3 0 0"/><mass value="5"/>
      <inertia ixx="1" ixy="0.1" ixz="0" iyy="2" iyz="0" izz="2.5"/></inertial>
    <collision><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.1" length="0.1"/></geometry></collision>
  </link>
  <link name="upper">
    <collision><origin xyz="0.25 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.04" length="0.5"/></geometry></collision>
    <collision><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="fore"/>
  <link name="finger">
    <collision name="pad"><origin xyz="0 0 0.01" rpy="0.1 0.2 0.3"/>
      <geometry><box size="0.02 0.03 0.1"/></geometry></collision>
  </link>
  <link name="thumb"/>
  <link name="nail"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0.2"/>
    <limit lower="-2" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.5 0 0" rpy="0 0 -1"/><axis xyz="0 0 -1"/></joint>
  <joint name="grip" type="prismatic"><parent link="fore"/><child link="finger"/>
    <origin xyz="0.3 0 0" rpy="0.4 -0.7 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="roll" type="revolute"><parent link="fore"/><child link="thumb"/>
    <origin xyz="0.3 0.1 0"/><limit lower="-9" upper="9" effort="1" velocity="1"/>
    <mimic joint="elbow" multiplier="-0.5" offset="0.1"/></joint>
  <joint name="glue" type="fixed"><parent link="thumb"/><child link="nail"/><origin xyz="0 0 0.02" rpy="1 2 3"/></joint>
</robot>
"""


def numbers(text):
    return np.array([float(word) for word in text.split()])


def origin(element):
    place = np.eye(4)
    found = element.find("origin")
    if found is not None:
        place[:3, 3] = numbers(found.get("xyz", "0 0 0"))
        place[:3, :3] = Rotation.from_euler("xyz", numbers(found.get("rpy", "0 0 0"))).as_matrix()
    return place


def forward_kinematics(text, values):
    """Matrices (4, 4) of links in meters, by the values of joints."""
    root = ElementTree.fromstring(text)
    joints = root.findall("joint")
    places = {root.find("link").get("name"): np.eye(4)}
    for _ in joints:
        for joint in joints:
            parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
            if parent not in places or child in places:
                continue
            axis = joint.find("axis")
            along = np.array([1.0, 0.0, 0.0]) if axis is None else numbers(axis.get("xyz"))
            along /= np.linalg.norm(along)
            value, moved = values.get(joint.get("name"), 0.0), np.eye(4)
            if joint.get("type") in ("revolute", "continuous"):
                moved[:3, :3] = Rotation.from_rotvec(value * along).as_matrix()
            elif joint.get("type") == "prismatic":
                moved[:3, 3] = value * along
            places[child] = places[parent] @ origin(joint) @ moved
    return places
