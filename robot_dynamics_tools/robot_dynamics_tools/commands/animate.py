# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Draw an animation of a planar chain: links, forces and moments at the joints, energies, efforts.

At pauses of the motion it shows both passes of the Newton-Euler recursion. Without arguments: a
double pendulum that is lifted by its motors and released.

Exit status: 0 drawn; 1 the animation cannot be written; 2 a mistake in the arguments, or a file
that cannot be used.
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.tools import command_line
from robot_dynamics.validation import check_scalar
from robot_dynamics_tools import options
from robot_dynamics_tools.analysis.motion_filter import filter_motion_below
from robot_dynamics_tools.animation import arm_motion
from robot_dynamics_tools.animation.chain_animation import chain_frames, frame_count
from robot_dynamics_tools.animation.video import check_format, Frame, write_video
from robot_dynamics_tools.pictures.planar_view import PlanarView
from robot_dynamics_tools.recordings.joint_series import JointSeries
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.reporting.progress import Progress

SIMULATED_SPEED, RECORDED_SPEED = 0.5, 1.0
CUTOFF = 5.0
"""Cut-off frequency [Hz] of the filter of recorded motions."""
STILL = 0.1
"""Largest motion [rad] or [m] of a joint in a recording that is drawn as locked."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit status."""
    parser = command_line.Parser(prog='animate', description=__doc__)
    parser.add_argument(
        'bag', nargs='?', type=Path, metavar='BAG',
        help='Recording with joint states of the chain, drawn instead of a simulation')
    parser.add_argument(
        '--topic', metavar='NAME', help='Topic of the joint states in the recording')
    options.add_robot(
        parser, '--urdf', 'the description in the recording, or else the planar two-link arm',
        'FILE')
    parser.add_argument(
        '--joints', nargs='+', default=[], metavar='JOINT',
        help='Joints with parallel axes (default: all); the other joints are locked')
    parser.add_argument(
        '--from', **options.number(0.0, 'S', 'Start time in the recording [s]', dest='start'))
    parser.add_argument('--duration', **options.number(
        5.0, 'S', 'Duration of the motion [s]', options.number_in(0.1, 600.0)))
    parser.add_argument('--speed', **options.number(
        None, 'X', 'Playback speed as a multiple of real time (default: '
        f'{SIMULATED_SPEED:g}, for a recording {RECORDED_SPEED:g})',
        options.number_in(0.01, 100.0)))
    parser.add_argument('--rate', **options.number(
        12.0, 'HZ', 'Frame rate [Hz]', options.number_in(1.0, 50.0)))
    parser.add_argument('--stop', **options.number(
        None, 'S', 'Times of the pauses that show the passes of the recursion [s]; no pause '
        'without a value (default: one pause)', nargs='*'))
    options.add_output(parser, 'FILE', (
        'Output file: .gif, or .mp4 if ffmpeg is installed (default: out/<name of the arm>.gif)'))
    return options.run_tool(parser, _run, argv)


def _run(arguments: argparse.Namespace) -> int:
    duration, rate, recorded = arguments.duration, arguments.rate, arguments.bag is not None
    speed = arguments.speed or (RECORDED_SPEED if recorded else SIMULATED_SPEED)
    if arguments.topic is not None and not recorded:
        raise InvalidInputError(
            '--topic is given without a recording; it is a topic of the recording')
    stops = [0.6 * arm_motion.LIFT_FRACTION * duration] if arguments.stop is None else (
        arguments.stop)
    for stop in stops:
        check_scalar('--stop', stop, 0.0, duration)
    check_format(arguments.output or Path('arm.gif'))
    arm, series = _read_recording(arguments) if recorded else (
        arm_from_urdf(options.read_robot(arguments.urdf), arguments.joints), None)
    PlanarView(arm)  # before the work, because it may reject the arm
    output = arguments.output or options.default_output(arm.name, '.gif')
    command_line.prepare_file(output, arguments.force)
    if series is not None:
        motion = _recorded_motion(arm, series, arguments, duration, rate / speed)
    else:
        print(f'Simulating {duration:g} s of {arm.name} ...', flush=True)
        with Progress(duration, 's') as progress:
            motion = arm_motion.simulate_motion(arm, duration, rate / speed, progress.update)
    title = 'Double pendulum' if not recorded and arguments.urdf is None else motion.arm.name
    print(f'Drawing {len(motion.times)} instants of {arm.name} ...', flush=True)
    frames = chain_frames(motion, stops, speed, title)
    with (Progress(frame_count(motion, stops), 'frames') as progress,
            command_line.writing(output) as new):
        count = write_video(new, _counted(frames, progress))
    print(f'{output.resolve()}: {count} frames, {output.stat().st_size / 1e6:.2f} MB')
    return command_line.DONE


def _counted(frames: Iterable[Frame], progress: Progress) -> Iterator[Frame]:
    for frame in frames:
        progress.advance()
        yield frame


def _read_recording(arguments: argparse.Namespace) -> tuple[ArmModel, JointSeries]:
    with Recording(arguments.bag) as recording:
        topic = arguments.topic or recording.joint_state_topic()
        series = recording.joint_series(topic)
        recorded = recording.description() if arguments.urdf is None else None
    urdf = recorded or options.read_robot(arguments.urdf)
    return arm_from_urdf(urdf, arguments.joints), series


def _recorded_motion(
    arm: ArmModel, series: JointSeries, arguments: argparse.Namespace, duration: float,
    rate: float,
) -> arm_motion.ArmMotion:
    _check_joints(arm, series, arguments.bag)
    series = series.of_joints(arm.joint_names).unwrapped(arm.is_continuous)
    measured = filter_motion_below(series, CUTOFF)
    start = check_scalar('--from', arguments.start, 0.0, measured.times[-1])
    shown = (measured.times >= start) & (measured.times <= start + duration)
    motion = arm_motion.motion_of(
        arm, measured.times[shown] - start, *measured.state(shown),
        measured.effort[shown] if measured.effort is not None else None,
        np.ones(int(shown.sum()), dtype=bool))
    return motion.at(np.arange(0.0, motion.times[-1] + 0.5 / rate, 1.0 / rate))


def _check_joints(arm: ArmModel, series: JointSeries, path: Path) -> None:
    """Raise RecordingError if joints are missing, or if joints move that are drawn as locked."""
    missing = [name for name in arm.joint_names if name not in series.joint_names]
    if missing:
        raise RecordingError(
            f'recording {str(path)!r} has the joints {list(series.joint_names)}, expected '
            f'{missing} of {arm.name!r} too, or other names in --joints or another --urdf')
    if series.position is None:
        return  # locked joints cannot be checked
    for name, value in arm.locked_joints.items():
        if name in series.joint_names:
            away = np.abs(series.position[:, series.joint_names.index(name)] - value).max()
            if away > STILL:
                raise RecordingError(
                    f'recording {str(path)!r} moves the joint {name!r} up to {away:.2f} away '
                    f'from {value:g}, where it is locked: the animation would be wrong; '
                    'expected a joint at rest, or its name in --joints')
