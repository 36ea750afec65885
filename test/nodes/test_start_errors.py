# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Nodes that cannot start: status 1 and a one-line error; and nodes with a xacro file.

What a user reads when another model is loaded, and when joint states are dropped.
"""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
import json
import re
import subprocess
import sys
from typing import Any, NamedTuple

from bad_descriptions import ARM, BAD_DESCRIPTIONS, MASSLESS
import children
from fault_bench import fault_bench, NAMES, Q
from fault_stimuli import altered, follow, shifted
from fault_table import fault
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
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


class Case(NamedTuple):
    parameters: Mapping[str, Any]
    words: str
    module: str = DYNAMICS
    arguments: Sequence[str] = ()
    """Instead of `parameters`."""


CASES = {
    **{name: Case({'robot_description': bad.xml}, bad.words)
       for name, bad in BAD_DESCRIPTIONS.items()},
    'no mass to simulate': Case(
        {'robot_description': MASSLESS},
        r"joints \['joint2'\] of robot 'r' move no mass or inertia", SIMULATED_ARM),
    'unknown check': Case(
        {'ignore_checks': ['beauty']}, r"ignore_checks\[0\] is 'beauty', expected one of"),
    'missing file': Case(
        {'robot_description_file': '/no/such/arm.urdf'},
        r"robot_description_file is '/no/such/arm.urdf', which cannot be read"),
    'unknown joint': Case(
        {'robot_description': ARM, 'joints': ['joint1', 'elbow']},
        r"joints has 'elbow', expected joints out of \['joint1', 'joint2'\]"),
    'two descriptions': Case(
        {'robot_description': ARM, 'robot_description_file': 'arm.urdf'},
        r"robot_description_file is 'arm.urdf' and robot_description is given too"),
    'out of range': Case({'effort_limit_fraction': 2.0}, r'effort_limit_fraction.* 2'),
    'unknown parameter': Case(
        {'comand': 'none'}, "unknown parameter 'comand', probably 'command'; expected"),
    'unknown fault action': Case({'fault_action': 'pray'}, "fault_action is 'pray', expected"),
    'integer': Case(
        {'effort_limit_fraction': 1}, r'effort_limit_fraction.*a number with a decimal point'),
    'several gains without an order of the joints': Case(
        {'gains.damping_ratio': [1.0, 2.0]},
        r'gains\.damping_ratio has 2 values, .*but the parameter joints'),
    'mixed types': Case(
        {'gains.damping_ratio': [1, 2.0]}, r'Sequence should be of same type.*line_num'),
    'mismatched payloads': Case(
        {'payload.mass': [1.0]},
        r'payload\.mass has 1 values, expected 1 for each of payload.links'),
    'two payloads of a link': Case(
        {'payload.links': ['tool0', 'tool0'], 'payload.mass': [1.0, 2.0]},
        'expected each link once'),
    **{' '.join(arguments): Case({}, words, DYNAMICS, ['--ros-args', *arguments])
       for arguments, words in (
        (['--params-file', 'nowhere.yaml'], "Couldn't parse params file: .*nowhere.yaml"),
        (['-p', 'effort_limit_fraction'],
         "Couldn't parse parameter override rule: '-p effort_limit_fraction'"),
        (['-r', '__node:=a name'], "Couldn't parse remap rule: '-r __node:=a name'"),
        (['--scale', '1'], r"unknown ROS arguments \['--scale'"))},
}


def injected(name: str, case: Case) -> str:
    """Return the description of a case for the table of fault tests."""
    if case.arguments:
        return f'arguments that ROS cannot read: `{name}`'
    given = ', '.join(
        f'{key}: {value}' for key, value in case.parameters.items() if key != 'robot_description')
    return f'{name}: `{given}`' if given else name


FAULTS = {
    name: fault(
        'Robot descriptions at the start' if list(case.parameters) == ['robot_description'] else
        'Parameters at the start', injected(name, case),
        'one line with the error and the expectation, status 1')
    for name, case in CASES.items()}


UNKNOWN = [
    (module, program, arguments)
    for module, program in ((DYNAMICS, 'dynamics_node'), (SIMULATED_ARM, 'simulated_arm'))
    for arguments in (['--scale', '1'], ['command:=none'])]

# Starts all nodes one after the other in one process: a process per node would be slower.
DRIVER = """
import importlib, json, sys
for module, arguments in json.loads(sys.argv[1]):
    status = importlib.import_module(module).main(arguments)
    print('status', status, file=sys.stderr, flush=True)
"""


@pytest.fixture(scope='module')
def ends(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, list[str]]]:
    """Return the status and the output of `main` for every case, and for `UNKNOWN`."""
    directory = tmp_path_factory.mktemp('parameters')
    calls = []
    for i, case in enumerate(CASES.values()):
        arguments = case.arguments or ['--ros-args', '--params-file', str(write_parameters(
            directory / f'{i}.yaml', case.parameters))]
        calls.append((case.module, ['node', *arguments]))
    calls += [(module, ['node', *arguments]) for module, _, arguments in UNKNOWN]
    done = children.run(
        [sys.executable, '-c', DRIVER, json.dumps(calls)], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=10 * TIMEOUT)
    outputs = re.split(r'^status (\d+)\n', done.stdout, flags=re.MULTILINE)
    assert len(outputs) == 2 * len(calls) + 1, done.stdout
    return [(int(status), output.splitlines())
            for output, status in zip(outputs[::2], outputs[1::2])]


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=mark) for name, mark in FAULTS.items()])
def test_a_node_that_cannot_start_logs_one_line(ends, name):
    status, output = ends[list(CASES).index(name)]
    lines = [line for line in output if '[rcl]' not in line]  # rcl logs before the node starts
    assert status == 1, output
    assert len(lines) == 1, output
    assert lines[0].startswith('robot_dynamics: ')
    assert re.search(CASES[name].words, lines[0]), lines[0]


@fault('Parameters at the start', 'arguments outside `--ros-args`: `--scale 1`, `command:=none`',
       'one line that names the arguments and the syntax of parameters, status 2')
def test_arguments_that_no_node_has(ends):
    for (_, program, arguments), (status, output) in zip(UNKNOWN, ends[len(CASES):], strict=True):
        assert status == 2
        assert output == [
            f'{program}: unknown arguments {arguments}; set a parameter with `--ros-args -p '
            f'NAME:=VALUE` (`{program} --help` lists the main ones)']


@pytest.mark.parametrize(('flag', 'function', 'specs', 'names'), [
    ('--help', 'dynamics_node', DYNAMICS_SPECS, [
        'robot_description_file', 'joints', 'command', 'joint_states', 'effort_command',
        '~/joint_trajectory', '/diagnostics', '~/stop']),
    ('-h', 'simulated_arm', SIMULATED_ARM_SPECS, [
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
def test_a_xacro_file_is_expanded_and_a_bad_one_is_reported(tmp_path):
    file = tmp_path / 'arm.urdf.xacro'
    file.write_text(XACRO, encoding='utf-8')
    with NodeProcess(DYNAMICS, {'robot_description_file': str(file)}) as node:
        assert "joints ['hinge']" in node.wait_for_log("Model 'from_xacro'")
    file.write_text(XACRO.replace('${mass}', '${no_such_property}'), encoding='utf-8')
    log = log_of_failed_start(DYNAMICS, {'robot_description_file': str(file)})
    assert re.search(
        r'^robot_dynamics: robot_description_file: xacro cannot expand .*no_such_property',
        log, re.MULTILINE), log


NS = '/start_log'


def test_another_model_ends_the_reference_visibly_and_a_dropped_state_names_the_remedy(client):
    with client.describing(NS) as publish, \
            fault_bench(client, NS, {'command': 'computed_torque'}) as bench:
        follow(bench, Q)
        publish(default_arm_urdf().replace('planar_arm', 'other_arm'))
        bench.wait_message('reference', 'ended early: another model was loaded')
        bench.efforts.clear()
        bench.efforts.wait_count(5)  # the new model has a state, from which a set-point can start
        follow(bench, Q)
        for seconds, words in ((-60.0, r'60\.\d+ s old'), (60.0, 'in the future')):
            words += '.*; synchronise the clocks of driver and computer, or set `state_max_age`'
            bench.driver.change = shifted(seconds)
            bench.node.wait_for_log(r'\[WARN\].*Dropped a joint state.*' + words)
            bench.wait_message('joint states', f'.*{words}.*')
            bench.driver.go_on()
            bench.wait_running()
        bench.driver.change = altered(name=NAMES[:1], position=Q[:1], velocity=[])
        line = bench.node.wait_for_log('No joint state is complete')
        assert "no new samples of ['joint2']" in line
        assert 'set the parameter joints' in line
        bench.wait_message('joint states', r".*\['joint2'\].*")
        client.forget(NS)
