# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`dynamics_monitor` takes model, parameters and payloads from `dynamics`, and follows them."""

from collections.abc import Callable, Iterator
import math
from pathlib import Path
import re
from typing import Any

from closed_loop import NAMES, START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from disturbances import set_payload
from geometry_msgs.msg import Quaternion
from held_robot import HeldRobot, monitored
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import numpy as np
import pytest
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robot_dynamics.ros.parameters.declared_parameters import OF_TOOLS
from robot_dynamics_interfaces.srv import EstimatePayload
from robot_dynamics_tools.monitor.parameters import SPECS
from ros_harness import (
    DYNAMICS,
    log_of_failed_start,
    LONG,
    MONITOR,
    NO_SHARED_MEMORY,
    NodeProcess,
    RosClient,
    running,
    UNHURRIED,
    wait_until,
)
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

ARM = load_arm(default_arm_urdf())
G = ArmDynamics(ARM).rigid_body.gravity(np.array(START))
WAITING = re.compile('Waiting for the parameters of the node')


def status_of(message: DiagnosticArray, name: str) -> DiagnosticStatus | None:
    return next((one for one in message.status if one.name.endswith(name)), None)


def says(name: str, words: str) -> Callable[[DiagnosticArray], bool]:
    """Return whether a status with this name has these words."""
    def fits(message: DiagnosticArray) -> bool:
        status = status_of(message, name)
        return status is not None and words in status.message

    return fits


def external(
    client: RosClient, robot: HeldRobot, expected: Any, *, node: str,
    meanwhile: Callable[[], Any] = lambda: None,
) -> None:
    """Wait until the external effort is this one, of a robot that bears its own weight."""
    def said() -> bool:
        meanwhile()
        return bool(robot.say(5))

    with client.collect(JointState, f'{node}/external_effort') as efforts:
        efforts.wait_matched()
        wait_until(lambda: said() and bool(efforts.messages) and np.allclose(
            efforts.messages[-1].effort, expected, atol=0.05), f'{expected}', LONG)


def test_parameters_and_payloads_of_another_node_are_followed(client):
    """Effort calibration at the start; gravity, payloads and bandwidth as they change."""
    node = '/led/dynamics_monitor'
    with monitored('/led', {
            'joints': NAMES, 'effort.report_scale': [0.5], 'external_effort_bandwidth': 50.0}):
        robot = HeldRobot(client, '/led', True, position=START, effort=(2.0 * G).tolist())
        external(client, robot, [0.0, 0.0], node=node)
        client.set_parameters('/led/dynamics', {'gravity': [0.0, 0.0, -9.0]})
        external(client, robot, G * (9.0 / 9.81 - 1.0), node=node)
        client.set_parameters('/led/dynamics', {'gravity': [0.0, 0.0, -9.81]})
        load = make_payload('tool0', 1.5)
        set_payload(client, '/led/dynamics', load)
        set_payload(client, '/led/dynamics', make_payload('link1', 1.0))
        loads = [load, make_payload('link1', 1.0)]
        weight = ArmDynamics(ARM.with_payloads(loads)).rigid_body.gravity(np.array(START))
        external(client, robot, weight - G, node=node)
        set_payload(client, '/led/dynamics')
        external(client, robot, [0.0, 0.0], node=node)


def test_gravity_of_the_imu_is_that_of_the_monitor_too(client):
    """The base is tilted by 0.3 rad about y."""
    message = Imu(orientation=Quaternion(y=math.sin(0.15), w=math.cos(0.15)))
    gravity = 9.81 * np.array([math.sin(0.3), 0.0, -math.cos(0.3)])
    effort = ArmDynamics(ARM.with_gravity(gravity)).rigid_body.gravity(np.array(START))
    with monitored('/tilted', {
            'joints': NAMES, 'imu_rpy': [0.0, 0.0, 0.0], 'external_effort_bandwidth': 50.0}):
        robot = HeldRobot(client, '/tilted', True, position=START, effort=effort.tolist())
        imu = client.publisher(Imu, '/tilted/base_imu', 1, subscribers=2)
        external(  # a subscriber may not know this publisher yet, and drop its message
            client, robot, [0.0, 0.0], node='/tilted/dynamics_monitor',
            meanwhile=lambda: imu.publish(message))


def test_it_waits_for_its_node_and_takes_another_one_that_replaces_it(client):
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, \
            NodeProcess(MONITOR, {'dynamics': 'model'}, namespace='/late', ready=WAITING) as late:
        diagnostics.wait_for(says('/late/dynamics_monitor: dynamics', 'no node /late/model'), LONG)
        response = client.call(
            EstimatePayload, '/late/dynamics_monitor/estimate_payload',
            EstimatePayload.Request(start=True, link='tool0'))
        assert response.message == (
            'no model yet, expected a running node dynamics (parameter dynamics)')
        assert not client.call(Trigger, '/late/dynamics_monitor/zero_external_wrench').success
        first = NodeProcess(
            DYNAMICS, {**UNHURRIED, 'joints': NAMES}, namespace='/late', node_name='model',
            environment=NO_SHARED_MEMORY)
        first.start()
        late.wait_for_log(r"Model 'planar_arm': joints \['joint1', 'joint2'\]", LONG)
        diagnostics.wait_for(says('/late/dynamics_monitor: dynamics', 'follows /late/model'), LONG)
        first.kill()
        with NodeProcess(
                DYNAMICS, {**UNHURRIED, 'joints': ['joint2']}, namespace='/late',
                node_name='model'):
            late.wait_for_log(r"Model 'planar_arm': joints \['joint2'\]", LONG)
    client.forget('/late')


def test_a_description_that_dynamics_holds_back_is_not_used_yet(client):
    """Both nodes take it when the command has ended."""
    described, node = '/kept', '/kept/dynamics'
    process = NodeProcess(DYNAMICS, {
        **UNHURRIED, 'joints': NAMES, 'external_effort_bandwidth': 50.0}, namespace=described)
    with client.describing(described) as describe, running(process), \
            NodeProcess(MONITOR, namespace=described) as monitor:
        describe(default_arm_urdf())
        robot = HeldRobot(client, described, True, position=START, effort=G.tolist())
        external(client, robot, [0.0, 0.0], node=f'{described}/dynamics_monitor')
        describe(planar_arm_urdf(
            [5.0, 6.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], name='other_arm'))
        process.wait_for_log('Kept the model in use while commanding', LONG)
        external(client, robot, [0.0, 0.0], node=f'{described}/dynamics_monitor')
        assert "Model 'other_arm'" not in monitor.log
        assert client.call(ChangeState, f'{node}/change_state', ChangeState.Request(
            transition=Transition(id=Transition.TRANSITION_DEACTIVATE))).success
        monitor.wait_for_log("Model 'other_arm'", LONG)
        assert "Model 'other_arm'" in process.log


def test_an_unknown_link_and_a_model_that_is_not_here_are_reported(client):
    with client.collect(DiagnosticArray, '/diagnostics') as diagnostics, running(
            NodeProcess(DYNAMICS, {**UNHURRIED, 'joints': NAMES}, namespace='/wrong')), \
            NodeProcess(
                MONITOR, {'external_wrench.frame': 'hand'}, namespace='/wrong',
                ready=re.compile('No model: ')) as process:
        assert re.search(
            r"external_wrench.frame is 'hand', expected one of the links \['base_link', 'link1'",
            process.log)
        message = diagnostics.wait_for(says('/wrong/dynamics_monitor: model', "'hand'"), LONG)
        status = status_of(message, '/wrong/dynamics_monitor: model')
        assert status is not None
        assert status.level == DiagnosticStatus.ERROR


@pytest.mark.parametrize(('fields', 'words'), [
    ({}, 'no estimation is active, expected an earlier call with start'),
    ({'start': True, 'link': 'hand'}, "link is 'hand', expected one of the links"),
    ({'start': True, 'link': 'tool0', 'apply': True}, 'start is true together with apply or stop'),
    ({'apply': True, 'transition_time': -1.0}, 'transition_time is -1, expected'),
])
def test_bad_requests_are_rejected_by_name(client, asked, fields, words):
    response = client.call(
        EstimatePayload, f'{asked}/estimate_payload', EstimatePayload.Request(**fields))
    assert not response.success
    assert words in response.message


@pytest.fixture(scope='module')
def asked() -> Iterator[str]:
    """Run both nodes on one parameter file, which has parameters of either."""
    file = Path(__file__).parents[3] / 'config' / 'default_arm.yaml'
    with running(*(NodeProcess(
            node, {**UNHURRIED, 'residual_bandwidth': 5.0}, namespace='/asked',
            arguments=('--ros-args', '--params-file', str(file), '--'))
            for node in (DYNAMICS, MONITOR))):
        yield '/asked/dynamics_monitor'


def test_both_nodes_share_a_parameter_file(client, asked):
    assert {spec.name for spec in SPECS} <= OF_TOOLS
    assert client.get_parameter(asked, 'residual_bandwidth') == 5.0


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'dynamics': 'left dynamics'}, "dynamics is 'left dynamics', expected the name of a node"),
    ({'residual_band': 1.0}, "unknown parameter 'residual_band', probably 'residual_bandwidth'"),
    ({'residual_bandwidth': 0.0}, 'residual_bandwidth'),
])
def test_bad_parameters_end_the_start_in_one_line(parameters, words):
    assert words in log_of_failed_start(MONITOR, parameters)
