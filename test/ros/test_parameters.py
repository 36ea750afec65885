# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters through their services: descriptions, rejections, and effects."""

from collections.abc import Iterator
import re

import numpy as np
import pytest
from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.parameters.declared_parameters import Type
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState

NODE, ARM_NODE = '/parameters/dynamics', '/parameters/simulated_arm'
NAMES = ['joint1', 'joint2']
SPECS = {NODE: DYNAMICS_SPECS, ARM_NODE: SIMULATED_ARM_SPECS}
STATED = {
    NODE: {
        'state_timeout': (0.05, 0.001, 60.0), 'state_max_age': (0.2, 0.0, 60.0),
        'reference_timeout': (0.1, 0.001, 60.0), 'hold_time': (1.0, 0.0, 3600.0),
        'ramp_time': (0.5, 0.0, 60.0), 'effort_limit_fraction': (1.0, 0.0, 1.0),
        'cartesian.translation_stiffness': ([500.0], 0.0, 1e9),
        'cartesian.rotation_stiffness': (30.0, 0.0, 1e9),
        'cartesian.force_limit': (100.0, 0.0, 1e4), 'cartesian.torque_limit': (30.0, 0.0, 1e4),
        'external_effort_bandwidth': (10.0, 0.01, 1000.0)},
    ARM_NODE: {
        'rate': (500.0, 1.0, 10_000.0), 'command_timeout': (0.2, 0.0, 3600.0),
        'max_step': (0.002, 1e-6, 0.1)}}
"""Default, smallest and largest value of parameters of safety and of motion."""


@pytest.fixture(scope='module', autouse=True)
def nodes(client: RosClient) -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {'joints': NAMES}, namespace='/parameters'),
            NodeProcess(SIMULATED_ARM, namespace='/parameters',
                        remaps={'joint_states': 'arm_states', 'effort_command': 'arm_effort'})):
        yield


# --- descriptions --------------------------------------------------------------------------------

@pytest.mark.parametrize('node', [NODE, ARM_NODE])
def test_every_parameter_is_declared_with_type_range_and_description(client, node):
    descriptors = client.describe_parameters(node, [spec.name for spec in SPECS[node]])
    assert list(descriptors) == [spec.name for spec in SPECS[node]]
    for spec in SPECS[node]:
        descriptor = descriptors[spec.name]
        assert descriptor.type == spec.kind.value
        assert len(descriptor.description) > 10
        assert descriptor.read_only == spec.read_only
        assert not descriptor.dynamic_typing
        if spec.kind is Type.DOUBLE:
            bounds, = descriptor.floating_point_range
            assert (bounds.from_value, bounds.to_value) == (spec.minimum, spec.maximum)
        if spec.kind is Type.INTEGER:
            whole, = descriptor.integer_range
            assert (whole.from_value, whole.to_value) == (spec.minimum, spec.maximum)
        if spec.kind is Type.DOUBLE_ARRAY:
            assert 'each in [' in descriptor.additional_constraints
        for choice in spec.choices:
            assert choice in descriptor.additional_constraints


@pytest.mark.parametrize('node', [NODE, ARM_NODE])
def test_unset_parameters_have_their_defaults(client, node):
    for spec in SPECS[node]:
        given = NAMES if (node, spec.name) == (NODE, 'joints') else spec.default
        value = client.get_parameter(node, spec.name)
        assert value == given or list(value) == list(given), spec.name


@pytest.mark.parametrize('node', [NODE, ARM_NODE])
def test_defaults_and_ranges_of_safety_and_motion(node):
    specs = {spec.name: (spec.default, spec.minimum, spec.maximum) for spec in SPECS[node]}
    assert {name: specs[name] for name in STATED[node]} == STATED[node]


def test_what_cannot_change_while_the_nodes_run(client):
    """The model, its joints, and the mode of time; test_faults_parameters.py tries the rest."""
    for node, values in (
            (NODE, {'robot_description': 'x', 'robot_description_file': 'x', 'joints': ['x']}),
            (ARM_NODE, {'rate': 2.0, 'lock_step': True, 'publish_clock': True,
                        'initial_position': [1.0, 2.0], 'initial_velocity': [1.0, 2.0],
                        'brakes': True, 'seed': 2, 'max_step': 2.0})):
        for name, value in values.items():
            assert 'read-only' in client.rejection(node, name, value)


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('position_noise', float('nan'), 'position_noise.*nan'),
    ('command_timeout', -0.1, 'command_timeout.*-0.1'),
    ('velocity_noise', True, 'expected .*DOUBLE.* got .*BOOL'),
])
def test_a_bad_value_is_refused_with_a_reason_and_the_old_one_kept(client, name, value, words):
    """Of `simulated_arm`; test_faults_parameters tries every parameter of `dynamics`."""
    before = client.get_parameter(ARM_NODE, name)
    reason = client.rejection(ARM_NODE, name, value)
    assert re.search(words, reason), reason
    assert client.get_parameter(ARM_NODE, name) == before


# --- effects -------------------------------------------------------------------------------------

def test_changed_noise_acts(client):
    with client.collect(JointState, '/parameters/arm_states') as states:
        states.wait_count(20)
        assert {tuple(m.position) for m in states.messages} == {(0.0, 0.0)}
        client.set_parameters(ARM_NODE, {'position_noise': 1e-3})
        states.wait_for(lambda m: 0.0 < abs(m.position[0]) < 1e-2)
        states.clear()
        noisy = np.array([m.position for m in states.wait_count(400)])
        assert np.std(noisy, axis=0) == pytest.approx([1e-3, 1e-3], rel=0.3)
        client.set_parameters(ARM_NODE, {'position_noise': 0.0})


def test_the_commands_are_the_control_laws_and_none():
    spec, = (spec for spec in DYNAMICS_SPECS if spec.name == 'command')
    assert sorted(spec.choices) == [
        'cartesian_impedance', 'computed_torque', 'gravity_compensation', 'hand_guiding',
        'joint_impedance', 'none']
