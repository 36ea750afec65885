# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The closed loop: a simulated arm and `dynamics` as processes, a trajectory, a recording."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import re
import time

from rclpy.qos import QoSProfile
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.middleware.conversions import stamp_to_ros, trajectory_to_ros
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics_tools import processes
from robot_dynamics_tools.demo.session import DESCRIPTION, Session
from robot_dynamics_tools.excitation.demo_motion import ReferenceMotion
from robot_dynamics_tools.recorder import TopicSpec
from robot_dynamics_tools.recordings.topics import TopicQos
from robot_dynamics_tools.reporting.progress import Progress
from robot_dynamics_tools.viewer.cli import AT, PAGE_OPEN
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

CLOCK = TopicSpec('/clock', Clock, qos=TopicQos(depth=10))
LEAD_TIME = 0.1
"""[s] of simulated time from the state at which the trajectory is sent to its start."""
STEP_BY_STEP = {'lock_step': True, 'real_time_factor': 1.0}
"""Default of the simulated arm: a slow machine makes the motion slow, not inaccurate."""
ANSWER_TIMEOUT = 10.0
"""[s] within which the answers to the last states arrive; there may be none after a fault."""
HOLD_TIME = 0.3
"""[s] of simulated time that is recorded after the motion."""


@dataclass
class LoopRun:
    """
    Result of one run; `start_ns` is the stamp at which the motion starts, 0 before it is sent.

    `received` and `lost` are the numbers of messages that the recorder has written and dropped.
    """

    motion: ReferenceMotion
    rate: float
    start_ns: int = 0
    received: int = 0
    lost: int = 0
    interrupted: bool = False

    @property
    def end_ns(self) -> int:
        return self.start_ns + round(1e9 * self.motion.trajectory.duration)


def run_closed_loop(
    arm: ArmModel, urdf: str, motion: ReferenceMotion, rate: float, directory: Path,
    parameters: Path | None = None, viewer: Sequence[str] | None = None,
) -> LoopRun:
    """
    Let the arm follow a motion at `rate` [Hz], and record it in `directory`.

    Both nodes also read the file `parameters`, if there is one. An interrupt ends the run early;
    the recording up to then is kept. Simulated time is paused until `dynamics` has the
    trajectory, so that the recording contains the motion and little else. With the arguments of a
    `viewer` the motion waits until its page is open, and the loop continues after the motion until
    an interrupt. Raises
    NodeError if the loop does not close, ModelError if the arm cannot be simulated.
    """
    ArmSimulation(arm).check_inertia()  # before any process is started
    run = LoopRun(motion, rate)
    print(f'Starting dynamics_node and simulated_arm ({arm.name}, {arm.joint_count} joints, '
          f'{rate:g} Hz) ...', flush=True)
    description = str((directory / DESCRIPTION).resolve())
    try:
        with Session(directory, urdf, [CLOCK]) as session:
            session.processes.start(
                'dynamics', processes.DYNAMICS,
                {'robot_description_file': description, 'lock_step': True},
                others=parameters)
            session.recorder.span_ns = (math.inf, math.inf)
            session.processes.start('simulated_arm', processes.SIMULATED_ARM, {
                'robot_description_file': description, 'rate': rate,
                'publish_clock': True, 'paused': viewer is None,
                'initial_position': run.motion.start.tolist()}, others=parameters,
                defaults=STEP_BY_STEP)
            try:
                if viewer is not None:
                    _open_page(session, viewer)
                _close_the_loop(session, run)
                _follow(session, run)
                if viewer is not None:
                    _go_on(session)
            finally:
                counts = session.recorder.counts.values()
                run.received = sum(count.recorded for count in counts)
                run.lost = sum(count.lost for count in counts)
    except KeyboardInterrupt:
        run.interrupted = True
    return run


def _open_page(session: Session, arguments: Sequence[str]) -> None:
    """Start viewer and monitor, print the address, and record until a browser opens the page."""
    session.processes.start('dynamics_monitor', processes.MONITOR, {})
    viewer = session.processes.start(
        'viewer', processes.VERBS, {}, arguments=('viewer', *arguments))
    session.wait_for(lambda: _address(viewer) is not None, 'the page of the viewer')
    print(f'\n  Open {_address(viewer)} in a browser: the motion begins when the page is open.\n',
          flush=True)
    while PAGE_OPEN not in viewer.text():
        session.record()


def _address(viewer: processes.NodeProcess) -> str | None:
    found = re.search(rf'^{AT} (\S+)', viewer.text(), re.MULTILINE)
    return None if found is None else found[1]


def _go_on(session: Session) -> None:
    """Record until an interrupt, which ends only the recording."""
    session.recorder.span_ns = (session.recorder.span_ns[0], math.inf)
    print('\n  Move the arm with the sliders, loads and pushes on the page. Ctrl-C ends.\n',
          flush=True)
    try:
        while True:
            session.record()
    except KeyboardInterrupt:
        print(flush=True)


def _close_the_loop(session: Session, run: LoopRun) -> None:
    counts = session.recorder.counts
    publisher = session.node.create_publisher(
        JointTrajectoryMsg, Session.TRAJECTORY, QoSProfile(depth=1))
    session.wait_for(
        lambda: counts[Session.EFFORT_COMMAND].received > 0, 'an effort on effort_command')
    session.wait_for(lambda: counts[Session.JOINT_STATES].received > 0, 'a state on joint_states')
    session.wait_for(
        lambda: bool(publisher.get_subscription_count() >= 2),  # dynamics, and the recorder
        f'a subscriber of {Session.TRAJECTORY}')
    message = trajectory_to_ros(run.motion.trajectory)
    session.set_parameter('paused', True, '/simulated_arm')
    states = counts[Session.JOINT_STATES]
    before = (states.received, states.stamp_ns)

    def is_repeated() -> bool:
        nonlocal before
        (received, stamp_ns), before = before, (states.received, states.stamp_ns)
        return states.received > received and states.stamp_ns == stamp_ns

    session.wait_for(is_repeated, 'a joint state that is published again')
    now_ns = states.stamp_ns
    run.start_ns = now_ns + round(1e9 * LEAD_TIME)
    message.header.stamp = stamp_to_ros(run.start_ns)
    publisher.publish(message)
    session.wait_for(
        lambda: counts[Session.COMPUTED_TORQUE].stamp_ns >= now_ns,
        f'an effort on {Session.COMPUTED_TORQUE}')
    session.recorder.span_ns = (now_ns + 1, run.end_ns + round(1e9 * HOLD_TIME))
    session.set_parameter('paused', False, '/simulated_arm')


def _follow(session: Session, run: LoopRun) -> None:
    """Record until shortly after the end of the motion."""
    duration = run.motion.trajectory.duration
    print(f'Following a trajectory of {duration:g} s ...', flush=True)
    counts, last_ns = session.recorder.counts, run.end_ns + round(1e9 * HOLD_TIME)
    states, commands, answers = (counts[topic] for topic in (
        Session.JOINT_STATES, Session.EFFORT_COMMAND, Session.COMPUTED_TORQUE))
    efforts, newest = 0, time.monotonic()
    with Progress(duration, 's') as progress:
        while states.stamp_ns < last_ns:
            session.record()
            progress.update(1e-9 * (states.stamp_ns - run.start_ns))
            if commands.received > efforts:
                efforts, newest = commands.received, time.monotonic()
            elif time.monotonic() - newest > session.timeout:
                raise processes.NodeError(
                    f'{session.timeout:g} s passed without an effort on effort_command.\n'
                    f'{session.processes.logs()}')
    # On a busy machine the efforts for the last states arrive later than these states.
    deadline = time.monotonic() + ANSWER_TIMEOUT
    while time.monotonic() < deadline and min(commands.stamp_ns, answers.stamp_ns) < last_ns:
        session.record()
