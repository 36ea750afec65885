# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics connect` holds a simulated arm, and moves each joint a little."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
import signal
import subprocess
import time

import children
from children import TIMEOUT
import numpy as np
import pytest
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.commands.connect import main
from ros_harness import (
    BEST_EFFORT,
    NodeProcess,
    RosClient,
    SIMULATED_ARM,
    UNHURRIED,
    write_parameters,
)
from sensor_msgs.msg import JointState
from verb_bench import finish, PROGRAM

START = [0.8, 0.5]


@contextmanager
def arm(friction: Sequence[float] = (0.0, 0.0)) -> Iterator[None]:
    """Run an arm with dry friction [N·m] that hangs on its brakes until the first effort."""
    with NodeProcess(SIMULATED_ARM, {
            'joints': ['joint1', 'joint2'], 'initial_position': START, 'rate': 200.0,
            'friction.coulomb': list(friction)}):
        yield


@pytest.fixture
def options(tmp_path: Path) -> list[str]:
    """Return options for a busy machine, and for an arm that stays in one pose."""
    urdf = tmp_path / 'default.urdf'
    urdf.write_text(default_arm_urdf(), encoding='utf-8')
    given = write_parameters(tmp_path / 'given.yaml', UNHURRIED | {'state_max_age': 60.0})
    return ['--yes', '--unit', 'rad', '--urdf', str(urdf), '--parameters', str(given),
            '--poses', '1', '--output', str(tmp_path / 'my.yaml'), '--timeout', str(TIMEOUT)]


def test_a_right_arm_moves_no_more_than_the_probes(options, capsys, tmp_path):
    with arm(), RosClient() as client, client.collect(
            JointState, '/joint_states', BEST_EFFORT) as states:
        status = main(options)
        moved = np.abs([np.subtract(state.position, START) for state in states.messages])
    out, err = capsys.readouterr()
    assert status == 0, out + err
    assert 'good     drive of joint1: agrees' in out
    if 'good     feedback' in out:  # low gains of a busy machine need more steps
        np.testing.assert_allclose(moved.max(axis=0), [0.02, 0.02], atol=0.002, err_msg=out)
    assert (moved.max(axis=0) < 0.17).all(), out
    is_shown = 'check    probe of' not in out  # a busy machine lowers the gains
    command = read_parameter_file(tmp_path / 'my.yaml')['command']
    assert command == ('computed_torque' if is_shown else 'none')


def test_joints_that_friction_holds_are_pushed_until_they_move(options, capsys, tmp_path):
    friction = [9.0, 3.6]  # 6 % of the limits, more than the stiffness times 0.02 rad
    with arm(friction), RosClient() as client, client.collect(
            JointState, '/joint_states', BEST_EFFORT) as states:
        assert main(options) == 0
        moved = np.abs([np.subtract(state.position, START) for state in states.messages])
    out = capsys.readouterr().out
    assert 'check    probe of' not in out
    far = moved.max(axis=0)
    assert (far > 0.009).all()
    assert (far < 0.1).all()  # a busy machine lowers the gains, and the reference goes further
    found = read_parameter_file(tmp_path / 'my.yaml')
    assert found['command'] == 'computed_torque', out
    near = 0.5 if 'check    rate' in out else 0.25  # beside gaps, the work is less sure
    assert found['friction.coulomb'] == pytest.approx(friction, rel=near), out


def test_ctrl_c_stops_the_arm(options, tmp_path):
    with arm(), RosClient() as client:
        process = children.popen(
            [*PROGRAM[:2], PROGRAM[2].replace('ros2_dynamics.verbs', 'commands.connect'),
             *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        client.wait_for(JointState, '/connect/dynamics/reference')
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        status, _, err = finish(process)
    assert status == 130
    assert 'The arm has stopped, and the command has ended.' in err
    assert not (tmp_path / 'my.yaml').exists()
