# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes that cannot start: status 1 and a one-line error; and nodes with a xacro file."""

from collections.abc import Mapping
import importlib
from importlib.util import find_spec
import json
from pathlib import Path
import re
import subprocess
import sys
from typing import Any, NamedTuple

from bad_descriptions import ARM, BAD_DESCRIPTIONS, MASSLESS
import children
from fault_table import fault
import pytest
from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from ros_harness import (
    DYNAMICS,
    log_of_failed_start,
    NodeProcess,
    SIMULATED_ARM,
    TIMEOUT,
    write_parameters,
)

ROOT = Path(__file__).parents[2]
ARM_JOINTS = ['joint1', 'joint2']
MOTORS = {'actuator.torque_constant': [0.1], 'actuator.gear_ratio': [50.0]}


class Case(NamedTuple):
    parameters: Mapping[str, Any]
    words: str
    module: str = DYNAMICS


NAN, INF = float('nan'), float('inf')
CASES = {
    **{name: Case({'robot_description': bad.xml}, bad.words)
       for name, bad in BAD_DESCRIPTIONS.items()},
    'no mass to simulate': Case(
        {'robot_description': MASSLESS},
        r"joints \['joint2'\] of robot 'r' move no mass or inertia", SIMULATED_ARM),
    'unknown check': Case(
        {'ignore_checks': ['beauty']}, r"ignore_checks\[0\] is 'beauty', expected one of"),
    'another check ignored': Case(
        {'robot_description': MASSLESS, 'ignore_checks': ['inertia', 'limits']},
        r"model check mass: joint 'joint2' moves"),
    'missing file': Case(
        {'robot_description_file': '/no/such/arm.urdf'},
        r"robot_description_file is '/no/such/arm.urdf', which cannot be read"),
    'unknown package': Case(
        {'robot_description_file': 'package://no_such_package/arm.urdf'},
        r"there is no package 'no_such_package'"),
    'unknown scheme': Case(
        {'robot_description_file': 'http://nowhere/arm.urdf'}, r'expected a path, file:// or'),
    'unknown joint': Case(
        {'robot_description': ARM, 'joints': ['joint1', 'elbow']},
        r"joints has 'elbow', expected joints out of \['joint1', 'joint2'\]"),
    'unknown frame': Case(
        {'external_wrench.frame': 'hand'},
        r"external_wrench.frame is 'hand', expected one of the links \['base_link', 'link1'"),
    'two descriptions': Case(
        {'robot_description': ARM, 'robot_description_file': 'arm.urdf'},
        r"robot_description_file is 'arm.urdf' and robot_description is given too"),
    'out of range': Case({'effort_limit_fraction': 2.0}, r'effort_limit_fraction.* 2'),
    'unknown parameter': Case(
        {'comand': 'none'}, "unknown parameter 'comand', probably 'command'; expected"),
    'not a number': Case({'effort_limit_fraction': NAN}, r'effort_limit_fraction.* nan'),
    'zero time': Case({'state_timeout': 0.0}, r'state_timeout.* 0\.0'),
    'negative rate': Case({'effort_rate_limit': -1.0}, r'effort_rate_limit.* -1'),
    'unknown fault action': Case({'fault_action': 'pray'}, "fault_action is 'pray', expected"),
    'too large in an array': Case({'gains.kd': [1e9]}, r'gains\.kd\[0\] is 1e\+09'),
    'infinite gravity': Case({'gravity': [0.0, 0.0, -INF]}, r'gravity\[2\] is -inf'),
    'number for a boolean': Case(
        {'use_sim_time': 5}, r"'use_sim_time' to '5' .*expecting type 'BOOL'"),
    'text for a boolean': Case(
        {'start_type_description_service': 'no'}, r"description_service' .*expecting type 'BOOL'"),
    'text for a number': Case(
        {'effort_limit_fraction': 'half'},
        r'effort_limit_fraction.*a number with a decimal point'),
    'integer': Case(
        {'effort_limit_fraction': 1}, r'effort_limit_fraction.*a number with a decimal point'),
    'negative gain': Case({'gains.kp': [-1.0]}, r'gains\.kp\[0\] is -1'),
    'several gains without an order of the joints': Case(
        {'gains.kp': [1.0, 2.0]}, r'gains\.kp has 2 values, .*but the parameter joints'),
    'mixed types': Case({'gains.kp': [1, 2.0]}, r'Sequence should be of same type.*line_num'),
    'wrong number of gravity components': Case(
        {'gravity': [0.0, 0.0]}, r'gravity has 2 values, expected 3'),
    'zero rate': Case({'rate': 0.0}, r'rate.* 0', SIMULATED_ARM),
    'wrong number of initial positions': Case(
        {'initial_position': [0.0]}, r'initial_position has 1 values, expected 2', SIMULATED_ARM),
    'unknown joint of the simulated arm': Case(
        {'joints': ['elbow']}, r"joints has 'elbow'", SIMULATED_ARM),
    'static friction below Coulomb': Case(
        {'joints': ARM_JOINTS, 'friction.coulomb': [1.0, 1.0], 'friction.static': [2.0, 0.5]},
        r"friction\.static of 'joint2' is 0\.5, expected at least friction\.coulomb",
        SIMULATED_ARM),
    'zero gear ratio': Case(
        {**MOTORS, 'actuator.gear_ratio': [0.0]},
        r"actuator\.gear_ratio of 'joint1' is 0, expected a number other than 0", SIMULATED_ARM),
    'missing gear ratio': Case(
        {'actuator.torque_constant': [0.1]},
        r"actuator\.gear_ratio is empty, and no <transmission> .*\['joint1', 'joint2'\]",
        SIMULATED_ARM),
    'voltage limit without resistance': Case(
        {**MOTORS, 'actuator.voltage_limit': [24.0]},
        r"actuator\.resistance of 'joint1' is 0, expected a number > 0 where there is a"),
}


def injected(name: str, case: Case) -> str:
    """Return the description of a case for the table of fault tests."""
    given = ', '.join(
        f'{key}: {value}' for key, value in case.parameters.items() if key != 'robot_description')
    return f'{name}: `{given}`' if given else name


FAULTS = {
    name: fault(
        'Robot descriptions at the start' if list(case.parameters) == ['robot_description'] else
        'Parameters at the start', injected(name, case),
        'one line with the error and the expectation, status 1')
    for name, case in CASES.items()}


# Starts all nodes one after the other in one process: a process per node would be slower.
DRIVER = """
import importlib, json, sys
for module, arguments in json.loads(sys.argv[1]):
    status = importlib.import_module(module).main(arguments)
    print('status', status, file=sys.stderr, flush=True)
"""


@pytest.fixture(scope='module')
def ends(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, list[str]]]:
    """Return the status and the output of `main` for every case."""
    directory = tmp_path_factory.mktemp('parameters')
    calls = []
    for i, case in enumerate(CASES.values()):
        file = write_parameters(directory / f'{i}.yaml', case.parameters)
        calls.append((case.module, ['node', '--ros-args', '--params-file', str(file)]))
    done = children.run(
        [sys.executable, '-c', DRIVER, json.dumps(calls)], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=10 * TIMEOUT)
    outputs = re.split(r'^status (\d+)\n', done.stdout, flags=re.MULTILINE)
    assert len(outputs) == 2 * len(CASES) + 1, done.stdout
    return {
        name: (int(status), output.splitlines())
        for name, output, status in zip(CASES, outputs[::2], outputs[1::2])}


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=mark) for name, mark in FAULTS.items()])
def test_a_node_that_cannot_start_logs_one_line(ends, name):
    status, output = ends[name]
    lines = [line for line in output if '[rcl]' not in line]  # rcl logs before the node starts
    assert status == 1, output
    assert len(lines) == 1, output
    assert lines[0].startswith('robot_dynamics: ')
    assert re.search(CASES[name].words, lines[0]), lines[0]


@pytest.mark.parametrize(('arguments', 'words'), [
    pytest.param(arguments, words, marks=fault(
        'Parameters at the start', f'arguments that ROS cannot read: `{" ".join(arguments)}`',
        'one line with the error, status 1'))
    for arguments, words in (
        (['--params-file', 'nowhere.yaml'], "Couldn't parse params file: .*nowhere.yaml"),
        (['-p', 'effort_limit_fraction'],
         "Couldn't parse parameter override rule: '-p effort_limit_fraction'"),
        (['-r', '__node:=a name'], "Couldn't parse remap rule: '-r __node:=a name'"),
        (['--scale', '1'], r"unknown ROS arguments \['--scale'"))])
def test_arguments_that_ros_cannot_read(arguments, words):
    log = log_of_failed_start(DYNAMICS, arguments=['--ros-args', *arguments])
    line, = (line for line in log.splitlines() if '[rcl]' not in line)
    assert re.search(f'^robot_dynamics: .*{words}', line), line


@pytest.mark.parametrize('arguments', [
    pytest.param(arguments, marks=fault(
        'Parameters at the start', f'arguments outside `--ros-args`: `{" ".join(arguments)}`',
        'one line that names the arguments and the syntax of parameters, status 2'))
    for arguments in (['--scale', '1'], ['command:=none'])])
def test_arguments_that_no_node_has(arguments):
    for module, program in ((DYNAMICS, 'dynamics_node'), (SIMULATED_ARM, 'simulated_arm')):
        node = NodeProcess(module, {'joints': ['joint1']}, arguments=arguments).launch()
        assert node.wait() == 2
        line, = node.log.splitlines()
        assert line == (
            f'{program}: unknown arguments {arguments}; set a parameter with `--ros-args -p '
            f'NAME:=VALUE` (`{program} --help` lists the main ones)')


@pytest.mark.parametrize('flag', ['--help', '-h'])
@pytest.mark.parametrize(('function', 'specs', 'names'), [
    ('dynamics_node', DYNAMICS_SPECS, [
        'robot_description_file', 'joints', 'command', 'joint_states', 'effort_command',
        '~/joint_trajectory', '/diagnostics', '~/stop']),
    ('simulated_arm', SIMULATED_ARM_SPECS, [
        'rate', 'lock_step', 'joint_states', 'effort_command', '~/reset'])])
def test_help(flag, function, specs, names):
    """The installed executables run these functions."""
    done = children.run(
        [sys.executable, '-c', 'import sys; from robot_dynamics.ros import entry_points; '
         f'sys.exit(entry_points.{function}())', flag, '--ros-args', '-p', 'use_sim_time:=true'],
        text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith(f'usage: {function} [--help] [--ros-args [-p NAME:=VALUE] ')
    lines = [line.strip() for line in done.stdout.splitlines()]
    assert {part for line in lines for part in line.split(', ')} >= set(names)
    assert f'Main parameters, of {len(specs)} ' in done.stdout
    assert lines[lines.index('Examples:') + 1] == function  # without arguments
    for page in re.findall(r'docs/[\w/]+\.md', done.stdout):
        assert (ROOT / page).is_file()
    types = re.findall(r'\b\w+_(?:msgs|srvs|interfaces)/(?:msg|srv)/\w+', done.stdout)
    assert len(types) >= 6
    for package, kind, name in (one.split('/') for one in types):
        assert hasattr(importlib.import_module(f'{package}.{kind}'), name)
    assert 'Exit status: 0 ' in done.stdout
    joints = next(spec for spec in specs if spec.name == 'joints')
    assert joints.description in ' '.join(lines)


@fault('Robot descriptions at the start', 'joints that move no mass, `ignore_checks: [mass]`',
       'accepted; the error is a warning')
def test_an_ignored_error_is_a_warning():
    parameters = {'robot_description': MASSLESS, 'ignore_checks': ['mass']}
    with NodeProcess(DYNAMICS, parameters) as node:
        assert '[WARN]' in node.wait_for_log(r"Model check: mass: joint 'joint2' moves 0 kg")
        node.wait_for_log("Model 'r': joints")
        node.wait_for_log("Model check: limits: joint 'joint1' has no velocity")


XACRO = """<robot name="from_xacro" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="mass" value="${1 + 1}"/>
  <link name="base"/>
  <link name="arm"><inertial>
    <origin xyz="0 0 0.5"/><mass value="${mass}"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>
"""


@pytest.mark.skipif(find_spec('xacro') is None, reason='xacro is not installed')
def test_a_xacro_file_is_expanded(tmp_path):
    file = tmp_path / 'arm.urdf.xacro'
    file.write_text(XACRO, encoding='utf-8')
    with NodeProcess(DYNAMICS, {'robot_description_file': str(file)}) as node:
        assert "joints ['hinge']" in node.wait_for_log("Model 'from_xacro'")


@pytest.mark.skipif(find_spec('xacro') is None, reason='xacro is not installed')
def test_a_bad_xacro_file_is_reported(tmp_path):
    file = tmp_path / 'arm.urdf.xacro'
    file.write_text(XACRO.replace('${mass}', '${no_such_property}'), encoding='utf-8')
    log = log_of_failed_start(DYNAMICS, {'robot_description_file': str(file)})
    assert re.search(
        r'^robot_dynamics: robot_description_file: xacro cannot expand .*no_such_property',
        log, re.MULTILINE), log


def test_an_interrupt_at_any_moment_leaves_in_order():
    """An operator who started the wrong node presses Ctrl-C at once, and gets no traceback."""
    node = NodeProcess(DYNAMICS, ready=re.compile('Model ')).start()
    node.interrupt()  # once the model is logged, before the node spins
    assert node.wait() == 0, node.log
    assert 'Traceback' not in node.log
