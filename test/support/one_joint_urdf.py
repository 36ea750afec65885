# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""URDF texts of a robot with one joint, and of a chain of mimic joints."""

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
INERTIAL = f'<inertial><mass value="1.5"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'
ENDS = '<parent link="base"/><child link="arm"/>'
JOINT = f'<joint name="turn" type="revolute">{ENDS}{LIMIT}</joint>'
LINKS = f'<link name="base"/><link name="arm">{INERTIAL}</link>'


def robot(body, attributes='name="bot"'):
    return f'<robot {attributes}>{body}</robot>'


def joint_of(inside, kind='revolute', limit=LIMIT):
    """Return a robot with one joint that contains these elements."""
    return robot(f'{LINKS}<joint name="turn" type="{kind}">{ENDS}{limit}{inside}</joint>')


def link_of(inside):
    return robot(f'<link name="base"/><link name="arm">{inside}</link>{JOINT}')


def mimics(*relations, kind='revolute'):
    """Return a robot with the joint `turn` and other joints, each with its mimic relation."""
    names = ('other', 'third', 'fourth')
    body, parent = LINKS + JOINT, 'arm'
    for name, relation in zip(names, relations):
        body += (
            f'<link name="{name}_link"/><joint name="{name}" type="{kind}">'
            f'<parent link="{parent}"/><child link="{name}_link"/>{LIMIT}{relation}</joint>')
        parent = f'{name}_link'
    return robot(body)
