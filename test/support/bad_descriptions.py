# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid robot descriptions, and the expected error message of each."""

from typing import NamedTuple

from robot_dynamics.planar.urdf import default_arm_urdf

ARM = default_arm_urdf()


class Bad(NamedTuple):
    """The text of a description, and a pattern of its error message."""

    xml: str
    words: str


def changed(old: str, new: str) -> str:
    """Return the default arm with the first occurrence of `old` replaced."""
    assert old in ARM
    return ARM.replace(old, new, 1)


def chain(joints: int, last_child: str = '') -> str:
    """Return a serial chain; its last joint may have another child link."""
    link = '<link name="l{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" ' \
        'iyy="1" iyz="0" izz="1"/></inertial></link>'
    joint = '<joint name="j{0}" type="continuous"><parent link="l{0}"/><child link="{1}"/></joint>'
    links = ''.join(link.format(i) for i in range(joints + 1))
    children = [*(f'l{i + 1}' for i in range(joints - 1)), last_child or f'l{joints}']
    return (f'<robot name="chain">{links}'
            f'{"".join(joint.format(i, child) for i, child in enumerate(children))}</robot>')


def bomb() -> str:
    """Return a few lines of XML whose entities expand to gigabytes."""
    entities = ''.join(
        f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))
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
    'truncated XML': Bad(ARM[:len(ARM) // 2], r'is not well-formed XML \('),
    'only white space': Bad(' \n ', 'robot_description is empty, expected the XML of a URDF'),
    'XML without a robot': Bad(
        '<sdf version="1.7"/>', 'has the root element <sdf>, expected <robot>'),
    'xacro that is not expanded': Bad(
        ARM.replace('<robot name', '<robot xmlns:xacro="http://wiki.ros.org/xacro" name').replace(
            '</robot>', '<xacro:arm/></robot>'), 'is a xacro file, it has <xacro:arm>'),
    'no links': Bad('<robot name="r"/>', r"robot 'r' has no links, expected at least two"),
    'no movable joint': Bad(
        ARM.replace('continuous', 'fixed'), 'has no joint that moves, expected at least one'),
    'two joints of the same name': Bad(
        ARM.replace('"joint2"', '"joint1"'), "two joints are named 'joint1'"),
    'an unknown parent link': Bad(
        changed('parent link="link1"', 'parent link="nowhere"'),
        r"joint 'joint2': parent link is 'nowhere', expected one of \['base_link'"),
    'a loop': Bad(
        ARM.replace('</robot>', '<joint name="closing" type="fixed"><parent link="base_link"/>'
                    '<child link="tool0"/></joint></robot>'),
        r"link 'tool0' is the child of two joints, 'tool0_joint' and 'closing'.*expected a tree"),
    'a ring without a root': Bad(
        chain(3, 'l0'), r"links \['l0', 'l1', 'l2'\] form a closed loop|all have no parent"),
    'a floating joint': Bad(
        changed('continuous', 'floating'),
        r"joint 'joint1' is of type 'floating': an arm needs a fixed base, expected one of"),
    'an axis of zero': Bad(
        changed('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), r"joint 'joint1': axis is zero"),
    'a negative effort limit': Bad(
        changed('effort="', 'effort="-'), r"joint 'joint1': effort=-\d+, expected >= 0 "),
    'a revolute joint without a range': Bad(
        changed('continuous', 'revolute'),
        r"joint 'joint1' is revolute with lower=0 and upper=0, expected a range .* or type fixed"),
    'a negative mass': Bad(
        changed('mass value="5.0"', 'mass value="-5.0"'),
        r"link 'link1': inertial: mass is -5, expected a number >= 0"),
    'an infinite mass': Bad(
        changed('mass value="5.0"', 'mass value="inf"'), r"link 'link1': inertial: mass is inf"),
    'a mass that is not a number': Bad(
        changed('mass value="5.0"', 'mass value="heavy"'),
        r"link 'link1': inertial: value='heavy', expected a number"),
    'NaN in an inertia': Bad(
        changed('ixx="0.1"', 'ixx="nan"'), r"link 'link1': inertial: ixx='nan', expected a num"),
    'an impossible inertia': Bad(
        changed('ixx="0.1"', 'ixx="-0.1"'), r"model check inertia: .*'link1'"),
    'joints that move no mass': Bad(
        MASSLESS, r"model check mass: joint 'joint2' moves 0 kg .*ignore_checks: \[mass\]"),
    'XML that expands to gigabytes (nested entities)': Bad(
        bomb(), r"has a document type declaration \(DTD\), '<!DOCTYPE .*expected a URDF without"),
    'a robot of 200 joints': Bad(
        chain(200), "robot 'chain' has 200 joints that move, expected at most 100"),
    'a robot of 10,000 links': Bad(
        chain(9999), "robot 'chain' has 10000 links, expected at most 500"),
    'a million tags': Bad(
        f'<robot name="r">{"<a/>" * 1_000_000}</robot>', 'has 1000002 tags, expected at most'),
}
