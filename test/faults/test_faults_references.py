# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid references: each is rejected with one error, or followed within all limits."""

from itertools import count
import time
from typing import Any

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, figure_of, G, NAMES, Q, stamp_of
from fault_stimuli import NO_STREAM, SetPoints
from fault_table import fault, fault_cases
import numpy as np
import pytest
from raw_publisher import bytes_of
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GROUP = 'References'
REFUSED = 'rejected with one error that names the reason; the active reference continues'
NAN = float('nan')
GOAL = [Q[0] + 0.01, Q[1] - 0.02]
M = np.array([[6.95846097, 1.56923048], [1.56923048, 0.53]])
"""M(q) of the default arm at `Q` [kg·m²]."""
LIMITED = default_arm_urdf().replace('continuous', 'revolute').replace(
    '<limit ', '<limit lower="-2.0" upper="2.5" ')
"""The default arm with position limits."""
TORQUE = M @ (5.0**2 * np.subtract(GOAL, Q)) + G
"""Computed torque for `GOAL`, at rest at `Q` [N·m], with gains that late states do not lower."""
BENCH = {'parameters': {
    **NO_STREAM, 'gains.natural_frequency': [5.0], 'robot_description': LIMITED}}


def point(q: Any = Q, seconds: float = 0.0, **more: Any) -> JointTrajectoryPoint:
    """Return a trajectory point at a time [s]."""
    sec, nanosec = divmod(round(1e9 * seconds), 1_000_000_000)
    return JointTrajectoryPoint(
        positions=q, time_from_start=Duration(sec=sec, nanosec=nanosec), **more)


def trajectory(
    *points: JointTrajectoryPoint, names: Any = NAMES, stamp: Time | None = None,
) -> JointTrajectory:
    """Return a trajectory."""
    message = JointTrajectory(joint_names=names, points=points)
    message.header.stamp = stamp or Time()
    return message


def is_torque(message: Any) -> bool:
    """Return whether a command is the computed torque for `GOAL`."""
    return bool(np.allclose(message.effort, TORQUE, atol=1e-5))


def many_joints(count: int) -> JointTrajectory:
    return trajectory(point(), names=[*NAMES, *(f'other{i}' for i in range(count))])


def ended() -> JointTrajectory:
    return trajectory(point(Q, 1.0), point(Q, 2.0), stamp=stamp_of(time.time_ns() - 100 * 10**9))


@fault_cases(('make', 'reported'), GROUP, '{}', REFUSED, (
    ('a missing joint', lambda: trajectory(point(Q[:1]), names=NAMES[:1]), "lacks ['joint2']"),
    ('NaN in a position', lambda: trajectory(point([NAN, 0.0])),
     'points[0].positions[0] (joint1) is nan'),
    ('a goal 50 rad beyond the position limits', lambda: trajectory(point([50.0, 0.0])),
     'points[0].positions (joint1) is 50, expected a value within its limits [-2, 2.5]'),
    ('a start time 100 s ago, and an end in the past', ended, 'expected an end in the future'),
    ('100,000 points', lambda: trajectory(*[point(Q, 1e-3 * i) for i in range(100_000)]),
     'bytes, expected at most 1000000'),
    ('40,000 joints', lambda: many_joints(40_000), "joint_names has 'other0'")))
def test_a_reference_that_is_rejected(bench, make, reported):
    data = bytes_of(make())
    faults = bench.known('command', 'faults: state_timeout')
    bench.set_point(GOAL)
    bench.wait_steady(TORQUE)
    before = len(refusals(bench))
    bench.trajectories.publish(data)
    wait_until(lambda: len(refusals(bench)) > before, 'a refusal')
    bench.efforts.clear()
    assert all(map(is_torque, bench.efforts.wait_count(20)))
    words, = refusals(bench)[before:]
    assert reported in words
    assert len(words) < 400
    assert 'Traceback' not in bench.node.log
    status = bench.wait_status('reference', lambda status: reported in str(status))
    assert status.level == DiagnosticStatus.WARN
    assert figure_of(status, 'refused') == len(refusals(bench))
    bench.set_point(Q)
    bench.wait_status('reference', lambda status: status.level == DiagnosticStatus.OK)
    bench.wait_steady(G)  # the next goal would otherwise come while this motion begins
    assert bench.known('command', 'faults: state_timeout') == faults


def refusals(bench: FaultBench) -> list[str]:
    """Return the log lines about rejected references."""
    return [line for line in bench.node.log.splitlines() if 'Rejected a joint traj' in line]


@fault_cases('message', GROUP, '{}', 'approached or followed at this speed', (
    ('a last point after 68 years', trajectory(point(GOAL, 2.0**31 - 1.0))),
    ('a start time in 2038', trajectory(point(GOAL), stamp=Time(sec=2**31 - 1)))))
def test_a_reference_that_takes_long(bench, message):
    bench.set_point(Q)
    bench.check_alive()
    bench.trajectories.publish(message)
    bench.wait_message('reference', 'following')
    bench.efforts.clear()
    for effort in bench.efforts.wait_count(50):  # at the goal it differs by 15 N·m
        assert effort.effort == pytest.approx(G, abs=2.0)
    bench.set_point(Q)
    bench.check_alive()


@fault(GROUP, 'a stream of set-points at 50 Hz that exceeds a position limit',
       'set-points beyond the limit are rejected, with one error per 5 s; the last valid one is '
       'held')
def test_a_stream_with_set_points_beyond_a_limit(bench):
    bench.set_point(GOAL)
    bench.wait_steady(TORQUE)
    before, refused = len(refusals(bench)), bench.known('reference', 'refused')
    goals, begun = count(3.0, 0.01), time.monotonic()
    bench.efforts.clear()
    with SetPoints(bench, lambda: [next(goals), 0.0]) as stream:
        wait_until(lambda: stream.sent >= 20, 'twenty set-points')
    bench.wait_figure('reference', 'refused', refused + stream.sent)
    assert all(map(is_torque, bench.efforts.messages))
    assert 1 <= len(refusals(bench)) - before <= 2 + (time.monotonic() - begun) / 5.0
    bench.set_point(Q)
    bench.check_alive()


@fault(GROUP, 'a goal 50 rad beyond the position limits, `infeasible_trajectory: clip`',
       'followed to the position limit')
def test_a_goal_that_is_clipped(client, bench):
    bench.set_point(Q)
    bench.check_alive()
    bench.set_parameters(infeasible_trajectory='clip')
    with client.collect(JointState, bench.name('reference')) as references:
        references.wait_matched()
        bench.set_point([Q[0], 50.0])
        references.wait_for(lambda message: message.position[1] == pytest.approx(2.5))
        assert max(message.position[1] for message in references.messages) < 2.5 + 1e-6
    bench.set_point(Q)
    bench.check_alive()
    bench.set_parameters(infeasible_trajectory='reject')
