# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults during references: stream timeouts."""

from typing import Any

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, G, NAMES, Q
from fault_stimuli import SetPoints
from fault_table import fault
import numpy as np
from ros_harness import wait_until
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
            bench.set_parameters(reference_timeout=TIMEOUT)
            # the timeout changes with the next set-point
            wait_until(lambda sent=stream.sent: stream.sent > sent + 1, 'two set-points')
        status = bench.wait_figure('reference', 'streams that paused', paused)
        bench.set_parameters(**NEVER)
        assert status.level == DiagnosticStatus.WARN
        assert status.message == (
            'ended early: the stream of set-points paused for more than reference_timeout')
        bench.efforts.clear()  # the simulated arm has not moved to its reference
        assert not any(map(is_gravity, bench.efforts.wait_count(50)))
    assert 'The stream of set-points paused' in bench.node.log
    rest(bench)
