# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/task_space` and the derivatives of `~/inverse_dynamics` over DDS, against the library."""

from collections.abc import Iterator
from typing import Any

from geometry_msgs.msg import Point
import numpy as np
import pinocchio as pin
import pytest
from robot_dynamics.model import ArmDerivatives, make_payload
from robot_dynamics.ros.middleware.conversions import payload_to_ros, TASK_SPACE_ARRAYS
from robot_dynamics.task_space import TaskSpace, TaskSpaceState
from robots import robot_urdf
from ros_harness import RosClient
from service_bench import Q, Served, served

POINT = (0.1, -0.2, 0.05)
LINK = 'panda_hand'


@pytest.fixture(scope='module')
def panda(client: RosClient) -> Iterator[Served]:
    """Return a node on an arm with prismatic fingers, one of them a mimic joint."""
    with served(client, '/panda', robot_urdf('panda')) as node:
        yield node


def states_of(node: Served, count: int) -> tuple[Any, Any]:
    rng, n = np.random.default_rng(11), node.arm.joint_count
    q = rng.normal(size=(count, n))
    q[0] = 0.0  # singular
    return q, rng.normal(size=(count, n))


def assert_equal(response: Any, states: TaskSpaceState, columns: list[int]) -> None:
    """Compare a response with the library; `columns` are the arm's joints in its order."""
    samples, n = len(states.rank), len(columns)
    for name in TASK_SPACE_ARRAYS:
        np.testing.assert_allclose(
            getattr(response, name), getattr(states, name).ravel(), rtol=1e-9, atol=1e-9)
    assert list(response.rank) == states.rank.tolist()
    J = np.reshape(response.jacobian, (samples, 6, n))
    np.testing.assert_allclose(J, states.jacobian[:, :, columns], atol=1e-12)
    inverse = np.reshape(response.dynamic_inverse, (samples, n, 6))
    np.testing.assert_allclose(inverse, states.dynamic_inverse[:, columns], atol=1e-9)
    margin = np.reshape(response.position_margin, (samples, n))
    np.testing.assert_allclose(margin, states.position_margin[:, columns])
    for pose, place, rotation in zip(
            response.pose, states.translation, states.rotation, strict=True):
        p, o = pose.position, pose.orientation
        np.testing.assert_allclose((p.x, p.y, p.z), place, atol=1e-12)
        turned = pin.Quaternion(o.w, o.x, o.y, o.z).toRotationMatrix()
        np.testing.assert_allclose(turned, rotation, atol=1e-12)
    lost = np.reshape(response.lost_directions, (-1, 6))
    assert len(lost) == (6 - states.rank).sum()


@pytest.mark.parametrize('reference', ['', 'base_aligned', 'local'])
def test_the_response_is_that_of_the_library(panda, reference):
    q, v = states_of(panda, 4)
    x, y, z = POINT
    response = panda.answer(
        'task_space', frame=LINK, point=Point(x=x, y=y, z=z), reference=reference,
        position=q.ravel().tolist(), velocity=v.ravel().tolist())
    expected = TaskSpace(panda.arm, LINK, POINT, reference or 'base_aligned').batch(q, v)
    assert list(response.joint_names) == list(panda.arm.joint_names)
    assert_equal(response, expected, list(range(8)))
    assert any('position' in warning for warning in response.warnings)


def test_the_order_is_that_of_the_request(panda):
    q, v = states_of(panda, 3)
    names = panda.arm.joint_names[::-1]
    response = panda.answer(
        'task_space', frame=LINK, joint_names=names, position=q[:, ::-1].ravel().tolist(),
        velocity=v[:, ::-1].ravel().tolist())
    assert list(response.joint_names) == list(names)
    assert_equal(response, TaskSpace(panda.arm, LINK).batch(q, v), list(range(8))[::-1])


def test_a_payload_is_in_the_inertia(planar):
    load = make_payload('tool0', 2.0)
    planar.answer('set_payload', payload=payload_to_ros(load))
    response = planar.answer('task_space', frame='tool0', position=Q)
    planar.answer('set_payload')
    expected = TaskSpace(planar.arm.with_payloads([load]), 'tool0').at(Q)
    np.testing.assert_allclose(response.inertia, expected.inertia.ravel(), atol=1e-12)
    lost = np.reshape(response.lost_directions, (-1, 6))
    assert lost.shape == (4, 6)
    np.testing.assert_allclose(lost @ expected.jacobian, 0.0, atol=1e-12)


def test_ten_thousand_states_while_joint_states_are_answered(panda):
    q = np.random.default_rng(12).normal(size=(10_000, 8))
    response = panda.answer_while_streaming(
        [0.01] * 8, 'task_space', frame=LINK, position=q.ravel().tolist())
    assert len(response.inertia) == 36 * 10_000
    assert np.isfinite(response.inertia).all()


def test_derivatives_on_request(panda):
    rng, n = np.random.default_rng(13), 8
    q, v, a = rng.normal(size=(3, n))
    names = panda.arm.joint_names[::-1]
    fields = {'joint_names': names, 'position': q[::-1].tolist(), 'velocity': v[::-1].tolist(),
              'acceleration': a[::-1].tolist()}
    without = panda.answer('inverse_dynamics', **fields)
    response = panda.answer('inverse_dynamics', include_derivatives=True, **fields)
    by = ArmDerivatives(panda.arm).inverse_dynamics(q, v, a)
    for name in ('position', 'velocity', 'acceleration'):
        given = np.reshape(getattr(response, f'effort_{name}_derivative'), (n, n))
        np.testing.assert_allclose(given, getattr(by, name)[::-1, ::-1], atol=1e-9)
        assert not len(getattr(without, f'effort_{name}_derivative'))
    assert list(response.effort) == list(without.effort)
