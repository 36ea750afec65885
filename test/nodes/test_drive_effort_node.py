# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes in lock-step: an arm whose drives have a scale and an offset."""

from collections.abc import Callable
from pathlib import Path
import re
from typing import Any

from bounded_waits import Collector, has_stamp
from closed_loop import closed_loop, collecting, NAMES, START
import numpy as np
import pytest
from recordings import joint_state_messages, write_recording
from robot_dynamics.model import arm_from_parameters, ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.parameters import effort_rates, torque_rates
from robot_dynamics.ros.middleware.conversions import stamp_from_ros, stamp_to_ros
from robot_dynamics.tools.analyze_bag import main as analyze_bag
from ros_harness import LONG, RosClient, write_parameters
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GOAL = [0.2, 1.0]
ARM = load_arm(default_arm_urdf())
G, LIMIT = ArmDynamics(ARM).gravity(START), ARM.limits.effort
SCALE, OFFSET = [0.7, 1.3], [8.0, -4.0]
DRIVES = {'joints': NAMES, 'effort.scale': SCALE, 'effort.offset': OFFSET}
SOFT = {'gains.natural_frequency': [8.0]}
SECOND = 1_000_000_000
NOISE = 0.02
"""Standard deviation of the measured effort [N·m]."""


def to(position: list[float], seconds: int = 0, stamp: Any = None) -> JointTrajectory:
    """Return a set-point, or a motion from START in this time that begins at a stamp."""
    rest = {'velocities': [0.0, 0.0], 'accelerations': [0.0, 0.0]}
    message = JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(positions=position, **rest)])
    if stamp is not None:
        message.header.stamp = stamp
        message.points[0].time_from_start.sec = seconds
        message.points.insert(0, JointTrajectoryPoint(positions=START, **rest))
    return message


def move(
    client: RosClient, namespace: str, states: Collector, answers: Collector,
    goal: JointTrajectory, is_answer: Callable[[Any], bool], seconds: float,
) -> None:
    """Send a goal until this answers it, and wait for this simulated time."""
    goals = client.publisher(JointTrajectory, f'{namespace}/dynamics/joint_trajectory')
    answer = client.ask(goals, goal, answers, is_answer, LONG)
    end = stamp_from_ros(answer.header.stamp) + seconds * SECOND
    states.wait_for(lambda m: stamp_from_ros(m.header.stamp) >= end, LONG)


def is_any(message: Any) -> bool:
    return message is not None


def moves(state: Any) -> bool:
    return bool(np.abs(state.velocity).max() > 0.1)


ARM_OF_DRIVES = {**DRIVES, 'rate': 200.0, 'real_time_factor': 3.0, 'effort_noise': NOISE}


def test_drives_that_the_controller_does_not_know_let_the_arm_sag(client):
    with collecting(
            client, '/sags', 'joint_states', 'dynamics/computed_torque') as (states, answers), \
            closed_loop('/sags', {'joints': NAMES, **SOFT}, **ARM_OF_DRIVES):
        move(client, '/sags', states, answers, to(START), is_any, 0.5)
    moved = np.abs(np.array([m.position for m in states.messages]) - START)
    assert moved.max() > 0.02


def test_known_drives_hold_the_arm_and_a_recording_agrees_with_the_model(client, tmp_path, capsys):
    with client.collect(Float64MultiArray, '/holds/dynamics/commands') as bare, collecting(
            client, '/holds', 'joint_states', 'effort_command', 'dynamics/computed_torque',
            'dynamics/gravity_compensation', 'dynamics/residual') as topics:
        states, commands, answers, gravity, residuals = topics
        with closed_loop('/holds', {**DRIVES, **SOFT}, **ARM_OF_DRIVES) as node:
            move(client, '/holds', states, answers, to(START), is_any, 0.3)
            node.wait_for_log('Effort check passed: ', LONG)
            still = states.messages
            residual = residuals.wait_count(40, LONG)[-20:]  # without the release of the brakes
            begin = stamp_from_ros(states.messages[-1].header.stamp) + SECOND // 2
            move(client, '/holds', states, states, to(GOAL, 2, stamp_to_ros(begin)), moves, 2.0)
            moved = [m for m in states.messages if stamp_from_ros(m.header.stamp) > begin]
            bare.wait_count(1)
    held = np.array([m.position for m in still])
    assert np.abs(held - START).max() < 1e-3
    # filtered at 10 Hz, of 200 Hz, so that little of the noise is left
    assert np.abs([m.effort for m in residual]).max() < NOISE
    driver = np.array([m.effort for m in commands.messages])
    assert (np.abs(driver) <= LIMIT).all()
    first, = (m for m in commands.messages[:1])
    assert first.effort == pytest.approx(G / SCALE + OFFSET)  # efforts of the driver
    assert {tuple(m.data) for m in bare.messages if any(m.data)} & {
        tuple(m.effort) for m in commands.messages}
    torque = gravity.wait_for(has_stamp(first.header.stamp))
    assert torque.effort == pytest.approx(G)  # a torque at the joints
    check_recording(moved, tmp_path, capsys)


def check_recording(
    messages: list[Any], directory: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    """Compare the residual that `analyze_bag` prints with and without the parameters."""
    stamps = np.array([stamp_from_ros(m.header.stamp) for m in messages])
    new = np.flatnonzero(np.diff(stamps, prepend=0) > 0)  # a state that waits is sent again
    q, v, effort = (
        np.array([getattr(messages[i], field) for i in new])
        for field in ('position', 'velocity', 'effort'))
    bag = write_recording(directory / 'bag', list(zip(
        stamps[new].tolist(), joint_state_messages(stamps[new], NAMES, q, v, effort))))
    urdf = directory / 'arm.urdf'
    urdf.write_text(default_arm_urdf(), encoding='utf-8')
    file = write_parameters(directory / 'drives.yaml', DRIVES)
    call = [str(bag), '--urdf', str(urdf), '--cutoff', '10']
    for arguments, low, high in (
            ([*call, '--parameters', str(file)], 0.0, 1.0), (call, 10.0, 1000.0)):
        assert analyze_bag(arguments) == 0
        rows = re.findall(r'^(joint\d) (.*)$', capsys.readouterr().out, re.MULTILINE)
        relative = {name: float(cells.split()[4]) for name, cells in rows[:2]}  # [%]
        assert set(relative) == set(NAMES)
        assert all(low <= value < high for value in relative.values()), relative


@pytest.mark.parametrize(('rate', 'driver'), [(0.0, [1500.0, 600.0]), (40.0, [40.0, 40.0])])
def test_the_rate_limit_is_that_of_the_driver(rate, driver):
    arm, values = arm_from_parameters(default_arm_urdf(), DRIVES), {'effort_rate_limit': rate}
    assert effort_rates(values, arm).tolist() == driver
    assert torque_rates(values, arm) == pytest.approx(np.array(driver) * SCALE)
