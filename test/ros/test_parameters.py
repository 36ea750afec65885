# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters through their services: descriptions, rejections, and effects."""

from collections.abc import Iterator
import re
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from robot_dynamics.control.scaled_laws import LAWS
from robot_dynamics.model.arm_parameters import (
    arm_from_parameters,
    FORMER_NAMES,
    read_parameter_file,
)
from robot_dynamics.model.effort_deviation import uncertain_names
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec, Type
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from robot_dynamics.tools.command_line import read_parameters
from ros_harness import DYNAMICS, EXACT, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
import yaml

NAN = float('nan')
NODE, ARM_NODE = '/parameters/dynamics', '/parameters/simulated_arm'
NAMES = ['joint1', 'joint2']
FORMER = {
    'joints': NAMES, 'effort_scale': 0.5, 'position_margin': 0.02, 'position_fault_margin': 0.01,
    'soften_gains': False, 'friction.load': [0.1], 'friction.effort_offset': [0.2, 0.3],
    'uncertainty.parameters': ['effort_offset(joint2)'], 'uncertainty.covariance': [0.04],
    'uncertainty.effort_noise': [0.5], 'uncertainty.noise_bandwidth': 10.0}
"""Parameters of an earlier version."""
SPECS = {NODE: DYNAMICS_SPECS, ARM_NODE: SIMULATED_ARM_SPECS}


@pytest.fixture(scope='module', autouse=True)
def nodes(client: RosClient) -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {'joints': NAMES}, namespace='/parameters'),
            NodeProcess(SIMULATED_ARM, namespace='/parameters',
                        remaps={'joint_states': 'arm_states', 'effort_command': 'arm_effort'})):
        yield


# --- former names ----------------------------------------------------------------------------

def test_parameters_by_their_former_names(client, tmp_path, capsys):
    file = tmp_path / 'former.yaml'
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': FORMER}}), encoding='utf-8')
    with pytest.warns(UserWarning, match="'effort_scale' is now 'effort_limit_fraction'"):
        expected = read_parameter_file(file)
    assert read_parameters(file) == expected
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(FORMER_NAMES)
    assert all(line.startswith('Warning: parameter file') for line in lines)
    assert FORMER_NAMES.keys() <= FORMER.keys()
    assert not FORMER_NAMES.keys() & expected.keys()
    arm = arm_from_parameters(default_arm_urdf(), expected)
    assert [uncertain_names(arm)[k] for k in arm.uncertainty.columns] == ['effort_bias(joint2)']
    node = '/former/dynamics'
    with NodeProcess(DYNAMICS, FORMER, namespace='/former') as process:
        for former, name in FORMER_NAMES.items():
            process.wait_for_log(f"parameter '{former}' is now '{name}'")
            value = client.get_parameter(node, name)
            assert (value if isinstance(value, (bool, float)) else list(value)) == expected[name]
        client.set_parameters(node, {'effort_scale': 0.25})
        assert client.get_parameter(node, 'effort_limit_fraction') == 0.25


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


def test_what_cannot_change_while_the_nodes_run(client):
    """The model, its joints, and the mode of time."""
    fixed = {spec.name for specs in SPECS.values() for spec in specs if spec.read_only}
    assert fixed >= {
        'robot_description', 'robot_description_file', 'joints', 'state_thread',
        'rate', 'lock_step', 'publish_clock', 'initial_position', 'initial_velocity', 'brakes',
        'seed', 'max_step'}
    for node, specs in SPECS.items():
        for spec in specs:
            if spec.read_only:
                value = Parameter(spec.name, spec.kind, another_value(spec))
                assert 'read-only' in client.rejection(node, spec.name, value)


def another_value(spec: ParameterSpec) -> Any:
    return {
        Type.STRING: 'x', Type.BOOL: not spec.default, Type.DOUBLE: 2.0, Type.INTEGER: 2,
        Type.DOUBLE_ARRAY: [1.0, 2.0, 3.0], Type.STRING_ARRAY: ['x']}[spec.kind]


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('position_noise', -1.0, 'position_noise.*-1'),
    ('position_noise', NAN, 'position_noise.*nan'),
    ('command_timeout', -0.1, 'command_timeout.*-0.1'),
    ('command_timeout', NAN, 'command_timeout.*nan'),
    ('velocity_noise', True, 'expected .*DOUBLE.* got .*BOOL'),
])
def test_a_bad_value_is_refused_with_a_reason_and_the_old_one_kept(client, name, value, words):
    """Of `simulated_arm`; test_faults_parameters tries every parameter of `dynamics`."""
    before = client.get_parameter(ARM_NODE, name)
    reason = client.rejection(ARM_NODE, name, value)
    assert re.search(words, reason), reason
    assert client.get_parameter(ARM_NODE, name) == before


# --- effects -------------------------------------------------------------------------------------

def test_changed_gains_change_the_computed_torque(client):
    q, error = np.array([0.8, 0.5]), np.array([0.05, -0.02])
    dynamics = default_dynamics()
    M, g = dynamics.rigid_body.mass_matrix(q), dynamics.rigid_body.gravity(q)
    states = client.publisher(JointState, '/parameters/joint_states', 1)
    trajectories = client.publisher(JointTrajectory, f'{NODE}/joint_trajectory')
    state = JointState(name=NAMES, position=q.tolist(), velocity=[0.0, 0.0])
    usual = client.get_parameter(NODE, 'state_timeout')
    client.set_parameters(NODE, {'state_timeout': 10.0})  # the test sends single states
    client.set_parameters(NODE, EXACT)  # also for later tests, which use only the arm
    with client.collect(JointState, f'{NODE}/computed_torque') as torques, \
            client.collect(JointState, f'{NODE}/gravity_compensation') as gravity:
        torques.wait_matched()
        gravity.wait_matched()
        state.header.stamp.sec = 1
        client.answer_to(states, state, gravity)  # required before a trajectory

        def torque() -> Any:
            state.header.stamp.nanosec += 10_000_000
            return client.answer_to(states, state, torques).effort

        trajectories.publish(JointTrajectory(joint_names=NAMES, points=[
            JointTrajectoryPoint(positions=(q + error).tolist())]))
        client.ask(states, state, torques, lambda m: m.effort != pytest.approx(g))
        assert torque() == pytest.approx(M @ (400.0 * error) + g)
        for values, kp in (
                ({'gains.natural_frequency': [10.0]}, np.array([100.0, 100.0])),
                ({'gains.natural_frequency': [10.0, 30.0]}, np.array([100.0, 900.0])),
                ({'gains.kp': [50.0, 70.0]}, np.array([50.0, 70.0])),
                ({'gains.kp': Parameter('gains.kp', Type.DOUBLE_ARRAY, [])},
                 np.array([100.0, 900.0])),
                ({'gains.natural_frequency': [20.0]}, np.array([400.0, 400.0]))):
            client.set_parameters(NODE, values)
            assert torque() == pytest.approx(M @ (kp * error) + g)
    client.set_parameters(NODE, {'state_timeout': usual})


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
    assert spec.choices == (*LAWS, 'none')
