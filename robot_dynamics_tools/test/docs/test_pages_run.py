# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Pages from top to bottom: their files, their commands, and the expected results."""

from contextlib import ExitStack
from pathlib import Path
import re
import shutil
import signal
import subprocess

import children
from children import TIMEOUT
import numpy as np
from page_commands import (
    files_and_commands,
    final_errors,
    NO_STATUSES,
    NODES,
    output_of,
    printed_by,
    resolved,
    run_page,
    running_node,
    started_by,
)
import pytest
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.trajectories.files import read_trajectory
from robot_dynamics_tools.recordings.reader import Recording, stack
from robots import robot_path

ROOT = Path(__file__).parents[3]
LOCK_STEP = [
    '--ros-args', '-p', 'lock_step:=true', '-p', 'real_time_factor:=1.0', '-p', 'rate:=100.0']
"""So that errors do not depend on the load of the machine; the last four for the arm only."""
def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding='utf-8')


def quick_start() -> list[list[str]]:
    """Return the commands of README that need neither a clone nor ros2cli."""
    section = text_of('README.md').split('\n## Quick start\n')[1].split('\n## ')[0]
    _, commands = files_and_commands(section)
    return [command for command in commands if command[0] == 'ros2' and command[1] != 'service']


def interrupted(command: list[str], directory: Path) -> str:
    """Return the output of a command that Ctrl-C ends after its first line, with status 0."""
    with children.popen(
            resolved(command), cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, f'{command}:\n{first}{rest}'
    return first + rest


def test_each_motion_of_the_quick_start_ends_within_a_milliradian(tmp_path):
    printed: dict[str, str] = {}
    with ExitStack() as nodes:
        for command in quick_start():
            if command[1] == 'run':
                assert command[3] in NODES
                lock_step = LOCK_STEP[:7 if command[3] == 'simulated_arm' else 3]
                nodes.enter_context(running_node(command + lock_step, tmp_path))
            elif command[2] in ('watch', 'record'):
                printed[' '.join(command)] = interrupted(command, tmp_path)
            else:
                printed[' '.join(command)] = output_of(command, tmp_path)
    assert [command.split()[2] for command in printed] == [
        'status', 'move', 'watch', 'inverse', 'equation', 'payload', 'move', 'record']
    for command, out in printed.items():
        if command.split()[2] == 'move':
            errors = final_errors(out)
            assert len(errors) == 2, out
            assert max(map(abs, errors)) < 1e-3, f'{command}:\n{out}'
    with Recording(tmp_path / 'my_recording') as recording:
        assert not recording.notes


def relative_residuals(out: str) -> list[float]:
    """Return the column `relative` of the output of analyze [%]."""
    return [float(fraction) for fraction in re.findall(
        r'^joint\d +\S+ N·m +\S+ N·m +(\S+) %', out, re.MULTILINE)]


def table_headings(text: str) -> set[str]:
    """Return the heading of each table, with single spaces."""
    return {' '.join(line.split()) for line in re.findall(r'^joint .*', text, re.MULTILINE)}


def assert_the_demo_played_its_files(directory: Path) -> None:
    """Check the recording against the file of the trajectory, and that of the parameters."""
    names = ('joint1', 'joint2')
    planned = read_trajectory(directory / 'trajectory.yaml', names)
    with Recording(directory / 'recorded' / 'recording') as recording:
        states = recording.joint_series('/joint_states', names)
        (_, sent), = recording.messages('/dynamics/joint_trajectory')
        stamps, terms = stack(recording.messages('/dynamics/terms'), ['friction'])
    assert states.position[0] == pytest.approx(planned.points[0].position, abs=1e-4)  # noise
    assert [point.positions for point in sent.points] == [
        pytest.approx(point.position) for point in planned.points]
    # Two thirds of the friction are known to `dynamics`, all of it acts on the simulated arm.
    velocity = np.interp(stamps, states.stamps_ns, states.velocity[:, 0])
    fastest = int(np.argmax(np.abs(velocity)))  # of the recorded terms: some may be lost
    assert abs(terms['friction'][fastest, 0]) == pytest.approx(
        3.0 + 2.0 * abs(velocity[fastest]), rel=0.1)
    identified = read_parameter_file(directory / 'identified' / 'identified.yaml')
    assert identified['friction.viscous'][0] == pytest.approx(3.0, rel=0.15)


def test_the_tutorial(tmp_path):
    page = text_of('docs/tutorial.md')
    gains = 'gains.natural_frequency: [30.0]\n'
    assert gains in page
    page = page.replace(gains, f'{gains}    state_timeout: 60.0\n    state_max_age: 60.0\n')
    printed = [each for section in page.split('\n## ')  # each ends its nodes
               for each in run_page(section, tmp_path, NO_STATUSES, '-p', 'rate:=125.0')]
    assert table_headings(page) <= table_headings('\n'.join(out for _, out in printed))
    used = {started_by(command) for command in files_and_commands(page)[1]}
    assert used >= {
        'connect', 'excite', 'demo', 'analyze', 'identify', 'dynamics_node', 'simulated_arm'}
    connected = read_parameter_file(tmp_path / 'my_arm.yaml')
    assert connected['effort.report_scale'] == pytest.approx([2.0, 1.0], rel=0.05)
    assert_the_demo_played_its_files(tmp_path)
    analyze = 'ros2 dynamics analyze '
    before = relative_residuals(printed_by(printed, analyze, '--output before'))
    after = relative_residuals(printed_by(printed, analyze, '--no-report'))
    assert len(before) == 2
    assert min(before) > 10.0
    for left, there_was in zip(after, before, strict=True):
        assert left < 0.4 * there_was


@pytest.mark.soak
def test_the_arm_sags_at_the_start_and_holds_at_the_end(tmp_path):
    page = text_of('docs/gravity_calibration.md').split('\n## Before a real arm')[0]
    printed = run_page(page, tmp_path, {
        f'ros2 dynamics move {goal}': 1 for goal in ('1.0', '3.1416')})
    assert {started_by(command) for command in files_and_commands(page)[1]} >= {
        'calibrate_gravity', 'dynamics_node', 'simulated_arm'}
    before, *_, after = [
        final_errors(out) for command, out in printed if ' dynamics move ' in command]
    assert len(before) == len(after) == 2
    assert max(map(abs, before)) > 0.015
    assert max(map(abs, after)) < 0.005
    out = printed_by(printed, 'ros2 dynamics calibrate_gravity')
    table = out.split('Torque at the joint')[1].split('\n\n')[0]
    scales = [float(scale) for scale in re.findall(r'^joint\d +(\S+)', table, re.MULTILINE)]
    assert scales == pytest.approx([0.8, 1.2], rel=0.02)


@pytest.mark.soak
def test_the_panda_moves_and_touches_the_table(tmp_path):
    pytest.importorskip('mujoco')
    shutil.copy(robot_path('panda'), tmp_path / 'panda.urdf')
    page = text_of('docs/simulation.md').split('\n## An arm in MuJoCo\n')[1]
    printed = run_page(page, tmp_path, {'ros2 dynamics move 0.0 0.35': 1})
    moved, touched = [out for command, out in printed if ' dynamics move ' in command]
    assert len(final_errors(moved)) == len(final_errors(touched)) == 7
    assert max(map(abs, final_errors(moved))) < 0.04
    assert max(map(abs, final_errors(touched))) > 0.1  # the table is 4 cm above the goal
    assert ' not at the goal' in touched
