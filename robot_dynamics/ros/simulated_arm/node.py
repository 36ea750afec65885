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

"""The node `simulated_arm`: simulates the motion under efforts, and publishes joint states."""

from collections.abc import Sequence
import threading
from typing import Any

from geometry_msgs.msg import WrenchStamped
import numpy as np
from rclpy.clock import Clock, ClockType
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.effort_convention import MEASURED_EFFORTS, ROBOT_COMPENSATIONS
from robot_dynamics.model.arm_parameters import arm_from_parameters, convention_from_parameters
from robot_dynamics.model.payload import describe_change
from robot_dynamics.ros.conversions import wrenches_from_ros
from robot_dynamics.ros.declared_parameters import DeclaredParameters, ParameterSpec, Type, Values
from robot_dynamics.ros.graph_watch import GraphWatch, LOOK_PERIOD
from robot_dynamics.ros.guarded_callbacks import (
    describe_error,
    destroyed_unless_made,
    GuardedCallbacks,
)
from robot_dynamics.ros.node_arguments import NodeUsage
from robot_dynamics.ros.payloads import changed_payloads, PAYLOAD_SPEC
from robot_dynamics.ros.robot_description import (
    ACTUATOR_SPECS,
    check_joint_count,
    description_from_parameters,
    DESCRIPTION_SPECS,
    DRIVE_SPECS,
    embedded_description,
    FRICTION_SPECS,
    ROBOT_GRAVITY_SPEC,
)
from robot_dynamics.ros.running import run_node
from robot_dynamics.ros.shutdown import leave
from robot_dynamics.ros.simulated_arm.loops import ArmTopics, LockStepLoop, WallTimeLoop
from robot_dynamics.simulation.arm_simulation import ArmSimulation, DEFAULT_MAX_STEP
from robot_dynamics.simulation.plant import InnerController, Plant
from robot_dynamics_interfaces.srv import SetPayload
from std_srvs.srv import Trigger

SPECS = (
    *DESCRIPTION_SPECS,
    *FRICTION_SPECS,
    *ACTUATOR_SPECS,
    *DRIVE_SPECS,
    PAYLOAD_SPEC,
    ROBOT_GRAVITY_SPEC,
    ParameterSpec(
        'rate', Type.DOUBLE, 500.0,
        'Rate [Hz] of the joint states. The effort is constant between two states.',
        read_only=True, minimum=1.0, maximum=10000.0),
    ParameterSpec(
        'lock_step', Type.BOOL, False,
        'Advance simulated time only when the effort with the stamp of the newest joint state '
        'arrives. Simulated time is published on /clock.', read_only=True),
    ParameterSpec(
        'real_time_factor', Type.DOUBLE, 0.0,
        'Upper limit of the speed of simulated time with lock_step, as a multiple of real '
        'time; 0 for no limit.',
        read_only=True, minimum=0.0, maximum=1e6),
    ParameterSpec(
        'publish_clock', Type.BOOL, False,
        'Count simulated time from 0 and publish it on /clock. With lock_step this is always '
        'the case.', read_only=True),
    ParameterSpec(
        'paused', Type.BOOL, False,
        'Stop simulated time and publish the same joint state every 0.1 s. Requires lock_step '
        'or publish_clock.'),
    ParameterSpec(
        'initial_position', Type.DOUBLE_ARRAY, [],
        'Joint positions [rad] or [m] at start, one per joint. If empty, 0 or the position '
        'limit nearest to it.',
        read_only=True, minimum=-1e6, maximum=1e6),
    ParameterSpec(
        'initial_velocity', Type.DOUBLE_ARRAY, [],
        'Joint velocities [rad/s] or [m/s] at start, one per joint. If empty, 0.',
        read_only=True, minimum=-1e6, maximum=1e6),
    ParameterSpec(
        'brakes', Type.BOOL, True,
        'Engage the brakes until the first effort arrives, and after command_timeout until '
        'the next effort. If false, the arm falls freely in these times.', read_only=True),
    ParameterSpec(
        'command_timeout', Type.DOUBLE, 0.2,
        'Time [s] without a valid effort after which the brakes engage until the next effort; '
        '0 disables this timeout. With lock_step, simulated time waits for the effort '
        'instead.', minimum=0.0, maximum=3600.0),
    ParameterSpec(
        'clip_efforts', Type.BOOL, True,
        'Clip each received effort to the effort limits of the URDF, as a drive does, and log '
        'a warning that names joint, value and limit. If false, any effort acts on the arm.'),
    ParameterSpec(
        'measured_effort', Type.STRING, 'joint_torque',
        'Meaning of the field effort in joint_states: joint_torque, '
        'joint_torque_without_gravity, motor_torque [N m] or motor_current [A] (the last two '
        'require actuator parameters), or none.', read_only=True, choices=MEASURED_EFFORTS),
    ParameterSpec(
        'robot_compensates', Type.STRING_ARRAY, [],
        'Terms that the simulated arm adds automatically to the commanded effort, computed '
        'with its own model without payloads: gravity, friction.',
        read_only=True, choices=ROBOT_COMPENSATIONS),
    ParameterSpec(
        'encoders', Type.STRING, 'joint',
        'Side of the gear on which joint_states measures position and velocity if there is '
        'backlash: joint or motor.', read_only=True, choices=('joint', 'motor')),
    ParameterSpec(
        'position_noise', Type.DOUBLE, 0.0,
        'Standard deviation [rad] or [m] of the noise on measured positions.',
        minimum=0.0, maximum=1.0),
    ParameterSpec(
        'velocity_noise', Type.DOUBLE, 0.0,
        'Standard deviation [rad/s] or [m/s] of the noise on measured velocities.',
        minimum=0.0, maximum=10.0),
    ParameterSpec(
        'effort_noise', Type.DOUBLE, 0.0,
        'Standard deviation of the noise on measured efforts, in the unit of measured_effort.',
        minimum=0.0, maximum=1e6),
    ParameterSpec(
        'seed', Type.INTEGER, 0,
        'Seed of the random number generator of the noise.', read_only=True,
        minimum=0, maximum=2**31 - 1),
    ParameterSpec(
        'max_step', Type.DOUBLE, DEFAULT_MAX_STEP,
        'Longest integration step [s].', read_only=True, minimum=1e-6, maximum=0.1),
)

USAGE = NodeUsage(
    'simulated_arm', 'simulated_arm',
    'Simulates the arm of a URDF: integrates its motion under the received efforts, and '
    'publishes its joint states. The brakes hold the arm until the first effort arrives.',
    (('', 'Simulate the planar two-link arm; dynamics_node without arguments commands it.'),
     ('--ros-args -p robot_description_file:=arm.urdf -p initial_position:="[0.5, 0.2]"',
      'Simulate the arm in arm.urdf, which starts at these joint positions.'),
     ('--ros-args -p lock_step:=true',
      'Simulate as fast as the commands arrive, in simulated time on /clock.')),
    SPECS,
    ('robot_description_file', 'joints', 'rate', 'lock_step', 'initial_position', 'brakes',
     'command_timeout', 'measured_effort', 'robot_compensates', 'position_noise'),
    (('effort_command', 'Subscribed, sensor_msgs/msg/JointState: the effort [N·m] or [N] at each '
      'joint, by joint name.'),
     ('~/external_wrench', 'Subscribed, geometry_msgs/msg/WrenchStamped: a wrench on the link '
      'frame_id, until the next message.'),
     ('joint_states', 'Published, sensor_msgs/msg/JointState: position, velocity and effort.'),
     ('/clock', 'Published, rosgraph_msgs/msg/Clock: simulated time, with lock_step or '
      'publish_clock.'),
     ('~/reset', 'Service, std_srvs/srv/Trigger: return the arm to its initial pose.'),
     ('~/set_payload', 'Service, robot_dynamics_interfaces/srv/SetPayload: set the load on a '
      'link.')))


class SimulatedArmNode(GuardedCallbacks):
    """
    Connects parameters, topics and services to the simulation; computes nothing itself.

    Any executor may spin it; simulated time passes from the first spin on.
    """

    def __init__(self, **node_arguments: Any) -> None:
        """
        Take the keyword arguments of rclpy's Node, such as `namespace` or `parameter_overrides`.

        Raises RobotDynamicsError if the parameters or the URDF are invalid.
        """
        super().__init__('simulated_arm', **node_arguments)
        with destroyed_unless_made(self):
            self._set_up()

    def _set_up(self) -> None:
        self._settings = DeclaredParameters(
            self, SPECS, _check, self._apply, _specs_of_dynamics)
        values = self._settings.values
        xml = description_from_parameters(values) or embedded_description()
        self._arm = arm_from_parameters(xml, values)
        check_joint_count(self._arm)
        simulation = ArmSimulation(
            self._arm,
            values['initial_position'] or None, values['initial_velocity'] or None,
            values['max_step'])
        simulation.check_inertia()
        self._lock = threading.Lock()
        self._loop: WallTimeLoop | LockStepLoop | None = None
        self._plant = Plant(
            simulation, InnerController(self._arm, convention_from_parameters(values)),
            values['brakes'], np.random.default_rng(values['seed']))
        self._plant.encoders_at_motor = values['encoders'] == 'motor'
        topics = ArmTopics(self, self._arm.joint_names, _has_own_time(values))
        loop_type = LockStepLoop if values['lock_step'] else WallTimeLoop
        self._loop = loop_type(self, self._plant, topics, self._lock, 1.0 / values['rate'])
        if isinstance(self._loop, LockStepLoop) and values['real_time_factor'] > 0.0:
            self._loop.real_time_factor = values['real_time_factor']
        self._apply(values)
        self.create_subscription(WrenchStamped, '~/external_wrench', self._on_wrench, 10)
        self.create_timer(
            LOOK_PERIOD, GraphWatch(
                self, {'joint_states': topics.topic}, 'Stop any publisher of joints of this arm.'
            ).look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(SetPayload, '~/set_payload', self._set_payload)
        self.get_logger().info(
            f'Model {self._arm.name!r}: joints {list(self._arm.joint_names)}')
        self.get_logger().info(
            f'Simulating at {values["rate"]:g} Hz on {topics.topic}. Until the first effort '
            f'arrives on {topics.efforts.topic_name}, {_before_efforts(values)}.')
        self.call_when_spun(self._loop.start)

    def request_shutdown(self) -> None:
        """Log that the node ends."""
        self.get_logger().info('Ending: the simulation stops.')

    def destroy_node(self) -> None:
        """Stop the simulation, then destroy the node."""
        loop = getattr(self, '_loop', None)
        if loop is not None:
            loop.stop()
        super().destroy_node()

    def _apply(self, values: Values) -> None:
        with self._lock:
            self._plant.commands.timeout = values['command_timeout']
            limit = self._arm.given_drive.limit
            self._plant.effort_limit = limit if values['clip_efforts'] else None
            self._plant.position_noise = values['position_noise']
            self._plant.velocity_noise = values['velocity_noise']
            self._plant.effort_noise = values['effort_noise']
            self._plant.set_gravity(np.array(values['gravity']))
        if self._loop is not None:
            self._loop.is_paused = values['paused']

    def _on_wrench(self, message: WrenchStamped) -> None:
        """Apply the wrench to its link from now on; zeros remove it."""
        try:
            wrench, = wrenches_from_ros(self._arm, [message])
        except Exception as error:  # an exception here would end the spin of rclpy
            self.get_logger().error(f'Rejected an external wrench: {describe_error(error)}')
            return
        with self._lock:
            self._plant.wrenches[wrench.link] = wrench

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._plant.reset()
        response.success, response.message = True, 'the arm is at its initial pose'
        return response

    def _set_payload(
        self, request: SetPayload.Request, response: SetPayload.Response,
    ) -> SetPayload.Response:
        try:
            before = self._plant.simulation.arm.payloads
            payloads = changed_payloads(
                self._arm, before, request.payload, self._settings.values)
            if request.transition_time != 0.0:
                raise InvalidInputError(
                    f'transition_time is {request.transition_time:g}, expected 0: the simulated '
                    'arm changes its load at once')
            with self._lock:
                self._plant.simulation.set_payloads(payloads)
        except Exception as error:  # an exception here would end the spin of rclpy
            response.success, response.message = False, describe_error(error)
            return response
        response.success = True
        response.message = describe_change(before, payloads)
        return response


def _check(values: Values) -> None:
    if len(values['gravity']) != 3:
        raise InvalidInputError(
            f'gravity has {len(values["gravity"])} values, expected 3: x, y, z')
    convention_from_parameters(values)
    if values['paused'] and not _has_own_time(values):
        raise InvalidInputError(
            'paused is true, expected false, or lock_step or publish_clock as well: the clock of '
            'the computer cannot be paused')


def _before_efforts(values: Values) -> str:
    if values['lock_step']:
        return 'simulated time waits (lock_step)'
    return 'the brakes hold the arm' if values['brakes'] else 'the arm falls freely (no brakes)'


def _specs_of_dynamics() -> Sequence[ParameterSpec]:
    from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
    return DYNAMICS_SPECS


def _has_own_time(values: Values) -> bool:
    return bool(values['publish_clock'] or values['lock_step'])


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(SimulatedArmNode, args, USAGE)


if __name__ == '__main__':
    leave(main())
