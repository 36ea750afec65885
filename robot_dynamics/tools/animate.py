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

"""
Draw a moving picture of a planar chain: forces, moments, energies, and the recursion at work.

Exit status: 0 drawn; 1 the picture cannot be written; 2 a mistake in the arguments, or a file that
cannot be used.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys

import numpy as np
from robot_dynamics.analysis.motion_filter import filter_motion_below
from robot_dynamics.animation.arm_motion import (
    ArmMotion,
    LIFT_FRACTION,
    motion_of,
    simulate_motion,
)
from robot_dynamics.animation.chain_animation import chain_frames
from robot_dynamics.animation.video import check_format, write_video
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.pictures.planar_view import PlanarView
from robot_dynamics.recordings.reader import JointSeries, Recording
from robot_dynamics.tools.command_line import DONE, Parser, read_robot, run_tool, writing
from robot_dynamics.validation import check_scalar

DEFAULT_DURATION = 5.0
LONGEST_DURATION = 600.0
DEFAULT_RATE = 12.0
SIMULATED_SPEED, RECORDED_SPEED = 0.5, 1.0
CUTOFF = 5.0
"""[Hz] of the filter of recorded motions."""
STILL = 0.1
"""[rad] or [m] that a joint may move in a recording and still be drawn as locked."""
ROBOT_DESCRIPTION = '/robot_description'


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool, and return its exit status."""
    arguments = _parser().parse_args(argv)
    return run_tool('animate', partial(_run, arguments))


def _parser() -> Parser:
    parser = Parser(
        prog='animate',
        description='Draw a moving picture of a planar chain: links, the force and the moment at '
                    'each joint,\nenergies and efforts by term, and, where the motion stops, both '
                    'passes of the Newton-Euler\nrecursion. Without arguments: a double pendulum, '
                    'lifted by its motors and let go of.',
        epilog='exit status: 0 drawn, 1 the picture cannot be written, 2 a mistake in the '
               'arguments, or a file\nthat cannot be used')
    parser.add_argument(
        'bag', nargs='?', type=Path, metavar='BAG',
        help='a recording with joint states of the chain, to be drawn instead of a simulation')
    parser.add_argument('--topic', metavar='NAME', help='of the joint states in the recording')
    parser.add_argument(
        '--urdf', metavar='FILE',
        help='the arm: a path, or package://PACKAGE/PATH (default: the description in the '
             'recording, else the planar two-link arm)')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='joints that turn about parallel axes (default: all); the rest is locked')
    parser.add_argument(
        '--from', type=float, default=0.0, metavar='S', dest='start',
        help='where in the recording to begin [s]')
    parser.add_argument(
        '--duration', type=float, default=DEFAULT_DURATION, metavar='S',
        help='of the motion [s] (default: %(default)g)')
    parser.add_argument(
        '--speed', type=float, metavar='X',
        help=f'how fast to show it (default: {SIMULATED_SPEED:g} times as fast as it is, a '
             f'recording {RECORDED_SPEED:g})')
    parser.add_argument(
        '--rate', type=float, default=DEFAULT_RATE, metavar='HZ',
        help='frames a second (default: %(default)g)')
    parser.add_argument(
        '--stop', type=float, nargs='*', metavar='S',
        help='when the passes of the recursion are shown [s]; none without a value (default: '
             'once)')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE',
        help='a .gif, or a .mp4 where there is ffmpeg (default: out/<name of the arm>.gif)')
    return parser


def _run(arguments: argparse.Namespace) -> int:
    duration = check_scalar('--duration', arguments.duration, 0.1, LONGEST_DURATION)
    rate = check_scalar('--rate', arguments.rate, 1.0, 50.0)
    recorded = arguments.bag is not None
    speed = arguments.speed if arguments.speed is not None else (
        RECORDED_SPEED if recorded else SIMULATED_SPEED)
    speed = check_scalar('--speed', speed, 0.01, 100.0)
    if arguments.topic is not None and not recorded:
        raise InvalidInputError('--topic is given without a recording, which has the topic')
    if arguments.output is not None:
        check_format(arguments.output)
    motion = _recorded_motion(arguments, duration, rate / speed) if recorded else (
        _simulated_motion(arguments, duration, rate / speed))
    stops = arguments.stop if arguments.stop is not None else [0.6 * LIFT_FRACTION * duration]
    for stop in stops:
        check_scalar('--stop', stop, 0.0, duration)
    title = 'Double pendulum' if not recorded and arguments.urdf is None else motion.arm.name
    output = arguments.output or Path('out', f'{motion.arm.name}.gif')
    frames = chain_frames(motion, stops, speed, title)
    with writing(output):
        output.parent.mkdir(parents=True, exist_ok=True)
        print(f'Drawing {len(motion.times)} instants of {motion.arm.name} ...', flush=True)
        count = write_video(output, frames)
    print(f'{output.resolve()}: {count} frames, {output.stat().st_size / 1e6:.2f} MB')
    return DONE


def _simulated_motion(arguments: argparse.Namespace, duration: float, rate: float) -> ArmMotion:
    arm = load_arm(read_robot(arguments.urdf), arguments.joints)
    PlanarView(arm)  # before the work, as it may refuse the arm
    return simulate_motion(arm, duration, rate)


def _recorded_motion(arguments: argparse.Namespace, duration: float, rate: float) -> ArmMotion:
    with Recording(arguments.bag) as recording:
        topic = arguments.topic or recording.joint_state_topic()
        series = recording.joint_series(topic)
        described = any(
            one.name == ROBOT_DESCRIPTION and one.message_count for one in recording.topics)
        if arguments.urdf is None and described:
            urdf = str(next(recording.messages(ROBOT_DESCRIPTION))[1].data)
        else:
            urdf = read_robot(arguments.urdf)
    arm = load_arm(urdf, arguments.joints)
    PlanarView(arm)
    _check_joints(arm, series, arguments.bag)
    series = series.of_joints(arm.joint_names).unwrapped(arm.is_continuous)
    measured = filter_motion_below(series, CUTOFF)
    last = measured.times[-1]
    start = check_scalar('--from', arguments.start, 0.0, last)
    shown = (measured.times >= start) & (measured.times <= start + duration)
    motion = motion_of(
        arm, measured.times[shown] - start, measured.position[shown], measured.velocity[shown],
        measured.acceleration[shown],
        None if measured.effort is None else measured.effort[shown],
        np.ones(int(shown.sum()), dtype=bool))
    return motion.at(np.arange(0.0, motion.times[-1] + 0.5 / rate, 1.0 / rate))


def _check_joints(arm: ArmModel, series: JointSeries, path: Path) -> None:
    """Raise RecordingError where joints are missing, or those move that the picture locks."""
    missing = [name for name in arm.joint_names if name not in series.joint_names]
    if missing:
        raise RecordingError(
            f'recording {str(path)!r} has the joints {list(series.joint_names)}, expected '
            f'{missing} of {arm.name!r} too, or other names in --joints or another --urdf')
    if series.position is None:
        return  # what is measured tells
    for name, value in arm.locked_joints.items():
        if name in series.joint_names:
            away = np.abs(series.position[:, series.joint_names.index(name)] - value).max()
            if away > STILL:
                raise RecordingError(
                    f'recording {str(path)!r} moves the joint {name!r} up to {away:.2f} away '
                    f'from {value:g}, where it is locked: the picture would be of another arm; '
                    'expected it to stand still, or to be among --joints')


if __name__ == '__main__':
    sys.exit(main())
