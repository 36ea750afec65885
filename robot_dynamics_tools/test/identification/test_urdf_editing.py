# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Elements replaced in a URDF: nothing else changes, and the new model is the identified one."""

from robot_dynamics_tools.urdf_editing import with_elements

URDF = """<?xml version="1.0" encoding="latin-1"?>
<!-- before: <link name="a"/> -->
<robot name='x'>
  <link name="base"/><link name='a'>
    <inertial><mass value="1"/></inertial> <!-- kept -->
    <visual><geometry><sphere radius="1 > 0"/></geometry></visual>
  </link>
  <!-- <link name="a"><inertial/></link> -->
  <joint name="j" type="revolute"> <dynamics damping="1" spring="4"/> <axis xyz="0 0 1"/> </joint>
  <joint name="k" type="fixed"/>
</robot>"""


def test_only_what_is_named_changes():
    changed = with_elements(
        URDF, {'a': '<inertial>A</inertial>', 'base': '<inertial>B</inertial>'},
        {'k': {'damping': '3'}, 'j': {'damping': '2'}})
    assert changed == """<?xml version="1.0" encoding="UTF-8"?>
<!-- before: <link name="a"/> -->
<robot name="x">
  <link name="base">
    <inertial>B</inertial>
  </link><link name="a">
    <inertial>A</inertial>
     <!-- kept -->
    <visual><geometry><sphere radius="1 &gt; 0"/></geometry></visual>
  </link>
  <!-- <link name="a"><inertial/></link> -->
  <joint name="j" type="revolute"> <dynamics damping="2" spring="4"/> <axis xyz="0 0 1"/> </joint>
  <joint name="k" type="fixed">
    <dynamics damping="3"/>
  </joint>
</robot>
"""
    assert with_elements(changed, {}, {}) == changed
    assert with_elements('\ufeff' + changed.replace('UTF-8', 'utf-16'), {}, {}) == changed
