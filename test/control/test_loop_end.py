# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The control loop at the end of its command: it stops a moving arm, then `end_action` acts."""

from collections.abc import Callable
from dataclasses import replace

from lock_step_loop import FIRST_STAMP, LockStep, MS
from loop_motions import arm_named, in_motion, Q, rests, with_command
import numpy as np
import pytest
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.supervisor import Mode
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model import ArmDynamics

ENDS: dict[str, Callable[[LockStep], None]] = {
    'deactivate': lambda one: one.loop.deactivate(one.now),
    'command: none': lambda one: with_command(one, 'none'),
}


@pytest.mark.parametrize('action', ['hold_then_silence', 'ramp_to_zero'])
@pytest.mark.parametrize(('end', 'name', 'rate'), [
    ('deactivate', 'default', 500.0), ('command: none', 'ur10', 100.0),
    ('deactivate', 'panda', 500.0)])
def test_a_moving_arm_stops_before_the_command_ends(end, name, rate, action):
    one = in_motion(name, rate=rate, delay=4)
    supervisor = one.loop.supervisor
    supervisor.options = replace(supervisor.options, end_action=action)
    most = np.abs(one.v).max()
    ENDS[end](one)
    assert supervisor.mode is Mode.BRAKING
    trace = one.run(3.5)
    is_ramp = action == 'ramp_to_zero'
    over = trace.mode.index(Mode.STOPPING if is_ramp else Mode.INACTIVE)
    assert over < 2500
    assert trace.speed[:over].max() < 1.1 * most
    assert trace.speed[over] < 0.05
    assert supervisor.mode is Mode.INACTIVE
    assert np.isnan(trace.effort[-100:]).all()
    efforts = trace.effort[~np.isnan(trace.effort).any(axis=1)]
    if is_ramp:
        assert efforts[-1].tolist() == [0.0] * len(one.q)
    else:  # it holds the arm
        assert Mode.STOPPING not in trace.mode
        gravity = ArmDynamics(one.arm).gravity(trace.q[over])
        assert efforts[-1] == pytest.approx(gravity, abs=0.05 * np.abs(gravity).max())
        assert np.isnan(trace.effort[over + 1:]).all()
    assert supervisor.fault is None
    assert (one.loop.controller.options.command == 'none') == (end == 'command: none')


def test_an_arm_that_swings_is_not_at_rest_when_it_returns():
    """It is where it was 100 ms before, at each comparison."""
    loop, q = ControlLoop.of_arm(arm_named('default')), Q.copy()
    for k in range(1000):
        phase = 2.0 * np.pi * k / 50
        v = 0.01 * 2.0 * np.pi / 0.1 * np.cos(phase) * np.ones(2)
        loop.answer(FIRST_STAMP + 2 * k * MS, q + 0.01 * np.sin(phase), v)
        if k == 250:
            loop.deactivate(1e-9 * (FIRST_STAMP + 2 * k * MS))
        assert k < 250 or loop.supervisor.mode is Mode.BRAKING


def test_an_arm_that_begins_to_move_is_not_at_rest():
    """It has moved little in 100 ms, and is as fast as at the end of a fall of 30 ms."""
    loop, q, v = ControlLoop.of_arm(arm_named('default')), Q.copy(), np.zeros(2)
    for k in range(100):
        if k == 5:
            loop.deactivate(1e-9 * (FIRST_STAMP + 2 * k * MS))
        if k > 40:
            v = np.full(2, 2.0 * 0.002 * (k - 40))
        loop.answer(FIRST_STAMP + 2 * k * MS, q + 0.25 * v**2, v)
        assert k < 5 or loop.supervisor.mode is Mode.BRAKING


def test_during_the_stop_no_reference_is_accepted_and_nothing_else_stops():
    one = in_motion()
    one.loop.deactivate(one.now)
    one.run(0.1)
    for command in ('node is not active', 'command ends'):
        with pytest.raises(TrajectoryError, match=command):
            one.follow(Q)
        assert 'nothing to stop' in one.loop.stop()
        one.loop.is_active = True  # as for `command: none`
    assert one.loop.supervisor.mode is Mode.BRAKING
    assert one.loop.goals.interruption == 'the node was deactivated'


def test_the_end_of_the_command_can_be_cancelled_during_the_stop():
    one = in_motion()
    with_command(one, 'none')
    one.run(0.1)
    assert one.loop.supervisor.mode is Mode.BRAKING
    with_command(one, 'computed_torque')
    assert one.loop.supervisor.mode is Mode.RUNNING
    trace = one.run(3.0)
    assert set(trace.mode) == {Mode.RUNNING}
    assert rests(trace)
    assert not np.isnan(trace.effort[::2]).any()
    one.follow(Q)
    assert one.run(3.0).q[-1] == pytest.approx(Q, abs=1e-3)
