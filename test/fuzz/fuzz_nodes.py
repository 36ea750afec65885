# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The interfaces of the real nodes as targets of the fuzz tests: services, topics, parameters, URDFs.

The nodes run in this process. The tests call the callbacks of rclpy directly, with messages that
were serialized and deserialized: a hundred thousand messages take minutes.
"""

from collections.abc import Callable, Mapping
from typing import Any

from fuzz_arms import ARMS, CROWD
from fuzz_law import check_finite, check_words, over_the_wire, RefusalError
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from robot_dynamics.control.controller import Controller
from robot_dynamics.model import arm_from_parameters, ArmModel
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.model_source import check_or_refuse
from robot_dynamics.ros.dynamics.node import DynamicsNode, options_from, SPECS
from robot_dynamics.ros.dynamics.payloads import PayloadKeeper
from robot_dynamics.ros.dynamics.services import DynamicsServices
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.parameters.declared_parameters import Values
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics_interfaces.srv import ForwardDynamics, InverseDynamics, ManipulatorEquation
from sensor_msgs.msg import JointState
from std_msgs.msg import String

PLANAR_JOINTS = ('joint1', 'joint2')
# In another namespace and in lock-step, the arm waits for an effort and cannot affect the tests.
ARGUMENTS = (
    '-p', f'joints:=[{", ".join(PLANAR_JOINTS)}]', '-p', 'lock_step:=true',
    '-r', 'simulated_arm:__ns:=/apart', '-r', '__ns:=/fuzz')
AT_REST = tuple(  # the samples of a joint that is alive differ
    JointState(name=PLANAR_JOINTS, position=[0.1 + step, 0.2 + step], velocity=[0.0, 0.0])
    for step in (0.0, 1e-7))
DEFAULTS: Values = {
    spec.name: tuple(spec.default) if isinstance(spec.default, list) else spec.default
    for spec in SPECS}
SPEC = {spec.name: spec for spec in SPECS}


class _Services(GuardedCallbacks):
    NAME = 'services'


class RunningNodes:
    """Context manager: both nodes, and for each arm a node with the services."""

    def __enter__(self) -> 'RunningNodes':
        rclpy.init(args=['--ros-args', *ARGUMENTS])
        self.dynamics = DynamicsNode(parameter_overrides=[
            Parameter('state_timeout', value=60.0)])  # no fault on a slow machine
        self.simulated_arm = SimulatedArmNode()
        callback_of(self.dynamics, 'robot_description')(
            serialize_message(String(data=default_arm_urdf())))
        assert self.simulated_arm.get_parameter('lock_step').value
        assert self.simulated_arm.get_namespace() == '/apart'
        self._servers = dict[str, Node]()
        self._controllers = dict[str, Controller]()
        for arm in (*ARMS, CROWD):
            self._serve(arm.name, Controller(arm, options_from(DEFAULTS, arm)))
        return self

    def __exit__(self, *_: object) -> None:
        # One of the tried values may cause a ramp of a minute at the end.
        self.dynamics.set_parameters([
            Parameter('ramp_time', value=0.0), Parameter('effort_rate_limit', value=1e9)])
        for node in (self.dynamics, self.simulated_arm, *self._servers.values()):
            node.destroy_node()
        rclpy.shutdown()

    def _serve(self, name: str, controller: Controller) -> None:
        self._controllers[name] = controller
        if name not in self._servers:
            node = self._servers[name] = _Services(namespace=f'of_{name}')
            keeper = PayloadKeeper(node, lambda: DEFAULTS)
            DynamicsServices(node, keeper, lambda: self._controllers[name])

    # ------------------------------------------------------------------ services

    def ask_simulated_arm(self, request: Any) -> None:
        """Call the service of `simulated_arm` for a payload."""
        answer_of(self.simulated_arm, 'set_payload', request)

    def ask(self, service: str, arm: ArmModel, request: Any, server: str = '') -> None:
        """Call a service, by default for one of `ARMS`; raise RefusalError with its message."""
        response = answer_of(self._servers[server or arm.name], service, request)
        if hasattr(response, 'joint_names'):
            assert sorted(response.joint_names) == sorted(arm.joint_names)
        check_lengths(service, request, response, arm)

    # ------------------------------------------------------------------ topics

    def receive(self, topic: str, message: Any) -> None:
        """Pass a message to `dynamics`; raise RefusalError with the reported reason of a drop."""
        node = self.dynamics
        if topic == 'joint_trajectory':  # starts at the position of the arm, which has to be valid
            for state in AT_REST:
                self._deliver(serialize_message(state))
        counters = node._path.states
        answered, node._trajectories.refusal, counters.last_drop = node._path.loop.states, '', ''
        failures = counters.dropped['internal error']
        if topic == 'joint_states':
            self._deliver(serialize_message(message))
        else:
            callback_of(node, topic)(serialize_message(message), {})
        assert counters.dropped['internal error'] == failures, counters.last_drop
        words = node._trajectories.refusal if topic == 'joint_trajectory' else counters.last_drop
        if words:
            raise RefusalError(words)
        if topic == 'joint_states' and node._path.loop.states == answered:
            raise RefusalError('the state was ignored: it has other joints')

    def _deliver(self, state: bytes) -> None:
        with np.errstate(over='ignore', invalid='ignore'):  # as in the thread of the loop
            self.dynamics._loop._deliver(state)

    # ------------------------------------------------------------------ parameters and URDFs

    def set_parameters(self, node_name: str, parameters: list[Any]) -> None:
        """Set parameters one by one; raise RefusalError if none of them was accepted."""
        node = self.dynamics if node_name == 'dynamics' else self.simulated_arm
        request = over_the_wire(SetParameters.Request(parameters=parameters))
        response = over_the_wire(service_of(node, 'set_parameters').callback(
            request, SetParameters.Response()))
        assert len(response.results) == len(parameters)
        for parameter, result in zip(request.parameters, response.results):
            if not result.successful:
                check_words(result.reason)
                continue
            if parameter.name in SPEC:
                value = plain(node, parameter.name)
                check_finite(value, parameter.name)
                if node is self.dynamics:
                    assert node._settings.values[parameter.name] == value
        if parameters and not any(result.successful for result in response.results):
            raise RefusalError(response.results[0].reason)

    def start(self, xml: str, given: Mapping[str, Any]) -> None:
        """Process a URDF and its parameters as a node does, and compute each quantity once."""
        values = {**DEFAULTS, **{
            name: tuple(value) if isinstance(value, list) else value
            for name, value in given.items()}}
        for name in given:
            SPEC[name].check(values[name])
        arm = arm_from_parameters(xml, values)
        check_or_refuse(xml, arm, values, self.dynamics.get_logger())
        self._serve('any', Controller(arm, options_from(values, arm)))
        n = arm.joint_count
        motion = {'position': [0.3] * n, 'velocity': [0.1] * n}
        for service, request in (
                ('inverse_dynamics', InverseDynamics.Request(**motion, acceleration=[1.0] * n)),
                ('forward_dynamics', ForwardDynamics.Request(**motion, effort=[1.0] * n)),
                ('manipulator_equation', ManipulatorEquation.Request(**motion))):
            self.ask(service, arm, request, 'any')
        simulation = ArmSimulation(arm)
        simulation.check_inertia()
        simulation.release()
        check_finite(list(simulation.step(np.ones(n), 0.002)))


def plain(node: Node, name: str) -> Any:
    """Return the value of a parameter; an array as a tuple."""
    value = node.get_parameter(name).value
    return value if isinstance(value, (bool, int, float, str)) else tuple(value)


def service_of(node: Node, name: str) -> Any:
    return next(service for service in node.services if service.srv_name.endswith(f'/{name}'))


def callback_of(node: Node, topic: str) -> Callable[[Any], None]:
    callback: Callable[[Any], None] = next(
        subscription.callback for subscription in node.subscriptions
        if subscription.topic_name.endswith(f'/{topic}'))
    return callback


def answer_of(node: Node, name: str, request: Any) -> Any:
    """Return the response of a service as its client gets it; raise RefusalError if rejected."""
    service = service_of(node, name)
    response = over_the_wire(service.callback(over_the_wire(request), service.srv_type.Response()))
    if not response.success:
        refusal = service.srv_type.Response(message=response.message)
        assert response == refusal, 'fields of a rejection are filled in'
        raise RefusalError(response.message)
    check_finite(response, name)
    return response


def check_lengths(service: str, request: Any, response: Any, arm: ArmModel) -> None:
    """Check that a response has a number for each joint, sample and motor."""
    n = arm.joint_count
    motors = 0 if arm.actuators is None else n
    lengths: dict[str, dict[str, int]] = {
        'inverse_dynamics': {'effort': n, 'motor_current': motors, 'voltage_ratio': motors},
        'forward_dynamics': {'acceleration': n, 'motor_current': motors},
        'manipulator_equation': {
            'mass_matrix': n**2, 'gravity': n,
            'christoffel': n**3 if getattr(request, 'include_christoffel', False) else 0}}
    if service == 'inverse_dynamics_batch':
        lengths[service] = {'effort': len(request.position) // (len(request.joint_names) or n) * n}
    for field, length in lengths.get(service, {}).items():
        assert len(getattr(response, field)) == length, field
