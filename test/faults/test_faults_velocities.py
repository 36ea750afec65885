# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Measured velocities that contradict the positions, and joints whose samples repeat.

The driver reports a motion of both joints that does not depend on the commands.
`test/nodes/test_disturbed_motion.py` has the same faults in closed loop.
"""

from collections.abc import Iterator

from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import FaultBench, figure_of, Q
from fault_stimuli import altered, follow, Swing, wait_states
from fault_table import fault
import pytest
from sensor_msgs.msg import JointState

GROUP = 'Measured velocities'
AMPLITUDE, FREQUENCY = 0.15, 4.0
"""Of the motion of both joints, [rad] and [rad/s]."""

moving = Swing(Q, [AMPLITUDE, AMPLITUDE], FREQUENCY)


def wrong(message: JointState) -> JointState:
    """Change a state to one with a wrong sign of one velocity, and the other always 0."""
    moving(message)
    message.velocity = [-message.velocity[0], 0.0]
    return message


BENCH = {'parameters': {'following_error_limit': [0.0]}}
"""The arm does not follow its commands."""


@pytest.fixture
def bench(bench: FaultBench) -> Iterator[FaultBench]:
    """Return the node while the arm moves with true velocities."""
    bench.driver.stream_changed(moving)
    wait_consistent(bench)
    yield bench
    bench.driver.stream_changed(moving)
    wait_consistent(bench)
    bench.check_efforts()
    assert 'Traceback' not in bench.node.log, bench.node.log


def wait_consistent(bench: FaultBench) -> None:
    """Wait until velocities and positions agree and commands answer the states."""
    wait_states(bench, 200)
    bench.wait_status('joint states', lambda status: status.message == 'arriving')
    bench.wait_running()


@fault(GROUP, 'wrong sign of the velocity of a joint, and velocity of another joint always 0',
       'a warning names a joint; its velocity is estimated from the positions; the motion ends '
       'with a stop; the measured velocity is used again once it agrees')
def test_velocities_that_contradict_the_positions(bench):
    # The cause that the message names depends on the interval of the states, hence on load;
    # test_velocity_faults.py tests it.
    follow(bench, Q)
    bench.driver.stream_changed(wrong)
    status = bench.wait_status('joint states', lambda status: 'velocity of' in status.message)
    assert status.level == DiagnosticStatus.WARN
    assert "velocity of 'joint" in status.message
    bench.wait_message('reference', 'ended early: velocity of.*')
    bench.node.wait_for_log("velocity of 'joint.*elocit.* estimated from the position")
    assert bench.known('command', 'faults: frozen_joint') == 0
    bench.wait_running()


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
    bench.driver.stream_changed(frozen)
    status = bench.wait_fault('frozen_joint')
    assert "position and velocity of 'joint1' have not changed" in status.message
    assert figure_of(status, 'faults: frozen_joint') == before + 1
    bench.driver.stream_changed(moving)
    bench.wait_message('reference', 'ended early: fault frozen_joint.*')
    bench.wait_running()


@fault(GROUP, 'repeated position and velocity of an arm at rest', 'no fault: the arm stands still')
def test_an_arm_at_rest_may_repeat_its_sample(bench):
    faults = bench.known('command', 'faults: frozen_joint')
    bench.driver.stream_changed(altered(position=Q, velocity=[0.0, 0.0]))
    wait_states(bench, 300)
    assert bench.figure('command', 'faults: frozen_joint') == faults
    bench.wait_status('joint states', lambda status: status.message == 'arriving')
