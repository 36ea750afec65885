# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `simulated_arm`: simulates the motion under efforts, and publishes joint states."""

from collections.abc import Sequence

from geometry_msgs.msg import WrenchStamped
import numpy as np
from robot_dynamics.joints.effort_convention import ROBOT_COMPENSATIONS
from robot_dynamics.model.arm_parameters import arm_from_parameters, convention_from_parameters
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import describe_change
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import wrenches_from_ros
from robot_dynamics.ros.middleware.shutdown import leave
from robot_dynamics.ros.parameters import robot_description
from robot_dynamics.ros.parameters.declared_parameters import (
    DeclaredParameters,
    number,
    numbers,
    text,
    texts,
    Values,
)
from robot_dynamics.ros.parameters.node_arguments import NodeUsage
from robot_dynamics.ros.parameters.payloads import (
    changed_payloads,
    check_all,
    PAYLOAD_SPECS,
    payload_warnings,
    payloads_at_start,
)
from robot_dynamics.ros.running import run_node
from robot_dynamics.ros.simulated_arm import plant_node
from robot_dynamics.simulation.arm_simulation import ArmSimulation, DEFAULT_MAX_STEP
from robot_dynamics.simulation.drive_loop import drive_loop_from
from robot_dynamics.simulation.plant import InnerController, SimulatedRobot
from robot_dynamics.validation import check_scalar, check_vector
from robot_dynamics_interfaces.srv import SetPayload

DRIVE_LOOP_SPECS = (
    robot_description.DRIVE_STIFFNESS_SPEC,
    numbers('drive.damping', 0.0, 1e8, (
        'Damping k_d [N·m·s/rad] or [N·s/m] of the position loops of the drives; one value for '
        'all joints or one per joint. Expected with drive.stiffness.'), read_only=True),
    number('drive.stiffness_limit', 0.0, 0.0, 1e8, (
        'Largest drive.stiffness that the drives take; 0 for no limit.'), read_only=True),
    number('drive.damping_limit', 0.0, 0.0, 1e8, (
        'Largest drive.damping that the drives take; 0 for no limit.'), read_only=True),
    number('drive.effort_limit', 0.0, 0.0, 1e8, (
        'Largest effort [N·m] or [N] of a drive with a position loop; 0 for the effort limits of '
        'the URDF.'), read_only=True),
)

SPECS = (
    *robot_description.DESCRIPTION_SPECS,
    *robot_description.FRICTION_SPECS,
    *robot_description.ACTUATOR_SPECS,
    *robot_description.SIMULATED_ACTUATOR_SPECS,
    *robot_description.DRIVE_SPECS,
    *PAYLOAD_SPECS,
    robot_description.ROBOT_GRAVITY_SPEC,
    *plant_node.LOOP_SPECS,
    numbers('initial_position', -1e6, 1e6, (
        'Joint positions [rad] or [m] at start, one per joint. If empty, 0 or the position limit '
        'nearest to it.'), read_only=True),
    numbers('initial_velocity', -1e6, 1e6, (
        'Joint velocities [rad/s] or [m/s] at start, one per joint. If empty, 0.'),
        read_only=True),
    *plant_node.BRAKE_SPECS,
    robot_description.MEASURED_EFFORT_SPEC,
    texts('robot_compensates', (
        'Terms that the simulated arm adds automatically to the commanded effort, computed with '
        'its own model without payloads: gravity, friction.'),
        choices=ROBOT_COMPENSATIONS, read_only=True),
    text('encoders', 'joint', (
        'Side of the gear on which joint_states measures position and velocity if there is '
        'backlash: joint or motor.'), choices=('joint', 'motor'), read_only=True),
    *DRIVE_LOOP_SPECS,
    *plant_node.NOISE_SPECS,
    number('max_step', DEFAULT_MAX_STEP, 1e-6, 0.1, (
        'Longest integration step [s].'), read_only=True),
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
     ('dynamics/feed_forward', 'Subscribed instead of effort_command with drive.stiffness, '
      'sensor_msgs/msg/JointState: position, velocity and effort of each drive.'),
     ('~/external_wrench', 'Subscribed, geometry_msgs/msg/WrenchStamped: a wrench on the link '
      'frame_id, until the next message.'),
     ('joint_states', 'Published, sensor_msgs/msg/JointState: position, velocity and effort.'),
     ('/clock', 'Published, rosgraph_msgs/msg/Clock: simulated time, with lock_step or '
      'publish_clock.'),
     ('~/reset', 'Service, std_srvs/srv/Trigger: return the arm to its initial pose.'),
     ('~/set_payload', 'Service, robot_dynamics_interfaces/srv/SetPayload: set the load on a '
      'link.')))


class SimulatedArmNode(plant_node.PlantNode):
    """
    Connects parameters, topics and services to the simulation; computes nothing itself.

    Any executor may spin it; simulated time passes from the first spin on.
    """

    NAME = 'simulated_arm'

    def _set_up(self) -> None:
        self._settings = DeclaredParameters(self, SPECS, _check, self._apply)
        values = self._settings.values
        xml = robot_description.description_from_parameters(values) or default_arm_urdf()
        self._arm = arm_from_parameters(xml, values)
        robot_description.check_joint_count(self._arm)
        self._simulation = ArmSimulation(
            self._arm,
            values['initial_position'] or None, values['initial_velocity'] or None,
            values['max_step'])
        self._simulation.check_inertia()
        payloads = payloads_at_start(values)
        check_all(self._arm, payloads, values)
        self._simulation.set_payloads(payloads)
        plant = SimulatedRobot(
            self._simulation, InnerController(self._arm, convention_from_parameters(values)),
            values['brakes'], np.random.default_rng(values['seed']))
        plant.encoders_at_motor = values['encoders'] == 'motor'
        plant.drive_loop = drive_loop_from(self._arm, values)
        self.create_service(SetPayload, '~/set_payload', self._set_payload)
        self._begin(plant, self._arm.given_drive.limit, values)

    def _wrench(self, message: WrenchStamped) -> ExternalWrench:
        wrench, = wrenches_from_ros(self._arm, [message])
        return wrench

    def _set_payload(
        self, request: SetPayload.Request, response: SetPayload.Response,
    ) -> SetPayload.Response:
        seconds = check_scalar('transition_time', request.transition_time, minimum=0.0)
        before = self._simulation.payloads
        payloads = changed_payloads(self._arm, before, request.payload, self._settings.values)
        with self._lock:
            self._simulation.set_payloads(payloads, seconds)
        response.success = True
        response.message = describe_change(before, payloads)
        response.warnings = payload_warnings(self._arm, payloads, self._settings.values)
        return response


def _check(values: Values) -> None:
    check_vector('gravity', values['gravity'], 3, ('x', 'y', 'z'))
    convention_from_parameters(values)
    plant_node.check_pause(values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(SimulatedArmNode, USAGE, args)


if __name__ == '__main__':
    leave(main())
