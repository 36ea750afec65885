# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the stamps and publishers of joint states: age, jumps, two publishers."""

import itertools
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import G, Q, stamp_of
from fault_stimuli import (
    another_publisher,
    check_rate,
    follow,
    shifted,
    stamped,
    wait_effort,
    wait_states,
)
from fault_table import fault, fault_cases
import numpy as np
import pytest
from ros_harness import wait_until
from sensor_msgs.msg import JointState
from simulated_arms import default_dynamics

pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Stamps of joint states'
PUBLISHERS = 'Inconsistent joint states'
ELSEWHERE = [Q[0] + 3.0, Q[1]]
GOAL = [Q[0] + 0.05, Q[1]]
DROPPED = 'dropped and reported; fault `state_timeout` without valid states; commands resume'


@fault_cases(('seconds', 'reason', 'words'), GROUP, 'stamps {}', DROPPED, (
    ('10 s in the past', -10.0, 'too old', 's old, expected at most 9 s (state_max_age)'),
    ('10 s in the future', 10.0, 'from the future', 's in the future, expected at most 9 s')))
def test_stamps_of_another_time(bench, seconds, reason, words):
    before = bench.known('joint states', f'dropped: {reason}')
    bench.driver.change = shifted(seconds)
    assert words in bench.wait_dropped(reason, before).message
    bench.wait_state_timeout()


@fault(GROUP, 'constant stamps with changing positions', 'not new: the last command is repeated, '
       'then fault `state_timeout`; counted; commands resume')
def test_frozen_stamps(bench):
    bench.set_parameters(command='gravity_compensation')  # no feedback, whatever the position
    bench.check_alive()
    before = bench.known('joint states', 'not new (stamp repeated)')
    stamp = time.time_ns()
    freeze, sent = stamped(stamp), itertools.count()

    def moving(message: JointState) -> JointState:
        """Move from the second state on; the first one is that of an arm at rest."""
        message.position[0] += 0.01 * next(sent)
        return freeze(message)

    bench.efforts.clear()
    bench.driver.change = moving
    bench.wait_figure('joint states', 'not new (stamp repeated)', before + 1)
    bench.wait_state_timeout()
    bench.wait_silent()
    efforts = [message.effort for message in bench.efforts.messages
               if message.header.stamp == stamp_of(stamp)]
    assert len(efforts) > 1
    for effort in efforts:  # g(q) of the first state with this stamp, or a fraction of it
        fraction = np.divide(effort, efforts[0])
        assert fraction == pytest.approx([fraction[0]] * 2, abs=1e-6)
        assert 0.0 <= fraction[0] <= 1.0 + 1e-9
    bench.check_alive()
    bench.set_parameters(command='computed_torque')


@fault(GROUP, '`use_sim_time` is set to true and back at run time, with old stamps',
       'old stamps are answered while it is true, and dropped while it is false')
def test_use_sim_time_at_run_time_changes_the_rule(bench):
    bench.set_parameters(use_sim_time=True)
    bench.driver.change = shifted(-100.0)
    bench.efforts.wait_for(lambda m: m.header.stamp.sec < time.time() - 50.0)
    before = bench.known('joint states', 'dropped: too old')
    bench.set_parameters(use_sim_time=False)
    bench.wait_dropped('too old', before)


# --- several publishers --------------------------------------------------------------------------

@fault_cases(
    ('driver', 'change', 'reason'), PUBLISHERS, '{}',
    'fault `several_publishers` that names joint or stamp, until 100 '
    'consecutive states are consistent; valid states are answered with g(q); ends '
    'automatically', (
        ('two publishers with poses 3 rad apart', {'q': ELSEWHERE}, shifted(0.0), 'jump'),
        ('two publishers, one with stamps 1 s behind', {}, shifted(-1.0), 'stamp went back')))
def test_two_publishers(bench, driver, change, reason):
    before = bench.known('command', 'faults: several_publishers')
    dropped = bench.known('joint states', f'dropped: {reason}')
    with another_publisher(bench, change, **driver):
        status = bench.wait_fault('several_publishers')
        assert 'there are several publishers of joint_states' in status.message
        bench.wait_dropped(reason, dropped)
        wait_states(bench, 150)  # and as many of the other: more than recovery needs
        assert bench.status('command').level == DiagnosticStatus.ERROR
        assert bench.known('command', 'faults: several_publishers') == before + 1
        bench.efforts.clear()
        messages = bench.efforts.wait_count(200)  # for longer than hold_time and ramp_time
        # g(q) of the accepted pose, or a value between g(q) of both poses
        poses = np.array([G, gravity(driver.get('q', Q))])
        for message in messages:
            assert (poses.min(axis=0) - 1e-6 <= message.effort).all()
            assert (message.effort <= poses.max(axis=0) + 1e-6).all()
        assert bench.status('command').level == DiagnosticStatus.ERROR


# --- one publisher -------------------------------------------------------------------------------

def gravity(q: list[float]) -> Any:
    """Return g(q) of the default arm."""
    return default_dynamics().rigid_body.gravity(np.array(q))


@fault(PUBLISHERS, 'one publisher whose position jumps by 3 rad',
       'five states are dropped; then accepted as a reset of the robot or simulator: the '
       'reference ends, with a report; the arm is held at its measured position; the command '
       'changes within the rate limit')
def test_one_publisher_that_jumps(bench):
    bench.check_alive()
    follow(bench, GOAL)
    bench.efforts.wait_for(lambda message: not np.allclose(message.effort, G, atol=1.0))
    faults = bench.known('command', 'faults: several_publishers')
    before = bench.figure('joint states', 'restarted: jump')
    dropped = bench.known('joint states', 'dropped: jump')

    def is_noticed() -> bool:
        """Jump; states far apart in time, as on a loaded machine, are not inconsistent."""
        bench.driver.q = list(Q)
        wait_states(bench, 10)
        bench.driver.q = ELSEWHERE
        return bench.figure('joint states', 'restarted: jump') > before

    wait_until(is_noticed, 'a restart because of a jump')
    assert bench.known('joint states', 'dropped: jump') >= dropped + 5
    wait_effort(bench, gravity(ELSEWHERE))
    bench.wait_message('reference', 'ended early: joint states restarted: jump')
    assert bench.known('command', 'faults: several_publishers') == faults
    bench.driver.q = list(Q)
    bench.efforts.clear()
    wait_effort(bench, G)
    check_rate(bench.efforts)
