# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults during references: stream timeouts, and states without velocities."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, G, NAMES, nanoseconds_of, Q
from fault_stimuli import altered, from_now, SetPoints
from fault_table import fault
import numpy as np
from ros_harness import KEEP_MANY, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GROUP = 'References'
TIMEOUT = 0.3
"""`reference_timeout` [s] after the end of a stream."""
NEVER = {'reference_timeout': 60.0}
"""`reference_timeout` during a stream, longer than any pause on a loaded machine."""
GOAL = [Q[0] + 0.01, Q[1]]
BENCH = {'parameters': NEVER}


def rest(bench: FaultBench) -> None:
    """Make the node hold the arm with a trajectory, which ends any stream."""
    bench.trajectories.publish(JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(positions=Q, time_from_start=Duration(nanosec=nanosec))
        for nanosec in (0, 1000)]))
    bench.check_alive()


@contextmanager
def short_timeout(bench: FaultBench) -> Iterator[None]:
    """Set `reference_timeout` to `TIMEOUT`, so that a stream without new set-points times out."""
    bench.set_parameters(reference_timeout=TIMEOUT)
    try:
        yield
    finally:
        bench.set_parameters(**NEVER)


def is_gravity(message: Any) -> bool:
    """Return whether a command is g(q)."""
    return bool(np.allclose(message.effort, G, atol=1e-6))


@fault(GROUP, 'set-points at 50 Hz that time out',
       'followed for `reference_timeout` (0.3 s in this test), then a planned stop, and the '
       'position is held; reported and counted; the next set-point is followed again')
def test_a_stream_that_pauses(bench):
    bench.check_alive()
    for paused in (1, 2):
        with SetPoints(bench, lambda: GOAL) as stream:
            bench.efforts.clear()
            bench.efforts.wait_for(lambda message: not is_gravity(message))
            wait_until(lambda: stream.sent >= 10, 'ten set-points')
        bench.wait_message('reference', 'following')
        with short_timeout(bench):
            status = bench.wait_figure('reference', 'streams that paused', paused)
        assert status.level == DiagnosticStatus.WARN
        assert status.message == (
            'ended early: the stream of set-points paused for more than reference_timeout')
        bench.efforts.clear()  # the simulated arm has not moved to its reference
        assert not any(map(is_gravity, bench.efforts.wait_count(50)))
    assert 'The stream of set-points paused' in bench.node.log
    rest(bench)


@fault(GROUP, 'joint states without velocities, with `require_measured_velocities`',
       'gravity compensation; the reference ends, with a report; a set-point is rejected; no '
       'message on `~/computed_torque`; with velocities again, the position is held')
def test_states_without_velocities(bench):
    rest(bench)
    with bench.client.collect(JointState, bench.name('computed_torque'), KEEP_MANY) as torques:
        torques.wait_matched()
        bench.set_parameters(require_measured_velocities=True)
        bench.driver.change = altered(velocity=[])
        status = bench.wait_message('reference', '.*no velocity.*')
        assert status.level == DiagnosticStatus.WARN
        bench.set_point(GOAL)
        bench.wait_status('reference', lambda status: any(
            'no joint state with velocities' in value.value for value in status.values))
        moment = from_now(bench)
        bench.efforts.clear()
        bench.efforts.wait_for(lambda m: nanoseconds_of(m.header.stamp) >= moment)
        assert all(map(is_gravity, bench.efforts.wait_count(50)))
        assert not [m for m in torques.messages if nanoseconds_of(m.header.stamp) >= moment]
        bench.efforts.clear()
        bench.driver.go_on()
        torques.wait_for(lambda m: nanoseconds_of(m.header.stamp) >= moment)
        torques.clear()
        assert all(map(is_gravity, torques.wait_count(50)))
        assert all(map(is_gravity, bench.efforts.messages))
    bench.set_parameters(require_measured_velocities=False)
    rest(bench)
