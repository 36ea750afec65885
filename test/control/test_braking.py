# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The stop before the end of the command: the supervisor of the command, event by event."""

from typing import Any

import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.supervisor import CommandSupervisor, Mode
from supervised import answer, HOLD, PERIOD, PUSH, RELEASE, running, START, TROUBLE


def braking(**options: Any) -> CommandSupervisor:
    one = running(PUSH, end_action='ramp_to_zero', **options)
    one.end(START, RELEASE)
    assert one.mode is Mode.BRAKING
    assert one.mode is Mode.BRAKING
    assert one.is_commanding
    return one


@pytest.mark.parametrize(('state_timeout', 'longest'), [(0.0625, 0.0625), (60.0, 2.5)])
def test_without_states_a_stop_ends_with_the_ramp(state_timeout, longest):
    """After 2.5 s also if states may take long. Numbers are exact in binary."""
    one = braking(state_timeout=state_timeout)
    assert one.deadline == START + longest
    assert one.tick(START + longest) is None
    assert one.tick(START + longest + 0.001) is not None
    assert one.mode is Mode.STOPPING
    assert one.fault is None
    one = running(end_action='ramp_to_zero', state_timeout=state_timeout)
    one.end(START + state_timeout + 0.001, RELEASE)
    assert one.mode is Mode.STOPPING


@pytest.mark.parametrize('before', [True, False])
def test_a_fault_before_or_during_the_stop_holds_and_damps_the_arm(before):
    one = running(PUSH)
    endings = [Ending.by(TROUBLE), RELEASE]
    for ending in endings if before else endings[::-1]:
        one.end(START, ending)
    assert one.mode is Mode.BRAKING
    assert one.fault == TROUBLE
    assert one.fault_count == 1
    damped = HOLD + [2.0, -3.0]
    for k in range(1, 200):  # good states do not end the hold
        effort = one.answer(
            START + k * PERIOD, np.zeros(2), np.ones(2), PUSH, HOLD.copy, PERIOD,
            lambda *_: damped)
        assert one.damping == (pytest.approx(effort - HOLD), pytest.approx([2.0, -3.0]))
    assert effort == pytest.approx(damped)
    one.end(START + 0.4, Ending.by(TROUBLE))
    assert one.fault_count == 1
    one.resume()
    assert one.mode is Mode.FAULT
    assert answer(one, START + 0.402, PUSH) is not None
    assert one.mode is Mode.RUNNING
