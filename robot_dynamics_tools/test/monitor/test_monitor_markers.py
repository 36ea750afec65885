# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`~/markers` of a real node: positions, meaning, and no cost without subscribers."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from geometry_msgs.msg import WrenchStamped
from held_robot import HeldRobot, monitored
import numpy as np
import pytest
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics_tools.monitor.markers import drawn, LiveMarkers
from robot_dynamics_tools.pictures.arm_marks import ArmMarks
from ros_harness import Collector, RosClient, TIMEOUT, wait_until
from visualization_msgs.msg import Marker, MarkerArray
import yaml

Q = [0.7, 0.4]
BODY = ArmDynamics(load_arm(default_arm_urdf())).rigid_body
GRAVITY = BODY.gravity(np.array(Q))
ELBOW = [np.sin(0.7), 0.0, np.cos(0.7)]
TOOL = [np.sin(0.7) + 0.8 * np.sin(1.1), 0.0, np.cos(0.7) + 0.8 * np.cos(1.1)]
FORCE = np.array([15.0, 0.0, -25.0])
"""[N] on the tool, in the base frame."""
ROTATION = np.array([
    [np.cos(1.1), 0.0, np.sin(1.1)], [0.0, 1.0, 0.0], [-np.sin(1.1), 0.0, np.cos(1.1)]])
ZERO = np.zeros(3)


def stand_until(
    robot: HeldRobot, markers: Collector, fits: Callable[[dict[tuple[str, int], Any]], bool],
    effort: Sequence[float] = (),
) -> MarkerArray:
    """Send states with this effort until matching markers arrive; return them."""
    for _ in range(round(TIMEOUT / 0.1)):
        robot.say(effort=effort)
        found = markers.find(lambda m: fits(by_name(m)), timeout=0.1)
        if found is not None:
            return found
    raise AssertionError(f'no such markers; the last: {markers.messages[-1:]}')


def by_name(message: MarkerArray) -> dict[tuple[str, int], Any]:
    return {(marker.ns, marker.id): marker for marker in message.markers}


@pytest.fixture(scope='module', autouse=True)
def node() -> Iterator[None]:
    with monitored('/marked', {'external_effort_bandwidth': 50.0}):
        yield


@pytest.fixture(scope='module')
def robot(client: RosClient) -> HeldRobot:
    return HeldRobot(client, '/marked', True, position=Q)


def test_efforts_stand_at_the_joints_in_the_frame_of_the_base(client, robot):
    with client.collect(MarkerArray, '/marked/dynamics_monitor/markers') as markers:
        message = stand_until(robot, markers, bool)
    found = by_name(message)
    assert set(found) == {
        *((kind, i) for kind in ('effort', 'effort in numbers') for i in range(2)),
        *(('frame axes', i) for i in range(3)), ('manipulability', 0)}
    for marker in message.markers:
        assert marker.header.frame_id == 'base_link'
        assert stamp_from_ros(marker.header.stamp) > 1_000_000_000
        assert 0 < marker.lifetime.nanosec <= 500_000_000
        assert marker.color.a == (0.25 if marker.ns == 'manipulability' else 1.0)
        assert marker.action == Marker.ADD
    arc = np.array([[p.x, p.y, p.z] for p in found['effort', 1].points])[:-3]
    centre = np.array(ELBOW)
    radius = np.linalg.norm(arc[0] - centre)
    assert radius > 0.02
    np.testing.assert_allclose(np.linalg.norm(arc - centre, axis=1), radius)
    np.testing.assert_allclose(arc[:, 1], 0.0, atol=1e-12)  # about y
    for i in range(2):
        assert found['effort in numbers', i].text == f'{GRAVITY[i]:.1f} N·m'
    text = found['effort in numbers', 1].pose.position
    assert [text.x, text.z] == pytest.approx([ELBOW[0], ELBOW[2]])


def ends_of(arrow: Marker) -> np.ndarray:
    return np.array([[point.x, point.y, point.z] for point in arrow.points])


def test_a_push_is_drawn_as_its_published_wrench_at_the_chosen_link(client, robot):
    push = ExternalWrench('tool0', ROTATION.T @ FORCE, ZERO)
    external = -BODY.external(np.array(Q), [push])
    scale = {'force': 39.24, 'torque': 7.0632}  # half the weight; a twentieth of it at 1.8 m

    def settled(found: dict[tuple[str, int], Any]) -> bool:
        arrow = found.get(('external force', 0))
        return arrow is not None and np.linalg.norm(np.subtract(*ends_of(arrow))) > 0.65

    with client.collect(MarkerArray, '/marked/dynamics_monitor/markers') as markers, \
            client.collect(WrenchStamped, '/marked/dynamics_monitor/external_wrench') as wrenches:
        wrenches.wait_matched()
        message = stand_until(robot, markers, settled, (GRAVITY - external).tolist())
        stamp = message.markers[0].header.stamp
        wrench = wrenches.wait_for(lambda wrench: wrench.header.stamp == stamp)
    assert wrench.header.frame_id == 'tool0'
    found = by_name(message)
    for kind in ('force', 'torque'):
        start, end = ends_of(found[f'external {kind}', 0])
        vector = getattr(wrench.wrench, kind)
        np.testing.assert_allclose(
            (end - start) * scale[kind] / 1.8,
            ROTATION @ [vector.x, vector.y, vector.z], atol=1e-9)
        np.testing.assert_allclose(end if kind == 'force' else start, TOOL, atol=1e-9)
    assert {('external effort', 0), ('external effort', 1)} <= set(found)


def test_the_arrow_is_as_long_as_the_arm_at_half_of_its_weight():
    """The default arm weighs 78.48 N and reaches 1.8 m."""
    arm = load_arm(default_arm_urdf())
    for push, length in ((19.62, 0.9), (39.24, 1.8), (156.96, 1.8)):
        wrench = np.array([push, 0.0, 0.0, 0.0, 0.0, 0.0])
        found = by_name(drawn(ArmMarks(arm), arm, np.array(Q), GRAVITY, None, wrench))
        assert np.linalg.norm(np.subtract(*ends_of(found['external force', 0]))) == (
            pytest.approx(length))
    assert ('external torque', 0) not in found


def test_the_display_shows_all_that_is_drawn():
    arm = load_arm(default_arm_urdf()).with_payloads([make_payload('tool0', 1.0)])
    message = drawn(ArmMarks(arm), arm, np.array(Q), GRAVITY, np.array([3.0, 1.0]), np.ones(6))
    display = yaml.safe_load(
        (Path(__file__).parents[3] / 'rviz' / 'dynamics.rviz').read_text(encoding='utf-8'))
    shown = {entry['Name']: entry for entry in display['Visualization Manager']['Displays']}
    assert set(shown['Dynamics']['Namespaces']) == {marker.ns for marker in message.markers}
    assert shown['Dynamics']['Topic']['Value'] == '/dynamics_monitor/markers'
    assert shown['Dynamics']['Topic']['Durability Policy'] == 'Volatile'
    assert shown['Arm']['Description Topic']['Durability Policy'] == 'Transient Local'


def test_markers_are_off_without_subscribers(client):
    def timers() -> int:
        return len(list(client.node.timers))

    without = timers()
    markers = LiveMarkers(client.node)
    for _ in range(2):
        wait_until(lambda: not markers.is_on, 'markers that are off')
        wait_until(lambda: timers() == without, 'the end of the timer')
        with client.collect(MarkerArray, '/test_client/markers'):
            wait_until(lambda: markers.is_on, 'markers that are on')
            wait_until(lambda: timers() == without + 1, 'the timer')
