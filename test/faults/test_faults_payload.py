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

"""Payloads that come, go, or cannot be, while efforts go out."""

from collections.abc import Callable, Iterator
from typing import Any

from fault_bench import fault_bench, FaultBench, G, Q
from fault_stimuli import check_rate, NO_STREAM
from fault_table import fault
from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
import numpy as np
import pytest
from robot_dynamics_interfaces.srv import SetPayload
from ros_harness import RosClient, wait_until
from std_msgs.msg import Header

GROUP = 'Payloads'
NAN, INF = float('nan'), float('inf')
MASS = 5.0
"""[kg]"""
SHOULDER = 1.0 * np.sin(Q[0]), 0.8 * np.sin(Q[0] + Q[1])
"""How far the elbow is to the side of the shoulder, and the tip of the elbow [m]."""
LOADED = np.array(G) - 9.81 * MASS * np.array([sum(SHOULDER), SHOULDER[1]])
"""g(q) with that mass at the tip [N m]: masses that are upright fall to the side."""


@pytest.fixture(scope='module')
def bench(client: RosClient) -> Iterator[FaultBench]:
    """Return a node that commands gravity compensation without a payload."""
    with fault_bench(client, '/faults_payload', NO_STREAM) as one:
        yield one


def set_payload(
    bench: FaultBench, mass: float, seconds: float = 0.0, link: str = 'tool0',
    com: Vector3 | None = None, **inertia: float,
) -> Any:
    """Ask for a payload; return the answer."""
    return bench.client.call(SetPayload, bench.name('set_payload'), SetPayload.Request(
        payload=InertiaStamped(
            header=Header(frame_id=link),
            inertia=Inertia(m=mass, com=com or Vector3(), **inertia)),
        transition_time=seconds))


def is_loaded(message: Any) -> bool:
    """Tell whether an effort holds the arm and the payload."""
    return bool(np.allclose(message.effort, LOADED, atol=1e-5))


@fault(GROUP, '5 kg at the tip from one state to the next, and off again',
       'the effort goes to the new g(q) no faster than its rate limit')
def test_a_payload_at_once(bench: FaultBench, seen: Callable[[str], Any]) -> None:
    bench.check_alive()
    assert set_payload(bench, MASS).success
    bench.efforts.wait_for(is_loaded)
    assert set_payload(bench, 0.0).success
    wait_until(
        lambda: np.allclose(bench.efforts.messages[-1].effort, G, atol=1e-6), 'no load again')
    check_rate(bench.efforts)
    seen(f'from {G[0]:.0f} to {LOADED[0]:.0f} N m')
    bench.check_alive()


@fault(GROUP, '5 kg at the tip with a transition of 0.5 s', 'the effort goes there in that time')
def test_a_payload_that_fades_in(bench: FaultBench) -> None:
    bench.check_alive()
    assert set_payload(bench, MASS, 0.5).success
    bench.efforts.wait_for(is_loaded)
    check_rate(bench.efforts, abs(LOADED[0] - G[0]) / 0.5)
    assert set_payload(bench, 0.0).success
    bench.check_alive()


@pytest.mark.parametrize(('request_', 'reported'), [
    pytest.param(request, reported, id=words, marks=fault(
        GROUP, words, 'refused with a message that names it; the effort stays as it is'))
    for words, request, reported in (
        ('a negative mass', {'mass': -1.0}, 'payload.inertia.m is -1'),
        ('a mass that is NaN', {'mass': NAN}, 'payload.inertia.m is nan'),
        ('an infinite mass', {'mass': INF}, 'payload.inertia.m is inf'),
        ('an unknown link', {'mass': 1.0, 'link': 'wheel'},
         "payload.header.frame_id is 'wheel'"),
        ('a centre of mass that is NaN', {'mass': 1.0, 'com': Vector3(y=NAN)},
         'payload.inertia.com[1] (y) is nan'),
        ('a moment of inertia that no body has', {'mass': 1.0, 'ixx': 1.0},
         'payload.inertia has the principal moments'),
        ('a moment of inertia without a mass', {'mass': 0.0, 'ixx': 1.0, 'iyy': 1.0, 'izz': 1.0},
         'payload.inertia.m is 0 with a moment of inertia'),
        ('a negative transition', {'mass': 1.0, 'seconds': -1.0}, 'transition_time is -1'),
        ('a transition that is NaN', {'mass': 1.0, 'seconds': NAN}, 'transition_time is nan'),
        ('a transition without end', {'mass': 1.0, 'seconds': INF}, 'transition_time is inf'),
    )])
def test_a_payload_that_cannot_be(
    bench: FaultBench, request_: dict[str, Any], reported: str,
) -> None:
    bench.check_alive()
    answer = set_payload(bench, **request_)
    assert not answer.success
    assert reported in answer.message
    assert all(m.effort == pytest.approx(G, abs=1e-6) for m in bench.efforts.messages)
    bench.check_alive()
