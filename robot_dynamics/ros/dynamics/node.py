# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The node `dynamics`: commands for joint states, and services of robot dynamics."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import math

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.feed_forward import FeedForward
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_parameters import convention_from_parameters
from robot_dynamics.ros.dynamics.base_gravity import BaseGravity, GRAVITY_RATE
from robot_dynamics.ros.dynamics.command_status import active_words, command_obstacle
from robot_dynamics.ros.dynamics.control_path import ControlPath
from robot_dynamics.ros.dynamics.drive_status import DriveStatus
from robot_dynamics.ros.dynamics.external_effort_fault import ExternalEffortFault
from robot_dynamics.ros.dynamics.goals.follow_joint_trajectory import FollowJointTrajectoryServer
from robot_dynamics.ros.dynamics.goals.law_topics import subscribe_laws
from robot_dynamics.ros.dynamics.goals.trajectory_input import TrajectoryInput
from robot_dynamics.ros.dynamics.model_source import ModelSource
from robot_dynamics.ros.dynamics.parameters import (
    effort_limits,
    options_from,
    safety_options,
    SPECS,
    state_timeout,
)
from robot_dynamics.ros.dynamics.payloads import PayloadKeeper
from robot_dynamics.ros.dynamics.served import ArmMessages, Served
from robot_dynamics.ros.dynamics.services import DynamicsServices
from robot_dynamics.ros.middleware.diagnostics import OK, publish_diagnostics, Status, WARN
from robot_dynamics.ros.middleware.graph_watch import GraphWatch
from robot_dynamics.ros.middleware.guarded_callbacks import describe_error, GuardedCallbacks
from robot_dynamics.ros.middleware.joint_state_loop import JointStateLoop
from robot_dynamics.ros.middleware.shutdown import leave
from robot_dynamics.ros.middleware.urgent_service import UrgentService
from robot_dynamics.ros.parameters.declared_parameters import DeclaredParameters, Values
from robot_dynamics.ros.parameters.node_arguments import NodeUsage
from robot_dynamics.ros.running import run_node
from robot_dynamics.validation import check_vector
from std_srvs.srv import Trigger

USAGE = NodeUsage(
    'dynamics_node', 'dynamics',
    'Gravity compensation, computed torque and dynamics services for the arm of a URDF. The node '
    'computes one command for each joint state that it receives, and publishes it unless '
    '`command` has the value none. By default it holds the arm from the first joint state on.',
    (('', 'Use the planar two-link arm, as simulated_arm does without arguments.'),
     ('--ros-args -p robot_description_file:=arm.urdf -p command:=none',
      'Use the arm in arm.urdf and publish no command: the first start with a robot.'),
     ('--ros-args --params-file arm.yaml -r joint_states:=/arm/joint_states',
      'Read the parameters from arm.yaml, and the joint states from another topic.')),
    SPECS,
    ('robot_description_file', 'joints', 'gravity', 'command', 'gains.natural_frequency',
     'gains.damping_ratio', 'effort_limit_fraction', 'measured_effort', 'robot_compensates',
     'fault_action', 'end_action', 'state_timeout', 'state_max_age', 'autostart'),
    (('joint_states', 'Subscribed, sensor_msgs/msg/JointState: measured positions, velocities '
      'and efforts, matched by joint name.'),
     ('robot_description', 'Subscribed, std_msgs/msg/String: the URDF, if neither '
      'robot_description nor robot_description_file is set.'),
     ('~/joint_trajectory', 'Subscribed, trajectory_msgs/msg/JointTrajectory: the trajectory to '
      'follow; one point is a set-point.'),
     ('~/set_point', 'Subscribed, sensor_msgs/msg/JointState: a set-point, such as the joint '
      'states of a leader arm.'),
     ('~/follow_joint_trajectory', 'Action, control_msgs/action/FollowJointTrajectory, if '
      'control_msgs is installed: a trajectory with tolerances and a result.'),
     ('effort_command, ~/commands', 'Published, sensor_msgs/msg/JointState and '
      'std_msgs/msg/Float64MultiArray: the command [N·m] or [N], by joint name, and in the order '
      'of joints.'),
     ('~/gravity_compensation, ~/computed_torque', 'Published, sensor_msgs/msg/JointState: the '
      'results of both control laws, also with `command: none`.'),
     ('/diagnostics', 'Published, diagnostic_msgs/msg/DiagnosticArray: joint states, command, '
      'faults, reference, payload and model.'),
     ('~/stop, ~/reset_fault', 'Services, std_srvs/srv/Trigger: stop the arm and hold its '
      'position; reset a latched fault.'),
     ('~/set_payload', 'Service, robot_dynamics_interfaces/srv/SetPayload: set the load on a '
      'link.')))


class DynamicsNode(GuardedCallbacks, LifecycleNode):
    """
    Connects parameters, topics and services to the library; computes nothing itself.

    Any executor may spin it; it processes joint states from the first spin on. `destroy_node`
    ends the command in order, if it is called before the context is shut down.
    """

    NAME = 'dynamics'
    _is_destroyed = False

    def _set_up(self) -> None:
        self._closers = closers = list[Callable[[], None]]()
        """End the command first, then the threads."""
        self._configuring_failed: Exception | None = None
        self._is_starting = False
        self._path = ControlPath(
            self, lambda: self._loop.publisher_count() > 1,
            publish_diagnostics(self, self._statuses))
        closers.append(self._path.command.close)
        self._settings = DeclaredParameters(self, SPECS, self._check, self._apply)
        self._payloads = PayloadKeeper(self, lambda: self._settings.values)
        self._gravity = BaseGravity(self, lambda: self._settings.values, self._use_gravity)
        self._graph = GraphWatch(
            self, self._path.command.topics, 'Stop all but one publisher of a command topic.')
        DynamicsServices(self, self._payloads, self._controller)
        self._models = ModelSource(
            self, lambda: self._settings.values, self._payloads,
            lambda: self._path.command.is_commanding, self._use_model)
        self.create_service(Trigger, '~/reset_fault', self._reset_fault)
        self._trajectories = TrajectoryInput(self, self._path)
        subscribe_laws(self, self._path, self._trajectories)
        self._action = FollowJointTrajectoryServer(self, self._path, self._trajectories)
        closers += [self._action.close, UrgentService(self, Trigger, '~/stop', self._stop).close]
        self._loop = JointStateLoop(self, self._path.on_state, self._path.refuse)
        closers.append(self._loop.stop)
        if self._settings.values['autostart']:
            self._is_starting = True
            self.trigger_configure()
            self._is_starting = False
            if self._configuring_failed is not None:
                raise self._configuring_failed
            self.trigger_activate()
        self.call_when_spun(self._loop.start)

    def request_shutdown(self) -> None:
        """Begin to stop the arm and end the command, also during a service; log it."""
        was_commanding = self._path.command.is_commanding
        self._path.command.request_shutdown()
        self.get_logger().info(
            'Ending: the arm stops, then the command ends.' if was_commanding else
            'Ending: no command was active.')

    @property
    def is_busy(self) -> bool:
        """Whether a client awaits the result of an action."""
        return self._action.is_busy

    def destroy_node(self) -> None:
        """End the command in order, stop the control path, and destroy the rest; once."""
        if self._is_destroyed:
            return
        self._is_destroyed = True
        for close in self._closers:
            close()
        super().destroy_node()

    # ------------------------------------------------------------------ lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the model; on failure, log the reason."""
        try:
            self._models.load()
        except Exception as error:  # rclpy would change to the state ErrorProcessing
            self._configuring_failed = error
            if not self._is_starting:
                self.get_logger().error(f'Not configured: {describe_error(error)}')
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish commands from the next joint state on."""
        self._path.command.activate()
        self.get_logger().info(active_words(
            self._settings.values['command'], self._loop.topic, self.get_name()))
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the command in order; services and the other topics stay available."""
        self._path.command.deactivate()
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the model; keep the payloads."""
        self._path.command.forget()
        self._models.forget()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the command in order and forget the model after an unexpected error."""
        self._path.command.deactivate()
        return self.on_cleanup(state)

    on_shutdown = on_deactivate

    def _reset_fault(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._path.command.reset()
        return response

    def _stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        loop = self._path.loop
        self._trajectories.stop()
        self._action.stop()
        response.success = True
        response.message = 'nothing to stop: no model yet' if loop is None else loop.stop()
        self.get_logger().info(f'~/stop: {response.message}')
        return response

    # ------------------------------------------------------------------ the model

    def _controller(self) -> Controller | None:
        """Return the controller of the arm that is served, None without a model."""
        loop = self._path.loop
        return None if loop is None else loop.controller

    def _use_model(self, arm: ArmModel, is_embedded: bool) -> None:
        values = self._settings.values
        self._payloads.check(arm)
        controller = Controller(arm, options_from(values, arm), lock=self._path.command.lock)
        if self._payloads.payloads:
            controller.set_payloads(self._payloads.payloads, 0.0, lambda _: None)
        if self._gravity.measured is not None:
            controller.set_gravity(self._gravity.measured, math.inf)
        convention = controller.options.effort_convention
        external = ExternalEffortFault(self, controller, convention, values)
        messages = ArmMessages(arm.joint_names, is_embedded)
        with self._path.command.lock:  # between two states: the loop continues the last one
            loop = ControlLoop(
                controller, effort_limits(values, arm), safety_options(values), self._path.loop)
            loop.gate.plausibility.max_age = values['state_max_age']
            drives = DriveStatus(
                self, loop, convention, self._path.command.has_listeners,
                self._path.has_position_drives)
            self._path.command.serve(Served(
                loop, values, drives, external, FeedForward(loop), messages))
        self._payloads.publish()
        self.get_logger().info(f'Model {arm.name!r}: joints {list(arm.joint_names)}')
        obstacle = command_obstacle(arm, values['command'])
        if obstacle:
            self.get_logger().error(f'Command: {obstacle}')
        for name, position in arm.locked_joints.items():
            self.get_logger().info(f'Joint {name!r} is locked at {position:g}')

    def _use_gravity(self, gravity: FloatArray) -> None:
        controller = self._controller()
        if controller is not None:
            controller.set_gravity(gravity, GRAVITY_RATE)

    # ------------------------------------------------------------------ parameters

    def _check(self, values: Values) -> None:
        check_vector('gravity', values['gravity'], 3, ('x', 'y', 'z'))
        if values['imu_rpy']:
            check_vector('imu_rpy', values['imu_rpy'], 3, ('roll', 'pitch', 'yaw'))
        convention_from_parameters(values)
        served = self._path.command.served
        if served is not None:
            options_from(values, served.arm)

    def _apply(self, values: Values) -> None:
        served = self._path.command.served
        if served is None:
            return
        arm, loop = served.arm, served.loop
        options, limits = options_from(values, arm), effort_limits(values, arm)
        with self._path.command.lock:  # between two states
            loop.set_options(options, limits, safety_options(values))
            loop.gate.plausibility.max_age = values['state_max_age']
            served.external.set_limits(values)
            self._path.command.served = replace(served, values=values)
        self._path.command.notify()
        self._gravity.take(values)

    # ------------------------------------------------------------------ diagnostics

    def _statuses(self) -> list[Status]:
        self._models.take_waiting()
        served = self._path.command.served
        remarks = self._models.differences
        return [
            *self._path.states.statuses(state_timeout(self._settings.values)),
            self._trajectories.status(),
            self._path.command.status(),
            self._graph.status(),
            self._payloads.status(),
            self._gravity.status(),
            Status(
                'model', WARN if served is None or remarks else OK, '; '.join([
                    'none yet' if served is None else served.arm.name, *remarks]),
                {'command': self._settings.values['command'],
                 'a new one waits': self._models.waiting is not None,
                 'callbacks that failed': self.callback_errors}),
            *([] if served is None else [served.external.status(), served.drives.status()])]


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(DynamicsNode, USAGE, args)


if __name__ == '__main__':
    leave(main())
