# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics`: the output of its verbs for real nodes, and their error messages."""

from collections.abc import Iterator
import json
from pathlib import Path
import re
import sys

import children
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.derivatives import ArmDerivatives
from robot_dynamics.task_space import TaskSpace
from robot_dynamics.trajectories import (
    efforts_along,
    make_trajectory,
    read_trajectory,
    retime,
    write_trajectory,
)
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robot_dynamics_tools.__main__ import main as program
from robot_dynamics_tools.reporting.text_table import text_table
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values
from robot_dynamics_tools.ros2_dynamics.tools import TOOLS
from robot_dynamics_tools.ros2_dynamics.verbs import main, VERBS
from ros_harness import (
    DYNAMICS,
    MONITOR,
    NodeProcess,
    running,
    SIMULATED_ARM,
    TIMEOUT,
    UNHURRIED,
    wait_until,
)
from simulated_arms import default_dynamics
from verb_bench import assert_refused

START = '; a restart begins with no payload'
COMPLETE = """
import os
import sys
import argcomplete
from robot_dynamics_tools.ros2_dynamics.verbs import make_parser
os.environ.update(_ARGCOMPLETE='1', _ARGCOMPLETE_IFS='\\n', _ARGCOMPLETE_SUPPRESS_SPACE='1')
for line in sys.argv[1:]:
    os.environ.update(COMP_LINE=line, COMP_POINT=str(len(line)))
    print(end='\\0', flush=True)
    try:
        argcomplete.CompletionFinder()(
            make_parser(), exit_method=sys.exit, output_stream=sys.stdout)
    except SystemExit:
        pass
"""
OFFERED = {
    'dynamics ': {*VERBS, *TOOLS},
    'dynamics inverse --node /lift/dynamics rail=1 ': {'elbow='},
    'dynamics record --node /lift/dynamics /lift/dynamics/com': {
        '/lift/dynamics/commands', '/lift/dynamics/computed_torque'},
    'dynamics payload --node /lift/dynamics ': {'base', 'carriage', 'arm'},
    'dynamics inverse 1 2 --node ': {'/dynamics', '/lift/dynamics'}}
"""What is completed, by the line that is typed."""
LIFT = """
<robot name="lift">
  <link name="base"/>
  <link name="carriage"><inertial><mass value="3"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><mass value="1"/><origin xyz="0.2 0 0"/>
    <inertia ixx="0.01" iyy="0.01" izz="-0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1" effort="200" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="carriage"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0.5" velocity="1"/></joint>
</robot>"""
"""One joint slides; one turns, and is too weak for its arm, which has no possible inertia."""
Q, V, A = [0.785398, 0.523599], [0.5, 0.3], [0.1, 0.2]
DYNAMICS_OF = default_dynamics()
ARM = DYNAMICS_OF.arm


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, UNHURRIED), NodeProcess(SIMULATED_ARM, {'rate': 50.0}),
            NodeProcess(MONITOR),
            NodeProcess(
                DYNAMICS, {
                    'robot_description': LIFT, 'ignore_checks': ['inertia'],
                    'uncertainty.parameters': ['m(carriage)'], 'uncertainty.covariance': [0.25]},
                namespace='/lift')):
        yield


@pytest.fixture(scope='module')
def lift() -> Iterator[DynamicsClient]:
    with DynamicsClient('/lift/dynamics', TIMEOUT) as client:
        yield client


# --- arguments -----------------------------------------------------------------------------------

@pytest.mark.parametrize(('typed', 'values'), [
    ('0.1 -0.2', [0.1, -0.2]), ('b=1e-3 a=-2', [-2.0, 1e-3])])
def test_joint_values(typed, values):
    assert joint_values('position', typed.split(), ['a', 'b']) == values
    assert joint_values('position', ['b=3'], ['a', 'b'], 0.0) == [0.0, 3.0]  # the rest


@pytest.mark.parametrize(('typed', 'words'), [
    ('0.1', 'position has 1 value, expected 2: a, b'),
    ('a=1', 'position leaves out b, expected every joint: a, b'),
    ('a=1 c=2', "position has joint 'c', expected one of: a, b"),
    ('a=1 a=2', "position has joint 'a' twice"),
    ('a=1 2', "position has '2' and 'a=1', expected only numbers, or NAME=NUMBER"),
    ('a=nan b=1', "position of a is 'nan', expected a number"),
])
def test_what_is_typed_wrong_is_reported_with_the_names(typed, words):
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        joint_values('position', typed.split(), ['a', 'b'])


def test_numbers_line_up_at_the_right_and_text_at_the_left():
    assert text_table(['joint', 'effort'], [['a', 1.5], ['elbow', -22.25], ['c', 1e-17]]) == (
        'joint    effort\n'
        'a        1.5000\n'
        'elbow  -22.2500\n'
        'c        0.0000')


# --- results -------------------------------------------------------------------------------------

def test_inverse_is_that_of_the_library(ask):
    terms = DYNAMICS_OF.terms(np.array(Q), np.array(V), np.array(A))
    status, out, _ = ask('inverse', *Q, '-v', *V, '-a', *A, '--json')
    answer = json.loads(out)
    assert status == 0
    assert answer['effort'] == pytest.approx(terms.effort)
    for name in ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort'):
        assert answer['terms'][name] == pytest.approx(getattr(terms, name))
    assert answer['kinetic_energy'] == pytest.approx(terms.kinetic_energy)
    named = [f'joint2={Q[1]}', f'joint1={Q[0]}']
    again = json.loads(ask(
        'inverse', *named, '-v', 'joint2=0.3', 'joint1=0.5', '-a', *A, '--json')[1])
    assert again == answer
    negative = json.loads(ask('inverse', '-1e-3', '-.5', '-a', '-2.', '-3E+0', '--json')[1])
    assert (negative['position'], negative['acceleration']) == ([-1e-3, -0.5], [-2.0, -3.0])


def test_tables_have_units(ask, lift):
    out = ask('inverse', *Q, '--velocity', *V)[1]
    assert 'Effort by term [N·m]' in out
    assert re.search(r'joint1 .* -49\.7568\n', out)
    assert 'Standard deviation' not in out
    status, out, _ = ask('inverse', 'rail=0.5', 'elbow=-0.5', client=lift)
    assert status == 0
    assert 'Effort by term [N·m, N]' in out
    assert re.search(r'rail +prismatic .* 39\.2400\n', out)
    # 0.5 kg at the acceleration of gravity
    assert re.search(r'joint  kind +deviation \[N·m, N\]\nrail +prismatic +4\.9050\n', out)
    assert 'Warning: ' in out  # the elbow cannot deliver the effort
    out = ask('inverse', 'rail=0.5', 'elbow=-0.5', '--json', client=lift)[1]
    assert json.loads(out)['effort_deviation'] == pytest.approx([4.905, 0.0])


def test_equation_is_that_of_the_library(ask):
    body, q, v = DYNAMICS_OF.rigid_body, np.array(Q), np.array(V)
    _, out, _ = ask('equation', *Q, '-v', *V, '--christoffel', '--json')
    answer = json.loads(out)
    np.testing.assert_allclose(answer['mass_matrix'], body.mass_matrix(q), atol=1e-12)
    np.testing.assert_allclose(answer['coriolis_matrix'], body.coriolis_matrix(q, v), atol=1e-12)
    np.testing.assert_allclose(answer['gravity'], body.gravity(q), atol=1e-12)
    np.testing.assert_allclose(answer['christoffel'], body.christoffel_symbols(q), atol=1e-12)
    out = ask('equation', *Q, '-v', *V, '-c')[1]
    assert 'Mass matrix M(q) [kg·m²]\n        joint1  joint2\njoint1  6.9585  1.5692\n' in out
    assert 'joint1  joint1  joint2  -0.6000' in out


def test_a_payload_is_shown_put_on_and_taken_away(ask):
    def gravity() -> float:
        return float(json.loads(ask('inverse', '1.0', '0', '--json')[1])['effort'][0])

    assert 'no payload' in ask('payload')[1]
    without = gravity()
    status, out, _ = ask('payload', 'tool0', '2.5', '--com', '0', '0', '0.1')
    assert (status, out) == (0, f"/dynamics: 2.5 kg on 'tool0'{START}\n")
    assert gravity() == pytest.approx(without - 2.5 * 9.81 * 1.9 * np.sin(1.0))
    assert ask('payload', 'link2', '2')[1] == (
        f"/dynamics: 2.5 kg on 'tool0', 2 kg on 'link2'{START}\n")
    assert ask('payload', 'link2', '1')[1] == (
        f"/dynamics: 2.5 kg on 'tool0', 1 kg on 'link2' (replaces 2 kg on 'link2'){START}\n")
    assert "payload  2.5 kg on 'tool0', centre of mass (0, 0, 0.1) m; 1 kg on 'link2'" in (
        ask('status')[1])
    status = json.loads(ask('status', '--json')[1])
    assert [(one['link'], one['mass']) for one in status['payloads']] == [
        ('tool0', 2.5), ('link2', 1.0)]
    assert ask('payload', 'tool0', '0')[1] == f"/dynamics: 1 kg on 'link2'{START}\n"
    assert json.loads(ask('payload', '--json')[1])['payloads'][0]['link'] == 'link2'
    assert ask('payload', '--clear')[1] == f'/dynamics: no payload{START}\n'
    assert json.loads(ask('payload', '--json')[1])['payloads'] == []
    assert gravity() == pytest.approx(without)


def test_a_payload_is_estimated(ask):
    assert_refused(ask, ['estimate_payload'], 'no estimation is active')
    assert ask('estimate_payload', 'tool0')[1] == (
        "/dynamics_monitor: estimation for 'tool0' started\n")
    wait_until(lambda: ask('estimate_payload')[0] == 0, 'an estimate')
    out = ask('estimate_payload')[1]
    assert re.search(r'^m +\S+ +\S+ +\S+ +kg +', out, re.MULTILINE)
    assert re.search(r'^my +- +- +- +kg·m +no effect$', out, re.MULTILINE)
    figures = json.loads(ask('estimate_payload', '--stop', '--json')[1])
    assert figures['parameters'][:4] == ['m', 'mx', 'my', 'mz']
    assert figures['deviations'][2] is None
    assert ask('estimate_payload', '--apply')[0] == 2


def test_a_verb_says_how_to_start_the_monitor(ask, lift, monkeypatch):
    monkeypatch.setattr(lift, 'timeout', 0.5)
    assert ask('estimate_payload', client=lift) == (
        2, '', 'ros2 dynamics estimate_payload: no node /lift/dynamics_monitor in 0.5 s; start it '
        'with: ros2 run robot_dynamics_tools dynamics_monitor --ros-args -r __ns:=/lift\n')


def test_check_judges_the_model_of_the_node(ask, lift):
    status, out, _ = ask('check')
    assert (status, out.splitlines()[-1]) == (0, '/dynamics: no errors')
    assert 'accepted, as the errors are ignored' in ask('check', client=lift)[1]
    status, out, _ = ask('check', '--json', '--ignore', client=lift)
    assert status == 1
    assert [finding['check'] for finding in json.loads(out)['findings']
            if finding['level'] == 'error'] == ['inertia']
    assert_refused(ask, ['check', '--ignore', 'everything'], 'gravity_capability')


def test_status(ask):
    status, out, _ = ask('status', '--verbose')
    assert status == 0
    assert re.search(r'^state +active$', out, re.MULTILINE)
    assert re.search(r'^model +ok +planar_arm$', out, re.MULTILINE)
    assert re.search(r'^rate \[Hz\] +\d', out, re.MULTILINE)
    answer = json.loads(ask('status', '--json')[1])
    assert {check['check'] for check in answer['checks']} >= {'joint states', 'command', 'model'}


# --- task space, derivatives ---------------------------------------------------------------------

def test_task_space_is_that_of_the_library(ask):
    status, out, _ = ask(
        'task_space', 'link2', *Q, '-v', *V, '--point', 0.1, 0, 0.8, '--reference', 'local',
        '--json')
    assert status == 0
    data = json.loads(out)
    expected = TaskSpace(ARM, 'link2', (0.1, 0.0, 0.8), 'local').at(Q, V)
    for name in ('translation', 'jacobian', 'bias_acceleration', 'inertia', 'inverse_inertia',
                 'dynamic_inverse', 'gravity_force', 'coriolis_force', 'rank',
                 'translation_singular_values', 'rotation_manipulability'):
        np.testing.assert_allclose(data[name], getattr(expected, name), atol=1e-9)
    assert np.shape(data['lost_directions']) == (4, 6)
    assert data['position_margin'] == [None, None]
    assert 'Infinity' not in out


def test_tables_of_task_space(ask):
    status, out, _ = ask('task_space', 'tool0', *Q, '--velocity', *V)
    assert status == 0
    assert 'position (1.4798, 0.0000, 0.9142) m' in out
    assert 'Inertia Λ [kg, kg·m, kg·m²], the pseudo-inverse of Λ⁻¹' in out
    assert re.search(r'joint2 +no limit\n', out)
    assert 'Rank 2 of 6. Lost directions' in out


def test_without_a_position_it_is_the_measured_one(ask):
    status, out, _ = ask('task_space', 'tool0', '--json')
    assert status == 0
    assert json.loads(out)['translation'] == pytest.approx([0.0, 0.0, 1.8], abs=1e-3)


def test_derivatives(ask):
    status, out, _ = ask('inverse', *Q, '--velocity', *V, '--derivatives', '--json')
    data, by = json.loads(out), ArmDerivatives(ARM).inverse_dynamics(Q, V, [0.0, 0.0])
    assert status == 0
    for name in ('position', 'velocity', 'acceleration'):
        np.testing.assert_allclose(data[f'effort_{name}_derivative'], getattr(by, name), atol=1e-9)
    text = ask('inverse', *Q, '--derivatives')[1]
    assert 'Derivative of the efforts by position\n' in text
    assert 'effort_position_derivative' not in json.loads(ask('inverse', *Q, '--json')[1])


# --- retime --------------------------------------------------------------------------------------

@pytest.fixture
def motion(tmp_path: Path) -> Path:
    path = tmp_path / 'motion.yaml'
    write_trajectory(path, quintic_point_to_point(ARM.joint_names, [0.0, 0.0], [1.0, 0.5], 2.0))
    return path


def test_the_fastest_timing_is_written(ask, motion, tmp_path):
    output = tmp_path / 'faster.yaml'
    status, out, err = ask('retime', motion, '--output', output, '--efforts-may-jump')
    assert (status, err) == (0, '')
    expected = retime(DYNAMICS_OF, read_trajectory(motion, ARM.joint_names))
    result = read_trajectory(output, ARM.joint_names)
    assert result.duration == pytest.approx(expected.duration)
    assert efforts_along(DYNAMICS_OF, result).worst_ratio < 1.0 + 1e-5
    first, *_, last = out.splitlines()
    assert first == f'/dynamics: {expected.summary}'
    assert last == f'{len(result.points)} points are written to {output}'
    assert 'effort' in out


def test_bad_files_are_rejected_by_name(ask, tmp_path):
    assert_refused(ask, ['retime', tmp_path / 'absent.yaml'], 'cannot be read')
    corner = tmp_path / 'corner.yaml'
    write_trajectory(corner, make_trajectory(ARM.joint_names, [0, 1, 2], [[0, 0], [1, 0], [1, 1]]))
    assert_refused(ask, ['retime', corner], 'points[1].positions is a corner')
    status, _, err = ask('retime', corner, '--output', '/proc/absent/faster.yaml')
    assert (status, 'cannot write /proc/absent' in err) == (1, True)
    assert ask('retime', corner, '--corner-tolerance', '0.05')[0] == 0


# --- errors --------------------------------------------------------------------------------------

def test_several_nodes_and_none(capsys):
    with DynamicsClient() as client:
        wait_until(lambda: len(client.nodes()) == 2, 'both nodes')
        with pytest.raises(NoAnswerError, match='expected --node with one of: /dynamics, /lift/'):
            client.name  # noqa: B018
    with DynamicsClient('absent', 0.1) as client:
        wait_until(lambda: len(client.nodes()) == 2, 'both nodes')
        with pytest.raises(
                NoAnswerError, match="no dynamics node '/absent' in 0.1 s; those that run: /dyn"):
            client.name  # noqa: B018
    assert main(['inverse', '1', '2', '--node', 'absent', '--timeout', '0.1']) == 2
    assert "no dynamics node '/absent' in 0.1 s" in capsys.readouterr().err


def test_the_command_by_itself(capsys):
    assert main(['inverse', '0', '0', '-n', 'dynamics', '--timeout', str(TIMEOUT)]) == 0
    assert 'Effort by term [N·m]' in capsys.readouterr().out
    assert main([]) == 2
    assert 'equation' in capsys.readouterr().err


@pytest.mark.parametrize(('words', 'said'), [
    (['equation', '0.1', '0.2', '-v', 'joint3=1'], "velocity has joint 'joint3', expected one of"),
    (['payload', 'tool0'], "LINK is 'tool0' without a MASS"),
    (['estimate_payload', 'tool0', '--apply'], "LINK is 'tool0' together with --apply"),
    (['payload', 'tool0', '1', '--clear'], "LINK is 'tool0' together with --clear"),
    (['payload', 'hand', '1'], "is 'hand', expected one of the links ['base_link'"),
    (['task_space', 'tool1', *Q],
     "frame is 'tool1', expected one of the links ['base_link', 'link1'"),
    (['task_space', 'tool0', *Q, '--reference', 'world'], "reference is 'world', expected one of"),
    (['retime', 'MOTION', '--method', 'quick'],
     "method is 'quick', expected one of ['fastest', 'slow_down']"),
    (['retime', 'MOTION', '--corner-tolerance', '-1'], 'corner_tolerance is -1'),
])
def test_a_refusal_is_one_line(ask, motion, words, said):
    assert_refused(ask, [motion if word == 'MOTION' else word for word in words], said)


# --- completion, and ros2cli ---------------------------------------------------------------------

def test_completion():
    """In one process for all lines: argcomplete uses the file descriptor 9, and ends with it."""
    pytest.importorskip('argcomplete')

    def found() -> list[set[str]]:
        done = children.run(
            [sys.executable, '-c', COMPLETE, *OFFERED], capture_output=True, text=True)
        return [{word for word in words.split('\n') if not word.startswith('-')}
                for words in done.stdout.split('\0')[1:]]

    wait_until(lambda: found() == list(OFFERED.values()), 'the words')  # discovery may be slow


@pytest.mark.parametrize(('words', 'said'), [
    (['analyze', '--help'], 'usage: analyze '),
    (['estimate_payload', '--urdf', 'x.urdf', '--help'], 'usage: estimate_payload '),
    (['estimate_payload', '--help'], 'usage: dynamics estimate_payload '),
    (['torque_map', 'nothing', '-o=x'], 'torque_map: '), (['--help'], 'viewer')])
def test_tools_are_verbs(words, said, capsys):
    """Those that need no node; `estimate_payload` is also a verb of the node."""
    with pytest.raises(SystemExit) as ended:
        program(words)
    assert said in ''.join(capsys.readouterr())
    assert ended.value.code == (2 if words[0] == 'torque_map' else 0)


def test_ros2_dynamics():
    """The command as users type it, if ros2cli is installed."""
    pytest.importorskip('ros2cli', reason='ros2cli comes with apt, and has no wheel')
    words = ['inverse', '-0.1', '-2e-1', '--node', '/dynamics', '--timeout', str(TIMEOUT)]
    result = children.run(
        [sys.executable, '-c', 'from ros2cli.cli import main; main()', 'dynamics', *words,
         '--json'], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)['position'] == [-0.1, -0.2]
