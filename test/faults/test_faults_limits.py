# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of position, velocity and effort: commands that they change, and that they do not."""

from collections.abc import Iterator
from typing import Any

from fault_bench import FaultBench, figure_of, G, nanoseconds_of, Q
from fault_stimuli import (
    check_rate,
    DIRECT,
    move_by_hand,
    NO_STREAM,
    Swing,
    wait_effort,
    wait_states,
)
from fault_table import fault
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from sensor_msgs.msg import JointState

GROUP = 'Limits'
LOWER, UPPER = -1.0, 1.0
"""Position limits of both joints [rad]."""
EFFORT = 150.0, 60.0
"""Effort limits [N·m]."""
AWAY = 0.5
"""Position error [rad] for which stiff gains request more than the effort limit."""
STIFF = {'gains.kp': [1e4], 'gains.kd': [20.0]}
"""Gains that request more than the effort limit at 0.2 rad of error, at any velocity."""
DEFAULT_GAINS = {'gains.kp': [100.0], 'gains.kd': [20.0]}
URDF = default_arm_urdf().replace('type="continuous"', 'type="revolute"').replace(
    '<limit ', f'<limit lower="{LOWER}" upper="{UPPER}" ')
BODY = ArmDynamics(load_arm(URDF)).rigid_body


BENCH = {'parameters': {**NO_STREAM, **DIRECT, 'robot_description': URDF}}


@pytest.fixture
def bench(bench: FaultBench) -> Iterator[FaultBench]:
    """Return the node with the arm at rest at `Q`; check afterwards that it holds `Q` again."""
    bench.check_alive()
    yield bench
    bench.set_parameters(effort_limit_fraction=1.0, effort_rate_limit=0.0, **DEFAULT_GAINS)
    bench.hold = G
    bench.driver.go_on()
    bench.driver.q, bench.driver.v = list(Q), [0.0, 0.0]
    wait_states(bench, 20)  # until a fault has ended
    bench.set_point(Q)
    bench.check_alive()


def gravity(q: Any) -> Any:
    """Return g(q)."""
    return BODY.gravity(np.array(q))


def acceleration(swing: Swing, message: JointState) -> Any:
    """Return the acceleration (n,) that a command causes."""
    q, v = swing.at(nanoseconds_of(message.header.stamp))
    return BODY.forward_dynamics(q, v, np.array(message.effort))


def be_at(bench: FaultBench, q: Any) -> None:
    """Move the arm to q and the reference to q within the limits; wait until it is followed."""
    move_by_hand(bench, q)
    reference = np.clip(q, LOWER, UPPER)
    bench.set_point(reference.tolist())
    bench.hold = gravity(q)
    bench.efforts.clear()
    if (reference == q).all():
        wait_effort(bench, bench.hold)
    else:
        bench.efforts.wait_count(20)


# --- position ------------------------------------------------------------------------------------

@fault(GROUP, 'a joint 0.005 rad before its upper limit; feedback pushes toward the limit',
       'no acceleration of that joint toward the limit but to brake it, counted; away from it the '
       'effort is not limited')
def test_a_position_limit_ahead(bench):
    q = [UPPER - 0.005, Q[1]]
    be_at(bench, q)
    before = bench.known('command', 'held back by position limit')
    swing = Swing(q, [0.002, 0.0], 25.0)
    bench.set_parameters(effort_rate_limit=1e6)  # which has priority over the other limits
    bench.driver.change = swing  # damping pushes toward the limit
    wait_states(bench, 20)
    bench.efforts.clear()
    bench.set_point([q[0], q[1] - 0.1])  # joint2 shows that the reference is followed
    bench.efforts.wait_for(lambda message: abs(message.effort[1] - bench.hold[1]) > 5.0)
    bench.wait_status('command', lambda status: (
        figure_of(status, 'held back by position limit') > before
        and status.message == 'held back by a limit'))
    for message in bench.efforts.wait_count(200):
        leaving = max(-swing.at(nanoseconds_of(message.header.stamp))[1][0], 0.0)
        assert acceleration(swing, message)[0] < 0.1 + 20.0 * leaving  # which brakes the joint
    bench.driver.go_on()
    bench.set_parameters(**STIFF)
    bench.set_point([q[0] - AWAY, q[1]])
    bench.efforts.clear()
    bench.efforts.wait_for(lambda message: abs(message.effort[0] + EFFORT[0]) < 1e-6)


@fault(GROUP, 'a joint 0.0086 rad past its upper limit, then 0.009 rad past it',
       'no fault within the tolerance of 0.0087 rad; then the fault `position_limit`, which names '
       'joint and distance: the law holds the arm, with its reference at the limit, while joint '
       'states are valid; ends automatically after five valid states')
def test_a_position_past_its_limit(bench):
    bench.set_parameters(**DEFAULT_GAINS)
    before = bench.known('command', 'faults: position_limit')
    be_at(bench, [UPPER + 0.0086, Q[1]])
    assert bench.figure('command', 'faults: position_limit') == before
    bench.driver.q[0] = UPPER + 0.009
    assert ("position of 'joint1' is 1.009, 0.009 past its limit, expected at most 0.0087"
            in bench.wait_fault('position_limit').message)
    wait_states(bench, 100)
    bench.efforts.clear()
    for message in bench.efforts.wait_count(200):  # for longer than hold_time and ramp_time
        pull = BODY.forward_dynamics(np.array(bench.driver.q), np.zeros(2), message.effort)
        assert pull == pytest.approx([-100.0 * 0.009, 0.0], abs=0.05)
    assert 'position_limit' in bench.status('command').message
    assert bench.known('command', 'faults: position_limit') == before + 1


# --- velocity ------------------------------------------------------------------------------------

@fault(GROUP, 'joint1 at 12 rad/s, and a reference that accelerates it; its limit is 10 rad/s',
       'no acceleration along the motion, counted; braking is not limited')
def test_overspeed(bench):
    before = bench.known('command', 'held back by velocity limit')
    center = [0.0, 0.0]  # where joint1 exerts no Coriolis torque on joint2
    bench.set_parameters(effort_rate_limit=1e6, **{'gains.kp': [15.0], 'gains.kd': [0.1]})
    move_by_hand(bench, center)
    swing = bench.driver.change = Swing(center, [0.9, 0.0], 12.0 / 0.9)
    wait_states(bench, 400)  # velocities are in doubt for 1 s after the jump to the swing
    bench.set_point([center[0] + 0.4, 0.0])
    bench.wait_figure('command', 'held back by velocity limit', before + 1)
    bench.efforts.clear()
    motion = [(swing.at(nanoseconds_of(m.header.stamp))[1][0], acceleration(swing, m)[0])
              for m in bench.efforts.wait_count(200)
              if abs(m.effort[0]) < EFFORT[0]]  # a late state can move the reference far away
    along = [a * v / abs(v) for v, a in motion if abs(v) > 10.1]
    assert max(along) < 0.1
    assert min(along) < -3.0  # braking


# --- effort --------------------------------------------------------------------------------------

@fault(GROUP, 'a reference that needs more than the effort limit; then `effort_limit_fraction` is '
       'lowered to 0.5', 'clamped to the URDF limit × `effort_limit_fraction`, counted; changes '
       'within the rate limit')
def test_an_effort_beyond_its_limit(bench):
    bench.set_parameters(**STIFF)
    before = bench.known('command', 'held back by effort limit')
    for sign in (-1.0, 1.0):
        bench.set_point(np.add(Q, 0.2 * sign).tolist())
        wait_effort(bench, sign * np.array(EFFORT))
    bench.wait_figure('command', 'held back by effort limit', before + 1)
    bench.set_parameters(effort_limit_fraction=0.5)
    wait_effort(bench, [75.0, 30.0])
    messages = bench.efforts.messages
    assert all((np.abs(message.effort) <= EFFORT).all() for message in messages)
    check_rate(bench.efforts)
