# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Playback of a recording to `dynamics`, and comparison of the played states with the model."""

from pathlib import Path
import time

from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
from robot_dynamics_tools.demo.session import DESCRIPTION, Session
from robot_dynamics_tools.processes import DYNAMICS, NodeError
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.messages import FIELDS, joint_state_messages
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.reporting.progress import Progress
from sensor_msgs.msg import JointState

RESEND_PERIOD = 0.5
"""[s] after which a state is retransmitted: subscriptions to joint states are best effort."""
MOST_RESENT = 20
"""Transmissions without a response after which the playback ends."""


def read_recording(
    path: Path, topic: str | None, seconds: float | None,
) -> tuple[JointSeries, str | None]:
    """Return all joints of a topic, and the URDF in the recording; raise RecordingError."""
    print(f'Reading {path} ...', flush=True)
    with Recording(path) as recording:
        name = topic or recording.joint_state_topic()
        series = recording.joint_series(name)
        urdf = recording.description()
        for line in recording.notes:
            print(f'  {line}')
    for line in series.faults.words():
        print(f'  {line}')
    if seconds is not None:
        series = series.first(seconds)
    measured = ' and '.join(
        field for field in FIELDS if getattr(series, field) is not None)
    print(f'  {name}: {len(series.stamps_ns)} states of {len(series.joint_names)} joints, '
          f'{series.times[-1]:.2f} s, with {measured or "nothing"}'
          + (f'; {series.passed_over} messages skipped' if series.passed_over else ''))
    return series, urdf


def play_recording(
    recorded: JointSeries, urdf: str, rate: float | None, directory: Path,
) -> AnalysisSettings:
    """
    Play the recorded states to the node with their recorded stamps, and record all topics.

    `rate` [Hz] is the largest one (None: as fast as the node responds). Returns the settings for
    the analysis of this recording. Raises RobotDynamicsError if arm and recording do not match,
    NodeError if a state gets no response, or the node ends.
    """
    arm = _recorded_arm(urdf, recorded)
    joints = list(arm.joint_names)
    series = recorded.of_joints(arm.joint_names)
    print(f'Starting dynamics_node ({arm.name}, {arm.joint_count} joints) ...', flush=True)
    stamps, played, resent = series.stamps_ns.tolist(), 0, 0
    messages = joint_state_messages(
        series.stamps_ns, series.joint_names, series.position, series.velocity, series.effort)
    with Session(directory, urdf, time_ns=lambda: int(stamps[max(played - 1, 0)])) as session:
        session.processes.start('dynamics', DYNAMICS, {
            'robot_description_file': str((directory / DESCRIPTION).resolve()),
            'joints': joints,
            'command': 'gravity_compensation',  # a recorded arm cannot be held
            'state_max_age': 0.0,  # a recording may have any age
            'measured_effort': 'none'})  # no command of this node held the recorded arm
        publisher = session.node.create_publisher(
            JointState, Session.JOINT_STATES, QoSProfile(depth=1))
        session.wait_for(
            lambda: bool(publisher.get_subscription_count() >= 2),  # dynamics, and the recorder
            f'a subscriber of {Session.JOINT_STATES}')
        print('Playing the recorded states, each after the response to the state before ...',
              flush=True)
        start = time.monotonic()
        with Progress(len(stamps), 'states') as progress:
            for stamp, state in zip(stamps, messages):
                if rate is not None:
                    _receive_until(session, start + played / rate)
                resent += _ask(session, publisher, stamp, state)
                played += 1
                progress.update(played)
        seconds = time.monotonic() - start
        lost = sum(count.lost for count in session.recorder.counts.values())
    print(f'\n{played} states played in {seconds:.1f} s, all answered ({resent} retransmitted); '
          f'{lost} messages dropped by the recorder\n')
    return AnalysisSettings(urdf, Session.JOINT_STATES, parameters={'joints': joints})


def _receive_until(session: Session, deadline: float, stamp: int | None = None) -> bool:
    """Record until the deadline; return early and True at the answer with this stamp."""
    while (remaining := deadline - time.monotonic()) > 0.0:
        session.recorder.wait(Session.GRAVITY, remaining)
        session.on_turn()
        if session.recorder.counts[Session.GRAVITY].stamp_ns == stamp:
            return True
    return False


def _ask(session: Session, publisher: Publisher, stamp: int, state: bytes) -> int:
    """Publish a state until it is answered; return the number of retransmissions."""
    for resent in range(MOST_RESENT):
        publisher.publish(state)
        if _receive_until(session, time.monotonic() + RESEND_PERIOD, stamp):
            return resent
    raise NodeError(
        f'the state of stamp {stamp} ns got no answer on {Session.GRAVITY} in '
        f'{MOST_RESENT * RESEND_PERIOD:g} s.\n{session.processes.logs()}')


def _recorded_arm(urdf: str, series: JointSeries) -> ArmModel:
    """Return the arm with those of its joints that were recorded; the others are locked."""
    arm = arm_from_urdf(urdf)
    joints = [name for name in arm.joint_names if name in series.joint_names]
    if not joints:
        raise InvalidInputError(
            f'the recording has the joints {list(series.joint_names)}, but the arm '
            f'{arm.name!r} has {list(arm.joint_names)}: give its description with --robot')
    return arm if len(joints) == arm.joint_count else arm_from_urdf(urdf, joints)
