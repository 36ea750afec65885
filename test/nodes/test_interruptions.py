# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The end of a reference and the command after it, on a real node with default parameters.

After each interruption the effort stays near the gravity torque of the measured position,
independent of the reference before the interruption and of messages sent during it.
"""

import re
import time
from typing import Any

from fault_bench import FaultBench, G, Q
from fault_stimuli import follow, move_by_hand
from fault_table import fault
from interruption_bench import (
    check_held,
    ELSEWHERE,
    gravity,
    GROUP,
    HELD,
    LIMIT,
    trajectory_to,
    wait_rejected,
)
from lifecycle_bench import ACTIVATE, CONFIGURE, DEACTIVATE, lifecycle_bench
import numpy as np
import pytest
from rclpy.parameter import Parameter
from robot_dynamics_interfaces.srv import InverseDynamicsBatch
from ros_harness import LONG, RosClient, TIMEOUT, wait_until
from std_srvs.srv import Trigger

# --- trajectories that are sent while no reference can be followed ------------------------------

@fault(GROUP, 'a trajectory and a set-point during a timeout of the joint states',
       f'rejected with the fault as the reason; after recovery {HELD}')
def test_an_outage(arm):
    arm.driver.be_quiet()
    arm.wait_state_timeout()
    status = arm.next_status('reference')
    assert status.message.startswith('ended early: fault state_timeout: no valid joint state')
    wait_rejected(arm, 'no reference can be followed now: fault state_timeout')
    arm.wait_silent()  # the fault action has ended
    arm.efforts.clear()
    arm.driver.q = list(ELSEWHERE)  # the node has no data on the motion during the outage
    arm.driver.go_on()
    check_held(arm, ELSEWHERE)
    assert arm.next_status('reference').message.startswith('ended early: ')
    follow(arm, ELSEWHERE)  # a later set-point is followed


@fault(GROUP, 'a trajectory and a set-point during the fault `position_limit`',
       f'rejected with the fault as the reason; pulled back to the limit; afterwards {HELD}')
def test_a_position_limit(arm):
    arm.set_parameters(command='gravity_compensation')  # allows to move the arm by hand
    beyond = [LIMIT + 0.02, Q[1]]
    move_by_hand(arm, beyond)
    assert "position of 'joint1' is 2.5" in arm.wait_fault('position_limit').message
    wait_rejected(arm, 'no reference can be followed now: fault position_limit')
    arm.efforts.clear()
    for message in arm.efforts.wait_count(100):  # a spring pulls the joint back
        assert message.effort[0] < gravity(beyond)[0] - 5.0
    inside = [LIMIT - 0.1, Q[1]]
    move_by_hand(arm, inside)
    arm.wait_running()
    arm.wait_steady(gravity(inside))  # the effort leaves that of the fault at a limited rate
    arm.set_parameters(command='computed_torque')
    arm.efforts.clear()
    check_held(arm, inside)


# --- an arm that is moved by hand ----------------------------------------------------------------

@fault(GROUP, 'deactivation; the arm is moved by hand; activation',
       f'a trajectory sent in between is rejected; after activation {HELD}')
def test_deactivation(arm):
    assert arm.change(DEACTIVATE)
    assert arm.next_status('reference').message == 'ended early: the node was deactivated'
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, 'no reference can be followed now: the node is not active')
    arm.efforts.clear()
    assert arm.change(ACTIVATE)
    assert arm.efforts.wait_for().effort == pytest.approx(gravity(ELSEWHERE), abs=1e-6)
    check_held(arm, ELSEWHERE)


@fault(GROUP, '`command: none`; the arm is moved by hand; `command: computed_torque`',
       f'a trajectory sent in between is rejected; afterwards {HELD}')
def test_another_command(arm):
    arm.set_parameters(command='none')
    ended = "ended early: command was set to 'none'"
    assert arm.next_status('reference').message == ended
    arm.wait_message('command', 'none .*')
    move_by_hand(arm, ELSEWHERE)
    wait_rejected(arm, "command is 'none', expected 'cartesian_impedance'")
    arm.efforts.clear()
    arm.set_parameters(command='computed_torque')
    check_held(arm, ELSEWHERE)
    assert arm.next_status('reference').message == ended  # until the next reference
    follow(arm, ELSEWHERE)


# --- faults --------------------------------------------------------------------------------------

@fault(GROUP, 'an arm that does not follow its reference',
       'fault `following_error` that names joint and distance; the arm is held at its '
       'measured position; the reference has ended')
def test_a_following_error(arm):
    before = arm.known('command', 'faults: following_error')
    arm.set_parameters(following_error_limit=[0.05])
    arm.efforts.clear()
    arm.set_point([Q[0] + 0.2, Q[1]])  # the driver reports that the arm stays
    arm.wait_figure('command', 'faults: following_error', before + 1)
    status = arm.wait_message('reference', 'ended early: .*')
    assert re.match(
        r"ended early: fault following_error: position of 'joint1' is 0\..* from its reference, "
        r'expected at most 0\.05 \(following_error_limit\)', status.message)
    arm.wait_running()
    wait_until(
        lambda: np.allclose(arm.efforts.messages[-1].effort, G, atol=1e-6), 'the gravity torque')
    assert (arm.efforts.steps() <= np.array([1500.0, 600.0]) * 0.05 + 1e-6).all()
    arm.efforts.clear()
    check_held(arm, Q)
    assert arm.figure('command', 'faults: following_error') == before + 1
    unset = Parameter('following_error_limit', Parameter.Type.DOUBLE_ARRAY, [])
    arm.set_parameters(following_error_limit=unset)


# --- planned stops -------------------------------------------------------------------------------

def stop(bench: FaultBench) -> Any:
    """Call `~/stop`; return the response."""
    response = bench.ask('stop', Trigger)
    assert response.success
    return response


BATCHES, SAMPLES = 8, 100_000


@fault(GROUP, '`~/stop` while 8 batches of 100,000 samples are computed',
       'answered, and effective, before the batches are answered')
def test_stop_while_batches_are_computed(arm, seen):
    node = arm.client.node
    service = node.create_client(InverseDynamicsBatch, arm.name('inverse_dynamics_batch'))
    answered: list[float] = []
    try:
        with RosClient('operator') as operator:
            assert service.wait_for_service(TIMEOUT)
            # in another thread, so that no answer to a batch delays the answer of ~/stop
            operator.call(Trigger, arm.name('stop'))
            arm.trajectories.publish(trajectory_to([Q[0] + 0.8, Q[1] + 0.8], 10))
            arm.efforts.wait_for(lambda m: abs(m.effort[0] - G[0]) > 5.0)  # the reference moves
            request = InverseDynamicsBatch.Request(position=np.zeros(2 * SAMPLES))
            for _ in range(BATCHES):
                service.call_async(request).add_done_callback(
                    lambda _: answered.append(time.monotonic()))
            begun = time.monotonic()
            response = operator.call(Trigger, arm.name('stop'))
            seconds, before = time.monotonic() - begun, len(answered)
            assert response.success
            assert response.message.startswith('stopping along the reference')
            wait_until(lambda: len(answered) > before, 'the answer of a later batch', LONG)
            arm.wait_message('reference', 'ended early: ~/stop was called')
            seen(f'answered in {1e3 * seconds:.0f} ms, after {before} of {BATCHES} batches')
    finally:
        node.destroy_client(service)


@fault(GROUP, '`~/stop` while the node is unconfigured or inactive',
       '`success` true; the message explains that there is nothing to stop')
def test_stop_of_a_node_that_is_not_active(client):
    with lifecycle_bench(client, '/interrupted_idle', {'autostart': False}) as one:
        words = 'nothing to stop: the node is not active'
        assert one.state() == 'unconfigured'
        assert stop(one).message == 'nothing to stop: no model yet'
        assert one.change(CONFIGURE)
        assert stop(one).message == words
        assert one.change(ACTIVATE)
        one.check_alive()
        assert one.change(DEACTIVATE)
        assert stop(one).message == words
        one.check_silent()
