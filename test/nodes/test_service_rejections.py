# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Rejected requests to the services of `dynamics`, and the absence of side effects."""

import re
from typing import Any

import pytest
from ros_harness import DYNAMICS, NodeProcess, RosClient
from sensor_msgs.msg import JointState
from service_bench import Q, Served
from service_requests import REFUSALS, SERVICES


@pytest.mark.parametrize(('service', 'fields', 'words'), REFUSALS)
def test_a_request_that_cannot_be_answered_is_refused_by_name(
    planar: Served, service: str, fields: dict[str, Any], words: str,
) -> None:
    response = planar.ask(service, **fields)
    assert not response.success
    assert re.search(words, response.message), response.message
    empty = SERVICES[service].Response(success=False, message=response.message)
    assert response == empty  # no field is filled in


def test_the_control_path_continues_between_bad_requests(
    planar: Served, client: RosClient,
) -> None:
    states = client.publisher(JointState, '/planar/joint_states', 1)
    client.set_parameters('/planar/dynamics', {'command': 'gravity_compensation'})
    with client.collect(JointState, '/planar/effort_command') as efforts:
        efforts.wait_matched()
        for i, (service, fields, _) in enumerate(REFUSALS):
            state = JointState(name=planar.arm.joint_names, position=Q, velocity=[0.0, 0.0])
            state.header.stamp.sec = i + 1
            refused = planar.ask(service, **fields)
            assert not refused.success
            effort = client.answer_to(states, state, efforts)
            assert effort.effort == pytest.approx([-49.52282521, -11.37087883], abs=5e-9)
    client.node.destroy_publisher(states)


def test_before_the_model_every_service_reports_it(client: RosClient) -> None:
    with NodeProcess(DYNAMICS, {'joints': ['shoulder_pan_joint']}, namespace='/empty'):
        for service, kind in SERVICES.items():
            response = client.call(kind, f'/empty/dynamics/{service}')
            assert not response.success
            assert 'no model yet' in response.message
