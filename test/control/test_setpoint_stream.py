# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Detection of a stream of set-points, and of its end."""

from hypothesis import given, settings
from hypothesis import strategies as st
from robot_dynamics.control.setpoint_stream import SetPointStream

TIMEOUT = 0.125
"""Exact in binary, as are whole seconds, so that the very timeout can be tried."""
LONG_AFTER = 1e6


def streaming(count: int, pause: float = 0.02) -> tuple[SetPointStream, float]:
    """Return a stream after `count` set-points, and the arrival time [s] of the last one."""
    stream, t = SetPointStream(TIMEOUT), 0.0
    for k in range(count):
        t = 50.0 + k * pause
        stream.arrived(True, t)
    return stream, t


def test_an_ended_stream_is_reset():
    stream, t = streaming(10)
    stream.end()
    assert t + LONG_AFTER <= stream.deadline
    for _ in range(4):
        stream.arrived(True, t)
    assert t + LONG_AFTER <= stream.deadline


def test_a_new_timeout_applies_from_the_next_set_point_on():
    stream, t = streaming(10)
    stream.timeout = 1.0
    assert t + 1.001 * TIMEOUT > stream.deadline
    stream.arrived(True, t)
    assert t + 0.5 <= stream.deadline
    assert t + 1.1 > stream.deadline


@settings(max_examples=60)
@given(st.lists(st.tuples(st.booleans(), st.sampled_from([0.0, 0.5, 1.0, 1.5])), max_size=30))
def test_only_the_set_points_at_the_end_count(events):
    """Timeout: the last five or more are set-points, each within the timeout of the previous."""
    stream, t = SetPointStream(TIMEOUT), 0.0
    in_a_row = 0
    for is_set_point, timeouts in events:
        t += timeouts * TIMEOUT
        stream.arrived(is_set_point, t)
        in_a_row = (in_a_row if timeouts <= 1.0 else 0) + 1 if is_set_point else 0
    assert (t + LONG_AFTER > stream.deadline) == (in_a_row >= 5)
    assert t <= stream.deadline
