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

"""The reference of `dynamics`: followed, stopped, interrupted by faults, and resumed."""

from collections.abc import Callable
import time

from robot_dynamics.control.controller import Controller
from robot_dynamics.control.setpoint_stream import SetPointStream
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.ros.dynamics.control_counters import ControlCounters
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory


class References:
    """Starts and ends the reference of a controller; stores the reason of an early end."""

    def __init__(
        self, counters: ControlCounters, obstacle: Callable[[], str],
        is_faulty: Callable[[], bool],
    ) -> None:
        """
        Serve no arm yet.

        `obstacle` returns the reason why no reference can be followed now, empty if one can;
        `is_faulty` returns whether the reason is a fault.
        """
        self.controller: Controller | None = None
        """The controller of the arm that is served."""
        self.stream = SetPointStream()
        self._counters, self._obstacle, self._is_faulty = counters, obstacle, is_faulty
        self._was_interrupted = False

    def follow(self, trajectory: JointTrajectory, stamp_ns: int) -> None:
        """Follow a trajectory; raise RobotDynamicsError if it cannot be followed."""
        controller = self.controller
        if controller is None:
            raise InvalidInputError('no model yet: no trajectory can be followed')
        self._check_follows()
        controller.follow(trajectory, stamp_ns)
        try:
            self._check_follows()
        except TrajectoryError:  # a fault began during the planning
            controller.forget_reference()
            raise
        self._was_interrupted = False
        self.stream.arrived(trajectory.is_set_point, time.monotonic())
        self._counters.interruption = ''

    def _check_follows(self) -> None:
        obstacle = self._obstacle()
        if obstacle:
            raise TrajectoryError(f'no reference can be followed now: {obstacle}')

    def stop(self) -> str:
        """Stop along the reference, or from the measured state, and hold; return a report."""
        controller, obstacle = self.controller, self._obstacle()
        if controller is not None and obstacle and self._is_faulty():
            self._was_interrupted = True
            return f'the arm will stop and hold its position after the {obstacle}'
        if controller is None or obstacle:
            return f'nothing to stop: {obstacle or "no model yet"}'
        self.stream.end()
        report = controller.stop()
        self._counters.interruption = '~/stop was called'
        return report

    def end_stream(self) -> None:
        """Stop on the path, because the stream of set-points has paused for too long."""
        self.stream.end()
        if self.controller is not None:
            self.controller.stop_on_path()
        self._counters.paused_streams += 1
        self._counters.interruption = (
            'the stream of set-points paused for more than reference_timeout')

    def note_lost(self, reason: str) -> None:
        """Store the reason why the present reference ends, if there is one."""
        if self.controller is not None and self.controller.has_reference:
            self._counters.interruption = reason

    def interrupt(self, reason: str, resumes: bool = True) -> None:
        """End the reference; the next command starts from the measured state, if it `resumes`."""
        if self.controller is None:
            return
        if self.controller.has_reference:
            self._was_interrupted = True
            self._counters.interruption = reason
        self._was_interrupted = self._was_interrupted and resumes
        self.controller.forget_reference()
        self.stream.end()
        self._counters.following = False

    def resume(self) -> None:
        """Stop from the next measured state and hold, if a reference was interrupted."""
        if self.controller is not None and self._was_interrupted:
            self._was_interrupted = False
            self.controller.stop_from_state()
