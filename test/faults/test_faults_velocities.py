# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Measured velocities that contradict the positions, and joints whose samples repeat.

The driver reports a motion of both joints that does not depend on the commands.
`test/control/test_loop_velocities.py` has the same faults in closed loop.
"""

from collections.abc import Iterator
from itertools import pairwise
import time

from fault_bench import FaultBench, figure_of, nanoseconds_of, Q
from fault_stimuli import follow, Swing, wait_states
from fault_table import fault
import pytest
from ros_harness import KEEP_MANY
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

GROUP = 'Measured velocities'
AMPLITUDE, FREQUENCY = 0.5, 0.9
"""
Of the motion of both joints, [rad] and [rad/s].

It needs little more torque than gravity, so that friction could be the reason why it does not
follow the commands.
"""

moving = Swing(Q, [AMPLITUDE, AMPLITUDE], FREQUENCY)


def wrong(message: JointState) -> JointState:
    """Change a state to one with a wrong sign of one velocity, and the other always 0."""
    moving(message)
    message.velocity = [-message.velocity[0], 0.0]
    return message


BENCH = {'parameters': {
    'following_error_limit': [0.0], 'gains.natural_frequency': [0.3]}}
"""
The arm does not follow its commands. They differ by up to 4 N·m from what the motion needs, so
that usual friction explains it: with larger gains the drive check rightly ends the command.
"""


@pytest.fixture
def bench(bench: FaultBench) -> Iterator[FaultBench]:
    """Return the node while the arm moves with true velocities; it cannot begin in a moment."""
    bench.driver.be_quiet()
    time.sleep(1.0)
    bench.driver.stream_changed(moving)
    wait_states(bench, 300)
    bench.wait_running()
    yield bench
    bench.driver.stream_changed(moving)
    wait_states(bench, 300)
    bench.wait_running()
    bench.check_efforts()
    assert 'Traceback' not in bench.node.log, bench.node.log


@fault(GROUP, 'wrong sign of the velocity of a joint, and velocity of another joint always 0',
       'the velocity is that of the positions; no fault; the reference is followed on; the status '
       '`joint states` names the joints')
def test_velocities_that_contradict_the_positions(bench):
    follow(bench, Q)
    with bench.client.collect(JointState, bench.name('computed_torque'), KEEP_MANY) as torques:
        torques.wait_matched()
        bench.driver.stream_changed(wrong)
        wait_states(bench, 300)
        begin = time.time_ns()  # a busy test receives earlier messages afterwards
        torques.wait_for(lambda message: nanoseconds_of(message.header.stamp) > begin + 10**9)
        messages = [message for message in torques.messages
                    if nanoseconds_of(message.header.stamp) > begin]
    assert len(messages) > 50
    for before, message in pairwise(messages):
        # The velocity of the positions is that of the middle of 8 ms, or of one period.
        stamp = nanoseconds_of(message.header.stamp)
        span = max(stamp - nanoseconds_of(before.header.stamp), 8_000_000)
        (q, _), (_, v) = moving.at(stamp), moving.at(stamp - span // 2)
        torque = default_dynamics().inverse_dynamics(q, v, 0.09 * (Q - q) - 0.6 * v)
        # the wrong velocities change it by up to 4.5 N·m
        assert list(message.effort) == pytest.approx(torque.tolist(), abs=1.0)
    bench.wait_status('joint states', lambda status: (
        "the velocity of ['joint1', 'joint2'] contradicts the position" in status.message))
    assert bench.figure('command', 'faults: frozen_joint') == 0
    assert 'ended early' not in bench.next_status('reference').message


@fault(GROUP, 'repeated position and velocity of a moving joint',
       'fault `frozen_joint`; commands resume after 25 states that change')
def test_a_frozen_joint(bench):
    samples: list[tuple[float, float]] = []

    def frozen(message: JointState) -> JointState:
        moving(message)
        if not samples and abs(message.velocity[0]) > 0.4:
            samples.append((message.position[0], message.velocity[0]))
        if samples:
            message.position[0], message.velocity[0] = samples[0]
        return message

    before = bench.known('command', 'faults: frozen_joint')
    follow(bench, Q)
    bench.driver.stream_changed(frozen)
    status = bench.wait_fault('frozen_joint')
    assert "the position of ['joint1'] has not changed for more than 0.05 s" in status.message
    assert figure_of(status, 'faults: frozen_joint') == before + 1
    bench.driver.stream_changed(moving)
    bench.wait_message('reference', 'ended early: fault frozen_joint.*')
    bench.wait_running()
