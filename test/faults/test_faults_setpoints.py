# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults during references: stream timeouts, steps, and states without velocities."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle
import time
from typing import Any

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import fault_bench, FaultBench, G, NAMES, nanoseconds_of, Q
from fault_stimuli import altered, check_rate, DIRECT, from_now, SetPoints
from fault_table import fault, fault_cases
import numpy as np
import pytest
from ros_harness import KEEP_MANY, RosClient, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GROUP = 'References'
TIMEOUT = 0.5
"""`reference_timeout` [s] after the end of a stream."""
NEVER = {'reference_timeout': 60.0}
"""`reference_timeout` during a stream, longer than any pause on a loaded machine."""
GOAL = [Q[0] + 0.01, Q[1]]
LIMITS = 150.0, 60.0
"""Effort limits of the default arm [N·m]."""
BENCH = {'parameters': NEVER}


@pytest.fixture(scope='module')
def direct(client: RosClient) -> Iterator[FaultBench]:
    """Return a node that passes set-points to the control law without conditioning."""
    with fault_bench(client, '/faults_direct', {**NEVER, **DIRECT}) as one:
        yield one


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


def wait_now(bench: FaultBench, predicate: Callable[[Any], bool]) -> float:
    """Wait for a new command; return its time of arrival [s]."""
    bench.efforts.clear()
    bench.efforts.wait_for(predicate)
    return next(t for t, message in bench.efforts.since(0.0) if predicate(message))


@fault(GROUP, 'set-points at 50 Hz that time out',
       'followed for `reference_timeout` (0.5 s in this test), then a planned stop, and the '
       'position is held; reported and counted; the next set-point is followed again')
def test_a_stream_that_pauses(bench):
    bench.check_alive()
    for _ in range(2):
        before = bench.known('reference', 'streams that paused')
        with SetPoints(bench, lambda: GOAL) as stream:
            wait_now(bench, lambda message: not is_gravity(message))
            wait_until(lambda: stream.sent >= 10, 'ten set-points')
        bench.wait_message('reference', 'following')
        with short_timeout(bench):
            status = bench.wait_figure('reference', 'streams that paused', before + 1)
        assert status.level == DiagnosticStatus.WARN
        assert status.message == (
            'ended early: the stream of set-points paused for more than reference_timeout')
        bench.efforts.clear()  # the simulated arm has not moved to its reference
        assert not any(map(is_gravity, bench.efforts.wait_count(100)))
    assert 'The stream of set-points paused' in bench.node.log
    rest(bench)


@fault(GROUP, 'a single set-point', 'held, because one set-point is not a stream')
def test_one_set_point_is_held(bench):
    bench.check_alive()
    bench.set_point(GOAL)
    sent = time.monotonic()
    wait_now(bench, lambda message: not is_gravity(message))
    with short_timeout(bench):
        wait_until(lambda: time.monotonic() > sent + 2.0 * TIMEOUT, 'two timeouts to pass')
        bench.efforts.clear()
        assert not any(map(is_gravity, bench.efforts.wait_count(20)))
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


JUMPS = (
    ('a set-point 2 rad away', {'q': [Q[0] + 2.0, Q[1] - 2.0]}),
    ('a set-point at the velocity limit', {'q': Q, 'velocities': [10.0, -10.0]}),
    ('a set-point with an acceleration of 1e9 rad/s²', {
        'q': Q, 'velocities': [0.0, 0.0], 'accelerations': [-1e9, 1e9]}))


@fault_cases(
    'more', GROUP, '{}, `condition_references: false`',
    'the command stays within the effort limits and `effort_rate_limit`', JUMPS)
def test_a_set_point_that_jumps(direct, more):
    bench = direct
    bench.check_alive()
    before = bench.known('command', 'held back by effort rate')
    bench.set_point(**more)
    bench.efforts.wait_for(lambda message: np.abs(message.effort) == pytest.approx(LIMITS))
    bench.set_point(Q)
    wait_until(lambda: is_gravity(bench.efforts.messages[-1]), 'the hold torque again')
    messages = bench.efforts.messages
    assert all((np.abs(message.effort) <= LIMITS).all() for message in messages)
    check_rate(bench.efforts)
    bench.wait_figure('command', 'held back by effort rate', before + 1)
    rest(bench)


@fault(GROUP, 'set-points that jump by 4 rad at 50 Hz, `condition_references: false`',
       'the command stays within the effort limits and `effort_rate_limit`')
def test_a_stream_of_set_points_that_jump(direct, seen):
    bench = direct
    bench.check_alive()
    poses = cycle(([Q[0] + 2.0, Q[1]], [Q[0] - 2.0, Q[1]]))
    with SetPoints(bench, lambda: next(poses)) as stream:
        wait_until(lambda: stream.sent >= 50, 'fifty set-points')
    bench.set_point(Q)
    wait_until(lambda: is_gravity(bench.efforts.messages[-1]), 'the hold torque again')
    messages = bench.efforts.messages
    efforts = np.array([message.effort for message in messages])
    assert (np.abs(efforts) <= LIMITS).all()
    check_rate(bench.efforts)
    seen(f'commands of joint1 between {efforts[:, 0].min():.0f} and {efforts[:, 0].max():.0f} N·m')
    rest(bench)


@pytest.mark.parametrize('more', [
    pytest.param(more, id=words, marks=(*(() if i == 0 else (pytest.mark.soak,)), fault(
        GROUP, f'{words}, by default', 'rejected, or approached within all limits of the arm: '
        'the command stays within the effort limits and `effort_rate_limit`')))
    for i, (words, more) in enumerate(JUMPS)])
def test_a_set_point_far_away(bench, more):
    rest(bench)
    before = bench.figure('reference', 'refused')
    with bench.client.collect(JointState, bench.name('reference'), KEEP_MANY) as references:
        references.wait_matched()
        references.wait_for()
        bench.set_point(**more)
        wait_until(
            lambda: bench.figure('reference', 'refused') > before
            or any(any(m.velocity) for m in references.messages), 'a reaction')
        bench.efforts.wait_count(len(bench.efforts.messages) + 200)
        for one, other in zip(references.messages, references.messages[1:]):
            dt = 1e-9 * (nanoseconds_of(other.header.stamp) - nanoseconds_of(one.header.stamp))
            step = np.abs(np.subtract(other.position, one.position))
            if not any(other.velocity) and other.position == pytest.approx(bench.driver.q):
                continue  # a fault has ended the reference: the arm is held where it is
            assert (step <= 10.0 * dt + 1e-6).all()  # the velocity limit of both joints
            assert (np.abs(other.velocity) <= 10.0 + 1e-6).all()
    bench.check_efforts()
    messages = bench.efforts.messages
    assert all((np.abs(message.effort) <= LIMITS).all() for message in messages)
    check_rate(bench.efforts)
    rest(bench)
