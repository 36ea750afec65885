# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invalid service requests: each is answered or ignored, and control continues."""

from collections.abc import Iterator
import itertools
import random
import re

from action_clients import Client, seconds
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from damaged_bytes import HEAD, noise, with_noise
from fault_bench import NAMES, Q, V
from fault_table import fault, fault_cases
from large_requests import LargeRequests, POINTS, SAMPLES
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from raw_requests import LENGTH, RawRequests, WIDE
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from request_bench import ControlContinues
from robot_dynamics_interfaces.srv import InverseDynamics
from ros_harness import NO_SHARED_MEMORY, TIMEOUT, wait_until
from service_requests import REFUSALS, SERVICES
from simulated_arms import default_dynamics
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GROUP = 'Service requests'
REFUSED = '`success` false with field, value and expectation; control continues'
IGNORED = 'ignored, because no answer is possible; control continues'
RAW_TYPES = {
    **SERVICES, 'set_parameters': SetParameters, 'get_parameters': GetParameters,
    'set_parameters_atomically': SetParametersAtomically, 'change_state': ChangeState}
MOST_MEMORY = 1.5 * 2**30
"""Memory limit of a node, its memory at the start, and a margin [bytes]."""


@pytest.fixture(scope='module')
def large(control: ControlContinues) -> Iterator[LargeRequests]:
    """Return a process that sends large requests."""
    with LargeRequests(control.bench.namespace) as process:
        yield process


@pytest.fixture(scope='module')
def raw(control: ControlContinues) -> Iterator[RawRequests]:
    """Return a process that sends arbitrary bytes as requests."""
    with RawRequests(control.bench.namespace) as process:
        yield process


# --- malformed -----------------------------------------------------------------------------------

@fault(GROUP, 'malformed requests to every service: empty, NaN, wrong lengths, names, links or '
       'times, overflow', REFUSED)
def test_malformed_requests(control):
    with control.checked():
        for service, fields, words in REFUSALS:
            response = control.ask(service, SERVICES[service], **fields)
            assert re.search(words, response.message), response.message
            # no field is filled in
            assert response == SERVICES[service].Response(success=False, message=response.message)


# --- huge ----------------------------------------------------------------------------------------

@fault_cases(('case', 'message'), GROUP, '{}', 'correct answer; control continues', (
    (f'a batch of {SAMPLES:,} samples', 'batch', ''),
    (f'a trajectory of {POINTS:,} points', 'points', "effort of 'joint1' is .* its limit")))
def test_large_requests(control, large, case, message, seen):
    with control.checked():
        answer = large.call(case)
    assert answer.success
    assert answer.is_right
    assert re.search(message, answer.message), answer.message[:200]
    assert len(answer.message) < 5000
    seen(f'answered in {answer.seconds:.2g} s; longest gap between commands '
         f'{1e3 * control.longest_pause:.0f} ms')


# --- many clients, and clients that are killed ---------------------------------------------------

@fault(GROUP, '20 clients with 5 requests each at the same time',
       'each client gets the answers to its own requests; control continues')
def test_many_clients_at_the_same_time(control, seen):
    node, name = control.bench.client.node, control.bench.name('inverse_dynamics')
    dynamics = default_dynamics()
    positions = np.random.default_rng(3).uniform(-3.0, 3.0, (20, 5, 2))
    # Each client receives the answers to all clients; by default it keeps 10 of them.
    deep = QoSProfile(depth=positions[..., 0].size)
    clients = [node.create_client(InverseDynamics, name, qos_profile=deep) for _ in positions]
    with control.checked():
        for service in clients:
            assert service.wait_for_service(TIMEOUT)
        futures = [
            (q, service.call_async(InverseDynamics.Request(position=q.tolist())))
            for turn in positions.swapaxes(0, 1) for q, service in zip(turn, clients)]
        wait_until(lambda: all(future.done() for _, future in futures), 'all answers')
        for q, future in futures:
            assert future.result().effort == pytest.approx(dynamics.rigid_body.gravity(q))
    for service in clients:
        node.destroy_client(service)
    seen(f'longest gap between commands {1e3 * control.longest_pause:.0f} ms')


@fault(GROUP, 'a client that is killed during its request',
       'the next client gets its answer; control continues')
def test_a_client_that_dies_mid_call(control):
    doomed = LargeRequests(control.bench.namespace, NO_SHARED_MEMORY)
    with control.checked():
        doomed.send('points')
        doomed.kill()
        control.bench.check_answers()


# --- raw bytes -----------------------------------------------------------------------------------

def begins(count: int) -> bytes:
    """Return a raw request that starts with an element count."""
    return count.to_bytes(4, 'little').ljust(LENGTH, b'\1')


@fault(GROUP, 'requests to every service: random bytes, truncated, with a wrong element count, 4 '
       'billion or 500 million', f'{IGNORED}; the node uses at most 1 GiB of memory')
def test_damaged_requests(control, raw, seen):
    source = random.Random(1)
    whole = serialize_message(InverseDynamics.Request(joint_names=NAMES, position=Q))[4:]
    requests = [(name, kind, data) for name, kind in RAW_TYPES.items() for data in (
        source.randbytes(LENGTH), source.randbytes(LENGTH), begins(2**32 - 1), begins(2**29),
        *(whole[start:start + LENGTH] for start in (0, 12, 24)))]
    with control.checked():
        raw.send(requests)
        for name in SERVICES:  # all services still answer
            assert not control.ask(name, SERVICES[name]).message.startswith('internal')
    assert control.bench.peak_memory() < MOST_MEMORY
    seen(f'{len(requests)} requests; at most {control.bench.peak_memory() / 2**20:.0f} MiB')


@fault(GROUP, 'a request with an element count of 8 million names, without names',
       'ignored; control may pause while the middleware allocates memory; commands resume')
def test_a_count_that_delays_control(control, raw, seen):
    with control.checked(with_faults=True):
        raw.send([('inverse_dynamics', InverseDynamics, begins(2**23))])
    assert control.bench.peak_memory() < MOST_MEMORY
    seen(f'longest gap between commands {1e3 * control.longest_pause:.0f} ms')


HOLD = FollowJointTrajectory.Goal(trajectory=JointTrajectory(joint_names=NAMES, points=[
    JointTrajectoryPoint(positions=Q, velocities=V, time_from_start=seconds(0.5))]))
NEXT = FollowJointTrajectory.Goal(trajectory=JointTrajectory(joint_names=NAMES, points=[
    JointTrajectoryPoint(positions=Q, velocities=V, time_from_start=seconds(t))
    for t in (0.0, 0.5)]))
"""No set-point, which could belong to a stream of damaged ones."""
ACTION = 'follow_joint_trajectory/_action/'
IMPL = FollowJointTrajectory.Impl
REQUESTS = {
    'send_goal': (IMPL.SendGoalService, {'goal': HOLD}),
    'cancel_goal': (IMPL.CancelGoalService, {}), 'get_result': (IMPL.GetResultService, {})}
SUCCEEDED = GoalStatus.STATUS_SUCCEEDED, FollowJointTrajectory.Result.SUCCESSFUL, ''


def with_counts(data: bytes) -> Iterator[bytes]:
    """Yield the message with each word of four bytes replaced by one of two impossible counts."""
    for at, count in zip(range(HEAD, len(data) - 3, 4), itertools.cycle((2**32 - 1, 2**29))):
        yield data[:at] + count.to_bytes(4, 'little') + data[at + 4:]


@fault(GROUP, 'requests to all services of the action, while a goal is executed: with wrong '
       'element counts, 4 billion or 500 million, with random bytes, or only random bytes',
       'ignored, or answered; the next goal succeeds')
def test_damaged_requests_of_the_action(client, control, seen):
    requests = []
    for name, (kind, fields) in REQUESTS.items():
        whole = bytes(serialize_message(kind.Request(**fields)))
        requests += [
            (ACTION + name, kind, data[HEAD:].ljust(LENGTH + 1, b'\0')[:WIDE])
            for data in (*with_counts(whole), *with_noise(whole, 8), *noise(4))]
    action = Client(client, control.bench.namespace)
    with RawRequests(control.bench.namespace) as raw, control.checked():
        sent = action.send(HOLD)
        raw.send(requests)
        assert sent.result()[0] in (SUCCEEDED[0], GoalStatus.STATUS_ABORTED)
        assert action.send(NEXT).result() == SUCCEEDED
    assert control.bench.peak_memory() < MOST_MEMORY
    seen(f'{len(requests)} requests')


@fault(GROUP, 'a goal from a client without readers of the results',
       'the goal waits for them, or is executed; everything else is answered meanwhile')
def test_a_goal_without_readers_of_the_results(client, control):
    request = bytes(serialize_message(IMPL.SendGoalService.Request(goal=HOLD)))[HEAD:]
    with RawRequests(control.bench.namespace) as raw, control.checked():
        raw.send([(f'{ACTION}send_goal', IMPL.SendGoalService, request)])
        assert control.ask('inverse_dynamics', InverseDynamics, position=Q).success
    assert Client(client, control.bench.namespace).send(HOLD).result() == SUCCEEDED
