# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Limits of position and effort: commands that they change, and that they do not."""

from collections.abc import Iterator

from fault_bench import FaultBench, figure_of, G, Q
from fault_stimuli import check_rate, DIRECT, move_by_hand, NO_STREAM, wait_effort, wait_states
from fault_table import fault
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf

GROUP = 'Limits'
UPPER = 1.0
"""Position limit of both joints [rad], in both directions."""
EFFORT = 150.0, 60.0
"""Effort limits [N·m]."""
STIFF = {'gains.kp': [1e4], 'gains.kd': [20.0]}
"""Gains that request more than the effort limit at 0.2 rad of error, at any velocity."""
DEFAULT_GAINS = {'gains.kp': [100.0], 'gains.kd': [20.0]}
URDF = default_arm_urdf().replace('type="continuous"', 'type="revolute"').replace(
    '<limit ', f'<limit lower="{-UPPER}" upper="{UPPER}" ')
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


@fault(GROUP, 'a joint 0.0086 rad past its upper limit, then 0.009 rad past it',
       'no fault within the tolerance of 0.0087 rad; then the fault `position_limit`, which names '
       'joint and distance: the law holds the arm, with its reference at the limit, while joint '
       'states are valid; ends automatically after five valid states')
def test_a_position_past_its_limit(bench):
    bench.set_parameters(**DEFAULT_GAINS)
    before = bench.known('command', 'faults: position_limit')
    move_by_hand(bench, [UPPER + 0.0086, Q[1]])
    bench.set_point([UPPER, Q[1]])
    wait_states(bench, 20)
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


@fault(GROUP, 'a reference that needs more than the effort limit; then `effort_limit_fraction` is '
       'lowered to 0.5', 'clamped to the URDF limit × `effort_limit_fraction`, counted; changes '
       'within the rate limit')
def test_an_effort_beyond_its_limit(bench):
    bench.set_parameters(**STIFF)
    before = bench.known('command', 'held back by effort limit')
    for sign in (-1.0, 1.0):
        bench.set_point(np.add(Q, 0.2 * sign).tolist())
        wait_effort(bench, sign * np.array(EFFORT))
    bench.wait_status('command', lambda status: (
        figure_of(status, 'held back by effort limit') > before
        and status.message == 'held back by a limit'))
    bench.set_parameters(effort_limit_fraction=0.5)
    wait_effort(bench, [75.0, 30.0])
    messages = bench.efforts.messages
    assert all((np.abs(message.effort) <= EFFORT).all() for message in messages)
    check_rate(bench.efforts)
