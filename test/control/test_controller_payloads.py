# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Payloads of the controller: at once, and with a transition."""

from controller_bench import gravity_with, LOAD, make_controller, NOW, Q, SECOND, update, ZERO
import pytest
from robot_dynamics.model.payload import Payload


def test_a_replaced_transition_continues_from_its_present_payload():
    controller = make_controller()
    done: list[tuple[Payload, ...]] = []
    controller.set_payloads([LOAD], 2.0, done.append)
    update(controller, NOW, Q, ZERO)
    midway = update(controller, NOW + SECOND, Q, ZERO).command
    controller.set_payloads([], 1.0, done.append)
    bare = gravity_with([])
    for seconds, expected in ((1.0, midway), (1.5, 0.5 * (midway + bare)), (2.0, bare)):
        output = update(controller, NOW + round(seconds * SECOND), Q, ZERO)
        assert output.command == pytest.approx(expected, abs=1e-9)
    assert output.command.tolist() == bare.tolist()
    assert done == [()]  # the first load was never completely active
