# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid robot descriptions, and the expected error message of each."""

from typing import NamedTuple

from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf

ARM = default_arm_urdf()


class Bad(NamedTuple):
    """The text of a description, and a pattern of its error message."""

    xml: str
    words: str


def changed(old: str, new: str) -> str:
    """Return the default arm with the first occurrence of `old` replaced."""
    assert old in ARM
    return ARM.replace(old, new, 1)


def bomb() -> str:
    """Return a few lines of XML whose entities expand to gigabytes."""
    entities = ''.join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))
    return (f'<!DOCTYPE robot [<!ENTITY e0 "{"x" * 100}">{entities}]>'
            '<robot name="&e9;"><link name="base"/></robot>')


MASSLESS = """<robot name="r">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
    </inertial>
  </link>
  <link name="hand"/>
  <joint name="joint1" type="continuous"><parent link="base"/><child link="arm"/></joint>
  <joint name="joint2" type="continuous"><parent link="arm"/><child link="hand"/></joint>
</robot>"""

BAD_DESCRIPTIONS = {
    'text that is not XML': Bad(
        'joint1, joint2', r"is not well-formed XML .*it begins with 'joint1, joint2'"),
    'a loop': Bad(
        ARM.replace('</robot>', '<joint name="closing" type="fixed"><parent link="base_link"/>'
                    '<child link="tool0"/></joint></robot>'),
        r"link 'tool0' is the child of two joints, 'tool0_joint' and 'closing'.*expected a tree"),
    'a negative mass': Bad(
        changed('mass value="5.0"', 'mass value="-5.0"'),
        r"link 'link1': inertial: mass is -5, expected a number >= 0"),
    'an impossible inertia': Bad(
        changed('ixx="0.1"', 'ixx="-0.1"'), r"model check inertia: .*'link1'"),
    'joints that move no mass': Bad(
        MASSLESS, r"model check mass: joint 'joint2' moves 0 kg .*ignore_checks: \[mass\]"),
    'XML that expands to gigabytes (nested entities)': Bad(
        bomb(), r"has a document type declaration \(DTD\), '<!DOCTYPE .*expected a URDF without"),
    'a robot of 200 joints': Bad(
        planar_arm_urdf([1.0] * 200, [0.5] * 200, [0.2] * 200, [0.01] * 200),
        "robot 'planar_arm' has 200 joints that move, expected at most 100"),
    'a million tags': Bad(
        f'<robot name="r">{"<a/>" * 1_000_000}</robot>', 'has 1000002 tags, expected at most'),
}
