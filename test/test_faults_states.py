# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Faults in what a driver sends: states that cannot be believed, and silence."""

from collections.abc import Callable, Iterator
import time
from typing import Any

from fault_bench import fault_bench, FaultBench, G, NAMES, nanoseconds_of, Q, stamp_of
from fault_table import fault
import pytest
from ros_harness import RosClient
from sensor_msgs.msg import JointState

NAN, INF = float('nan'), float('inf')
GROUP = 'Joint states that cannot be used'
DROPPED = 'dropped alone and told, `state_timeout` if nothing else comes, back by itself'


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """Return a node that commands gravity compensation, as tests leave it."""
    with fault_bench(client, '/faults_states') as one:
        yield one


def altered(**fields: Any) -> Callable[[JointState], JointState]:
    """Return what replaces fields of each state."""
    def change(message: JointState) -> JointState:
        for name, value in fields.items():
            setattr(message, name, value)
        return message

    return change


def shifted(seconds: float) -> Callable[[JointState], JointState]:
    """Return what moves the stamp of each state."""
    def change(message: JointState) -> JointState:
        message.header.stamp = stamp_of(
            nanoseconds_of(message.header.stamp) + round(1e9 * seconds))
        return message

    return change


def inject(bench: FaultBench, change: Callable[[JointState], JointState | None]) -> float:
    """Let the driver send nothing but this from now on; return when that was."""
    bench.check_alive()
    bench.driver.change = change
    return time.monotonic()


@pytest.mark.parametrize(('reason', 'fields'), [
    pytest.param('invalid', fields, marks=fault(GROUP, words, DROPPED)) for words, fields in (
        ('NaN in a position that is used', {'position': [NAN, 0.0]}),
        ('infinity in a velocity that is used', {'velocity': [0.0, -INF]}),
        ('a joint missing', {'name': NAMES[:1], 'position': Q[:1], 'velocity': [0.0]}),
        ('a joint twice', {'name': [*NAMES, 'joint1'], 'position': [*Q, 0.0], 'velocity': []}),
        ('fewer positions than names', {'position': Q[:1]}),
        ('more velocities than names', {'velocity': [0.0] * 3}),
        ('no position', {'position': []}),
    )])
def test_a_state_that_cannot_be_used(
    bench: FaultBench, reason: str, fields: dict[str, Any],
) -> None:
    before = bench.figure('joint states', f'dropped: {reason}')
    inject(bench, altered(**fields))
    bench.wait_dropped(reason, before)
    bench.wait_fault('state_timeout')
    bench.check_alive()


@pytest.mark.parametrize('fields', [
    pytest.param(fields, marks=fault(GROUP, words, 'answered as ever'))
    for words, fields in (
        ('NaN in the efforts of a state', {'effort': [NAN, NAN]}),
        ('NaN and infinity for joints that are not used', {
            'name': [*NAMES, 'wheel'], 'position': [*Q, NAN], 'velocity': [0.0, 0.0, INF]}),
        ('another order of joints', {'name': NAMES[::-1], 'position': Q[::-1]}),
        ('joints beside those of the arm', {
            'name': ['wheel', NAMES[0], 'lid', NAMES[1]],
            'position': [9.0, Q[0], -9.0, Q[1]], 'velocity': [1.0, 0.0, 1.0, 0.0]}),
    )])
def test_a_state_that_is_only_odd(bench: FaultBench, fields: dict[str, Any]) -> None:
    moment = inject(bench, altered(**fields))
    bench.efforts.wait_count(len(bench.efforts.messages) + 50)
    for _, message in bench.efforts.since(moment):
        assert list(message.name) == NAMES
        assert message.effort == pytest.approx(G, abs=1e-6)
    bench.check_alive()


@fault('Silence and time', 'stamps 10 s in the past', DROPPED)
def test_stamps_in_the_past(bench: FaultBench) -> None:
    inject(bench, shifted(-10.0))
    assert 'old' in bench.wait_dropped('too old').message
    bench.wait_fault('state_timeout')
    bench.check_alive()
