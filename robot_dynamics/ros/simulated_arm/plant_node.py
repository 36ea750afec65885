# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The base class of `simulated_arm` and `mujoco_arm`: the node around a `SimulatedRobot`.

It has the topics, the loops in wall time and in lock-step, the brakes, and the services and
parameters of both nodes.
"""

from abc import abstractmethod
import threading

from geometry_msgs.msg import WrenchStamped
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.ros.middleware.graph_watch import GraphWatch, LOOK_PERIOD
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.parameters.declared_parameters import flag, number, Values
from robot_dynamics.ros.simulated_arm.loops import ArmTopics, LockStepLoop, WallTimeLoop
from robot_dynamics.simulation.plant import SimulatedRobot
from std_srvs.srv import Trigger

LOOP_SPECS = (
    number('rate', 500.0, 1.0, 10000.0, (
        'Rate [Hz] of the joint states. The effort is constant between two states.'),
        read_only=True),
    flag('lock_step', False, (
        'Advance simulated time only when the effort with the stamp of the newest joint state '
        'arrives. Simulated time is published on /clock.'), read_only=True),
    number('real_time_factor', 0.0, 0.0, 1e6, (
        'Upper limit of the speed of simulated time with lock_step, as a multiple of real time; 0 '
        'for no limit.'), read_only=True),
    flag('publish_clock', False, (
        'Count simulated time from 0 and publish it on /clock. With lock_step this is always the '
        'case.'), read_only=True),
    flag('paused', False, (
        'Stop simulated time and publish the same joint state every 0.1 s. Requires lock_step or '
        'publish_clock.')),
)
BRAKE_SPECS = (
    flag('brakes', True, (
        'Engage the brakes until the first effort arrives, and after command_timeout until the '
        'next effort. If false, the arm falls freely in these times.'), read_only=True),
    number('command_timeout', 0.2, 0.0, 3600.0, (
        'Time [s] without a valid effort after which the brakes engage until the next effort; 0 '
        'disables this timeout. With lock_step, simulated time waits for the effort instead.')),
    flag('clip_efforts', True, (
        'Clip each received effort to the effort limits of the model, as a drive does, and log a '
        'warning that names joint, value and limit. If false, any effort acts on the arm.')),
)
NOISE_SPECS = (
    number('position_noise', 0.0, 0.0, 1.0, (
        'Standard deviation [rad] or [m] of the noise on measured positions.')),
    number('velocity_noise', 0.0, 0.0, 10.0, (
        'Standard deviation [rad/s] or [m/s] of the noise on measured velocities.')),
    number('effort_noise', 0.0, 0.0, 1e6, (
        'Standard deviation of the noise on measured efforts, in the unit of measured_effort.')),
    number('seed', 0, 0, 2**31 - 1, (
        'Seed of the random number generator of the noise.'), read_only=True),
)


class PlantNode(GuardedCallbacks):
    """Connects parameters, topics and services to a plant; computes nothing itself."""

    _loop: WallTimeLoop | LockStepLoop | None = None

    def _begin(
        self, plant: SimulatedRobot, effort_limit: FloatArray | None, values: Values,
    ) -> None:
        """Simulate this plant from the first spin on; its drives clip efforts to limits (n,)."""
        self._lock, self._plant, self._effort_limit = threading.Lock(), plant, effort_limit
        arm = plant.simulation.arm
        topics = ArmTopics(
            self, arm.joint_names, _has_own_time(values), plant.drive_loop is not None)
        loop_type = LockStepLoop if values['lock_step'] else WallTimeLoop
        self._loop = loop_type(self, plant, topics, self._lock, 1.0 / values['rate'])
        if isinstance(self._loop, LockStepLoop) and values['real_time_factor'] > 0.0:
            self._loop.real_time_factor = values['real_time_factor']
        self._apply(values)
        self.create_subscription(WrenchStamped, '~/external_wrench', self._on_wrench, 10)
        self.create_timer(LOOK_PERIOD, GraphWatch(
            self, {'joint_states': topics.topic}, 'Stop any publisher of joints of this arm.'
        ).query)
        self.create_service(Trigger, '~/reset', self._reset)
        until = 'simulated time waits (lock_step)' if values['lock_step'] else (
            'the brakes hold the arm' if values['brakes'] else 'the arm falls freely (no brakes)')
        self.get_logger().info(f'Model {arm.name!r}: joints {list(arm.joint_names)}')
        self.get_logger().info(
            f'Simulating at {values["rate"]:g} Hz on {topics.topic}. Until the first '
            f'{"effort" if plant.drive_loop is None else "drive command"} arrives on '
            f'{topics.efforts.topic_name}, {until}.')
        self.call_when_spun(self._loop.start)

    def request_shutdown(self) -> None:
        """Log that the node ends."""
        self.get_logger().info('Ending: the simulation stops.')

    def destroy_node(self) -> None:
        """Stop the simulation, then destroy the node."""
        if self._loop is not None:
            self._loop.stop()
        super().destroy_node()

    def _apply(self, values: Values) -> None:
        plant = self._plant
        with self._lock:
            plant.commands.timeout = values['command_timeout']
            plant.effort_limit = self._effort_limit if values['clip_efforts'] else None
            plant.position_noise = values['position_noise']
            plant.velocity_noise = values['velocity_noise']
            plant.effort_noise = values['effort_noise']
            if values['gravity']:
                plant.set_gravity(np.array(values['gravity']))
        if self._loop is not None:
            self._loop.is_paused = values['paused']

    def _on_wrench(self, message: WrenchStamped) -> None:
        """Apply the wrench to its link from now on; zeros remove it."""
        wrench = self._wrench(message)
        with self._lock:
            self._plant.wrenches[wrench.link] = wrench

    @abstractmethod
    def _wrench(self, message: WrenchStamped) -> ExternalWrench:
        """Return the checked wrench of a message; raise RobotDynamicsError."""

    def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._plant.reset()
        response.success, response.message = True, 'the arm is at its initial pose'
        return response


def check_pause(values: Values) -> None:
    """Raise InvalidInputError if the clock cannot be paused."""
    if values['paused'] and not _has_own_time(values):
        raise InvalidInputError(
            'paused is true, expected false, or lock_step or publish_clock as well: the clock of '
            'the computer cannot be paused')


def _has_own_time(values: Values) -> bool:
    return bool(values['publish_clock'] or values['lock_step'])
