# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""When the reason is logged why a state of lock-step has no answer."""

from types import SimpleNamespace

from robot_dynamics.ros.simulated_arm import unanswered_state
from sensor_msgs.msg import JointState


def test_the_reason_is_logged_after_0_7_s_and_again_after_5_s(client, monkeypatch):
    now, logged = 100.0, list[str]()
    monkeypatch.setattr(unanswered_state, 'time', SimpleNamespace(monotonic=lambda: now))
    states = client.node.create_publisher(JointState, 'unanswered', 1)
    efforts = client.node.create_subscription(JointState, 'unanswered_effort', print, 1)
    watch = unanswered_state.UnansweredState(
        SimpleNamespace(get_logger=lambda: SimpleNamespace(warning=logged.append)),
        states, efforts)
    watch.begin(2_000_000, 0)
    for after, count in ((0.69, 0), (0.71, 1), (5.7, 1), (5.72, 2)):
        now = 100.0 + after
        watch.log_reason()
        assert len(logged) == count, after
    assert logged[0] == (
        'lock_step: no effort for the joint state of 0.002 s for 0.7 s: /unanswered has no '
        'subscriber, expected a controller such as dynamics')
