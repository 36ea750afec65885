# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `mujoco_arm`: an arm in MuJoCo with the interface of `simulated_arm`."""

from collections.abc import Sequence

from geometry_msgs.msg import WrenchStamped
import numpy as np
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.middleware.conversions import wrench_from_ros
from robot_dynamics.ros.middleware.shutdown import leave
from robot_dynamics.ros.parameters import declared_parameters
from robot_dynamics.ros.parameters.node_arguments import NodeUsage
from robot_dynamics.ros.running import run_node
from robot_dynamics.ros.simulated_arm import plant_node
from robot_dynamics.simulation.plant import SimulatedRobot
from robot_dynamics.urdf.description_file import description_path
from robot_dynamics_tools.mujoco import mujoco_simulation
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf

SPECS = (
    declared_parameters.text('mjcf', '', (
        'MJCF file of the arm and its surroundings: a path or package://PACKAGE/PATH. If empty, '
        'the planar two-link arm.'), read_only=True),
    declared_parameters.texts('mjcf_joints', (
        'Names in the MJCF of the joints that the efforts drive, in the order of all arrays. If '
        'empty, the names in joints; if these are empty too, the joints on which an actuator of '
        'the MJCF acts directly, or, without such actuators, all hinge and slide joints.'),
        read_only=True),
    declared_parameters.texts('joints', (
        'Names of the driven joints in joint_states and effort_command, as in the URDF of '
        'dynamics. If empty, the names in the MJCF.'), read_only=True),
    declared_parameters.numbers('gravity', -1000.0, 1000.0, (
        'Gravitational acceleration [m/s²]. If empty, that of the MJCF.')),
    *plant_node.LOOP_SPECS,
    declared_parameters.numbers('initial_position', -1e6, 1e6, (
        'Joint positions [rad] or [m] at start, one per driven joint. If empty, those of the '
        'first keyframe of the MJCF; without a keyframe, the reference pose or the position limit '
        'nearest to it.'), read_only=True),
    *plant_node.BRAKE_SPECS,
    *plant_node.NOISE_SPECS,
)

USAGE = NodeUsage(
    'mujoco_arm', 'mujoco_arm',
    'Simulates the arm of an MJCF in MuJoCo, with contacts: integrates its motion under the '
    'received efforts, and publishes its joint states.',
    (('', 'Simulate the planar two-link arm; dynamics_node without arguments commands it.'),
     ('--ros-args -p mjcf:=panda.xml -p lock_step:=true',
      'Simulate the arm in panda.xml, as fast as the commands arrive.')),
    SPECS,
    ('mjcf', 'mjcf_joints', 'joints', 'rate', 'lock_step', 'initial_position', 'brakes',
     'command_timeout', 'clip_efforts'),
    (('effort_command', 'Subscribed, sensor_msgs/msg/JointState: the effort [N·m] or [N] at each '
      'joint, by joint name.'),
     ('~/external_wrench', 'Subscribed, geometry_msgs/msg/WrenchStamped: a wrench on the body '
      'frame_id, until the next message.'),
     ('joint_states', 'Published, sensor_msgs/msg/JointState: position, velocity and effort of '
      'the driven joints.'),
     ('/clock', 'Published, rosgraph_msgs/msg/Clock: simulated time, with lock_step or '
      'publish_clock.'),
     ('~/reset', 'Service, std_srvs/srv/Trigger: return the arm and all bodies to the start.')))


class MujocoArmNode(plant_node.PlantNode):
    """
    Connects parameters, topics and services to MuJoCo; computes nothing itself.

    Any executor may spin it; simulated time passes from the first spin on.
    """

    NAME = 'mujoco_arm'

    def _set_up(self) -> None:
        values = declared_parameters.DeclaredParameters(self, SPECS, _check, self._apply).values
        if values['mjcf']:
            model = mujoco_simulation.load_mjcf(description_path(values['mjcf'], 'mjcf'))
        else:
            model = mujoco_simulation.model_of_mjcf(arm_to_mjcf(load_arm(default_arm_urdf())))
        self._simulation = mujoco_simulation.MujocoSimulation(
            model, values['mjcf_joints'] or values['joints'], values['joints'],
            values['initial_position'] or None)
        arm = self._simulation.arm
        plant = SimulatedRobot(
            self._simulation, mujoco_simulation.DirectDrives(len(arm.joint_names)),
            values['brakes'], np.random.default_rng(values['seed']))
        self._begin(plant, arm.effort_limit, values)

    def _wrench(self, message: WrenchStamped) -> ExternalWrench:
        self._simulation.check_body(message.header.frame_id, 'header.frame_id')
        return wrench_from_ros(message, '')


def _check(values: declared_parameters.Values) -> None:
    if len(values['gravity']) not in (0, 3):
        raise InvalidInputError(
            f'gravity has {len(values["gravity"])} values, expected 3: x, y, z; or none')
    plant_node.check_pause(values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(MujocoArmNode, USAGE, args)


if __name__ == '__main__':
    leave(main())
