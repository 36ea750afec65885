# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

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
