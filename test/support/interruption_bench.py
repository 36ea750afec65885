# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A bench for interruptions of a reference, and the checks of the command after them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import fault_bench, FaultBench, NAMES, Q
from fault_stimuli import follow, move_by_hand
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from ros_harness import RosClient
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GROUP = 'Reference interruptions'
HELD = 'the command stays within 5 N·m of g(q) at the measured position'
LIMIT = 2.5
"""[rad]: position limits of both joints."""
URDF = default_arm_urdf().replace('type="continuous"', 'type="revolute"').replace(
    '<limit ', f'<limit lower="{-LIMIT}" upper="{LIMIT}" ')
BODY = ArmDynamics(load_arm(URDF)).rigid_body
NEAR = 5.0
"""[N·m], the largest difference of efforts after an interruption from the gravity torque."""
ELSEWHERE = [0.2, 1.1]
"""[rad]: where the arm is moved by hand."""
FAR = [Q[0] + 1.0, Q[1] - 1.0]


@contextmanager
def interruption_bench(client: RosClient, namespace: str) -> Iterator[FaultBench]:
    """Run a node with default parameters for an arm with limits; yield its bench."""
    with fault_bench(client, namespace, {'robot_description': URDF}) as one:
        yield one


@contextmanager
def following(bench: FaultBench) -> Iterator[FaultBench]:
    """Yield the bench with the arm at rest at `Q` and following `Q`; clean up at the end."""
    bench.set_parameters(command='computed_torque')
    bench.check_alive()
    follow(bench, Q)
    yield bench
    bench.driver.v = [0.0, 0.0]
    bench.driver.go_on()
    bench.set_parameters(command='computed_torque')
    bench.set_parameters(command='gravity_compensation')  # a change ends any reference and hold
    move_by_hand(bench, Q)
    bench.check_alive()


def gravity(q: Sequence[float]) -> Any:
    """Return the gravity torque at q [N·m]."""
    return BODY.gravity(np.array(q))


def trajectory_to(q: Sequence[float], seconds: int) -> JointTrajectory:
    """Return a trajectory of a straight path from `Q` to q."""
    return JointTrajectory(joint_names=NAMES, points=[
        JointTrajectoryPoint(positions=list(one), time_from_start=Duration(sec=sec))
        for one, sec in ((Q, 0), (q, seconds))])


def wait_rejected(bench: FaultBench, reason: str) -> None:
    """Send a trajectory and a set-point; wait until diagnostics show `reason` as a rejection."""
    before = bench.figure('reference', 'refused')
    bench.trajectories.publish(trajectory_to(FAR, 2))
    bench.set_point(FAR)
    status = bench.wait_figure('reference', 'refused', before + 2)
    assert status.level == DiagnosticStatus.WARN
    refusal, = (v.value for v in status.values if v.key == 'refusal of the latest')
    assert reason in refusal


def check_held(bench: FaultBench, q: Sequence[float], count: int = 100) -> None:
    """Check that at least `count` efforts since the last `clear`, all of them, are near g(q)."""
    messages = bench.efforts.wait_count(count)
    hold = gravity(q)
    for message in messages:
        assert (np.abs(message.effort - hold) <= NEAR).all(), message
    assert messages[-1].effort == pytest.approx(hold, abs=1e-6)
