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

"""The closed loop: a simulated arm and `dynamics` as processes, a trajectory, a recording."""

from dataclasses import dataclass
from pathlib import Path
import re
import time
from typing import NamedTuple

from rclpy.qos import QoSProfile
from robot_dynamics.arm_model import ArmModel
from robot_dynamics.reference_motion import ReferenceMotion
from robot_dynamics.ros.conversions import stamp_to_ros, trajectory_to_ros
from robot_dynamics.simulation import ArmSimulation
from robot_dynamics.tools.demo_nodes import DemoError, DYNAMICS, NodeProcess, SIMULATED_ARM, VIEWER
from robot_dynamics.tools.demo_progress import Progress
from robot_dynamics.tools.demo_session import (
    CLOCK,
    COMPUTED_TORQUE,
    DESCRIPTION,
    DRAIN_PERIOD,
    EFFORT_COMMAND,
    JOINT_STATES,
    recording_session,
    Session,
    START_TIMEOUT,
    TOPICS,
    TRAJECTORY,
)
from robot_dynamics.tools.viewer import AT, PAGE_OPEN
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

LEAD_TIME = 0.3
"""[s] from the newest state to the start of the motion."""
STATE_TIMEOUT = 1.0
"""[s] without a state that is a fault: a simulated arm falls on nobody, and machines are busy."""
STEP_BY_STEP = {'lock_step': True, 'real_time_factor': 1.0}
"""How the arm moves beside a browser, which may draw in software: then it moves slowly."""
HOLD_TIME = 0.3
"""[s] that is recorded after the motion."""


class Page(NamedTuple):
    """The viewer beside the loop: its port, and the file of the URDF, whose meshes it finds."""

    port: int
    robot: str | None


@dataclass
class LoopRun:
    """What was done; `start_ns` is the stamp at which the motion starts, 0 before it is sent."""

    motion: ReferenceMotion
    rate: float
    start_ns: int = 0
    lost: int = 0
    interrupted: bool = False

    @property
    def end_ns(self) -> int:
        return self.start_ns + round(1e9 * self.motion.trajectory.duration)


def run_closed_loop(
    arm: ArmModel, urdf: str, motion: ReferenceMotion, rate: float, directory: Path,
    parameters: Path | None = None, page: Page | None = None,
) -> LoopRun:
    """
    Let the arm follow a motion at `rate` [Hz], and record it in `directory`.

    Both nodes read the file `parameters` too, where there is one. An interrupt ends it early,
    with what there is. With a `page` the motion waits until that is open, and after it the loop
    goes on until an interrupt. Raises DemoError where the loop does not close, ModelError where
    the arm cannot be simulated.
    """
    ArmSimulation(arm).check_inertia()  # before any process is started
    run = LoopRun(motion, rate)
    print(f'Starting dynamics_node and simulated_arm ({arm.name}, {arm.joint_count} joints, '
          f'{rate:g} Hz) ...', flush=True)
    description = str((directory / DESCRIPTION).resolve())
    try:
        with recording_session(directory, urdf, (*TOPICS, CLOCK)) as session:
            session.nodes.start(
                'dynamics', DYNAMICS,
                {'robot_description_file': description, 'state_timeout': STATE_TIMEOUT},
                parameters)
            # In time of its own, a pause of the machine delays the motion and does not cut it.
            session.nodes.start('simulated_arm', SIMULATED_ARM, {
                'robot_description_file': description, 'rate': rate,
                **({'publish_clock': True} if page is None else STEP_BY_STEP),
                'initial_position': run.motion.start.tolist()}, parameters)
            try:
                if page is not None:
                    _open_page(session, page)
                _close_the_loop(session, run)
                _follow(session, run)
                if page is not None:
                    _go_on(session)
            finally:
                run.lost = sum(count.lost for count in session.recorder.counts.values())
    except KeyboardInterrupt:
        run.interrupted = True
    return run


def _open_page(session: Session, page: Page) -> None:
    """Start the viewer, tell its address, and record until a browser has the page."""
    viewer = session.nodes.start('viewer', VIEWER, {}, arguments=(
        '--port', str(page.port), *(() if page.robot is None else ('--robot', page.robot))))
    session.wait_for(lambda: _address(viewer) is not None, 'the page of the viewer')
    print(f'\n  Open {_address(viewer)} in a browser: the motion begins when the page is there.\n',
          flush=True)
    while PAGE_OPEN not in viewer.text():
        session.record(DRAIN_PERIOD)


def _address(viewer: NodeProcess) -> str | None:
    found = re.search(rf'^{AT} (\S+)', viewer.text(), re.MULTILINE)
    return None if found is None else found[1]


def _go_on(session: Session) -> None:
    """Record until an interrupt, which ends this alone."""
    print('\n  The arm is yours: sliders, loads and pushes are on the page. Ctrl-C ends.\n',
          flush=True)
    try:
        while True:
            session.record(DRAIN_PERIOD)
    except KeyboardInterrupt:
        print(flush=True)


def _close_the_loop(session: Session, run: LoopRun) -> None:
    counts = session.recorder.counts
    publisher = session.node.create_publisher(
        JointTrajectoryMsg, TRAJECTORY, QoSProfile(depth=1))
    session.wait_for(
        lambda: counts[EFFORT_COMMAND].received > 0, 'an effort on effort_command')
    session.wait_for(
        lambda: counts[JOINT_STATES].received > 0, 'a state on joint_states')
    session.wait_for(
        lambda: bool(publisher.get_subscription_count() >= 2),  # dynamics, and the recorder
        f'a subscriber of {TRAJECTORY}')
    message = trajectory_to_ros(run.motion.trajectory)
    session.recorder.drain()
    run.start_ns = counts[JOINT_STATES].stamp_ns + round(1e9 * LEAD_TIME)
    message.header.stamp = stamp_to_ros(run.start_ns)
    publisher.publish(message)
    session.wait_for(
        lambda: counts[COMPUTED_TORQUE].received > 0, f'an effort on {COMPUTED_TORQUE}')


def _follow(session: Session, run: LoopRun) -> None:
    """Record until the motion is over and held for a moment."""
    duration = run.motion.trajectory.duration
    print(f'Following a trajectory of {duration:g} s ...', flush=True)
    counts = session.recorder.counts
    efforts, newest = 0, time.monotonic()
    with Progress(duration, 's') as progress:
        while counts[JOINT_STATES].stamp_ns < run.end_ns + round(1e9 * HOLD_TIME):
            session.record(DRAIN_PERIOD)
            progress.update(1e-9 * (counts[JOINT_STATES].stamp_ns - run.start_ns))
            if counts[EFFORT_COMMAND].received > efforts:
                efforts, newest = counts[EFFORT_COMMAND].received, time.monotonic()
            elif time.monotonic() - newest > START_TIMEOUT:
                raise DemoError(
                    f'{START_TIMEOUT:g} s passed without an effort on effort_command.\n'
                    f'{session.nodes.logs()}')
