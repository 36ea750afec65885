# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tool `identify`: its files, its messages, and a real node with its files."""

import json
import re
import sys

from arm_motions import fourier_motion
from identification_bench import changed_arm, rigid_effort
import numpy as np
import pytest
from recordings import encoded, needs_ur10, START_NS, UR10, write_recording
from report_page import ReportPage
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.model.effort_deviation import EffortDeviation
from robot_dynamics.model.regressor import inertial_parameters, random_states
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_interfaces.srv import InverseDynamics
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.commands.identify import main
from robot_dynamics_tools.identification.pipeline import identify
from robots import robot_urdf
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState

PUBLISHED = np.array([21.6, 5.9, 4.6, 9.6, 20.2, 25.7]) / 100.0
"""Residuals of the published model of that arm, on the last 40 % of those samples."""
CONSISTENT = 1.2
DONE, MISTAKE = 0, 2
ARM = load_arm(default_arm_urdf())
ROTORS, FRICTION = np.array([0.3, 0.1]), np.array([2.0, 1.0])


def record(path, seed=0, gain=1.0, duration=16.0, off=0.15, arm=ARM, loads=()):
    """Write a recording of an arm with rotors, friction, and masses off from its URDF."""
    states = fourier_motion(arm, 100.0, duration, seed)
    rotors, friction = (np.resize(each, arm.joint_count) for each in (ROTORS, FRICTION))
    effort = rigid_effort(
        changed_arm(arm, off).with_payloads(loads), states, rotors) + friction * (
        0.5 * states.v + np.tanh(states.v / 0.1))
    effort += 0.1 * np.random.default_rng(seed).normal(size=effort.shape)
    stamps = START_NS + np.round(1e9 * states.times).astype(np.int64)
    return write_recording(
        path, encoded(stamps, arm.joint_names, states.q, states.v, effort / gain))


@pytest.fixture(scope='module')
def urdf(tmp_path_factory):
    path = tmp_path_factory.mktemp('urdf') / 'arm.urdf'
    path.write_text(default_arm_urdf())
    return path


@pytest.fixture(scope='module')
def output(tmp_path_factory, urdf):
    """Return the directory of an identification from one recording."""
    folder = tmp_path_factory.mktemp('identify')
    record(folder / 'bag')
    assert run(folder, urdf, '--samples') == DONE
    return folder / 'out'


@pytest.fixture(scope='module')
def short(tmp_path_factory):
    """Return a recording of 8 s."""
    return record(tmp_path_factory.mktemp('short') / 'bag', duration=8.0)


@pytest.fixture(autouse=True)
def _static_figures(monkeypatch):
    """Draw the reports of all tests without Bokeh, except that of `output`."""
    monkeypatch.setitem(sys.modules, 'bokeh.models', None)


def run(folder, urdf, *options, bags=('bag',)):
    """Identify from recordings in a folder, into its folder `out`; return the exit status."""
    return main([*(str(folder / bag) for bag in bags), '--urdf', str(urdf), '--output',
                 str(folder / 'out'), *options])


def figures_of(folder):
    """Return the figures that an identification wrote."""
    return json.loads((folder / 'report.json').read_text())


def test_the_files_fit_each_other(output):
    figures = figures_of(output)
    arm = arm_from_parameters(
        (output / 'identified.urdf').read_text(),
        read_parameter_file(output / 'identified.yaml'))
    assert inertial_parameters(arm).reshape(-1, 10) == pytest.approx(
        np.array(figures['inertial_parameters']), rel=1e-8, abs=1e-12)
    for field in ('viscous', 'coulomb'):
        assert getattr(arm.friction, field) == pytest.approx(
            np.array([joint[field] for joint in figures['friction']]), rel=1e-7)
    assert figures['rank'] == 7
    assert len(figures['base_parameters']) == 7
    assert max(figures['residual']['consistent']['test']) < 0.03
    assert min(figures['residual']['urdf']['test']) > 0.05


def test_the_parameter_file_needs_no_other_file(output):
    text = (output / 'identified.yaml').read_text()
    assert str(output) not in text
    values = read_parameter_file(output / 'identified.yaml')
    assert 'robot_description_file' not in values
    assert values['robot_description'] == (output / 'identified.urdf').read_text()
    assert values['command'] == 'none'
    assert '# The offset F_b of the measured effort, joint1 ' in text
    # reflected inertia without motor data: no currents
    assert not any(name.startswith(('actuator.torque', 'actuator.gear')) for name in values)


def test_the_report_begins_with_the_verdict_and_the_links_with_their_masses(output, urdf):
    """It needs no other file."""
    page = ReportPage((output / 'report.html').read_text())
    assert page.is_complete
    places = [page.text.index(words) for words in (
        'Verdict on 2 joints: 2 good.', 'use identified.yaml', 'mass before [kg]')]
    assert places == sorted(places)
    before, after = (inertial_parameters(load_arm(text)).reshape(-1, 10)[:, 0] for text in (
        urdf.read_text(), (output / 'identified.urdf').read_text()))
    for link, old, new in zip(('link1', 'link2'), before, after):
        assert f'{link} {old:.3f} {new:.3f}' in page.text


def test_nodes_start_with_what_was_written(output):
    """The node answers with the identified model, and the simulated arm has it too."""
    path = output / 'identified.yaml'
    written = read_parameter_file(path)
    assert max(written['friction.sigmoid']) > 0.5
    arm = arm_from_parameters((output / 'identified.urdf').read_text(), written)
    expected = ArmDynamics(arm)
    arguments = ['--ros-args', '--params-file', str(path), '-p', 'command:=computed_torque', '--']
    with RosClient() as client, running(
            NodeProcess(SIMULATED_ARM, {
                'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0,
                'initial_position': [0.1, 0.2]}, namespace='/rehearsal', arguments=arguments),
            NodeProcess(DYNAMICS, {'lock_step': True}, namespace='/rehearsal',
                        arguments=arguments)):
        for state in zip(*random_states(arm, 4, seed=3)):
            response = client.call(
                InverseDynamics, '/rehearsal/dynamics/inverse_dynamics', InverseDynamics.Request(
                    position=state[0], velocity=state[1], acceleration=state[2]))
            assert response.success, response.message
            assert len(response.motor_current) == 0
            assert np.array(response.effort) == pytest.approx(
                expected.inverse_dynamics(*state), rel=1e-12, abs=1e-12)
            assert np.array(response.effort_deviation) == pytest.approx(
                EffortDeviation(expected, arm.uncertainty).prediction(*state), rel=1e-9)
            assert 0.0 < max(response.effort_deviation) < 5.0
            # and this differs from the model of the URDF
            before = ArmDynamics(ARM).inverse_dynamics(*state)
            assert np.abs(np.array(response.effort) - before).max() > 0.5
        assert list(client.get_parameter('/rehearsal/simulated_arm', 'friction.sigmoid')) == (
            written['friction.sigmoid'])
        client.wait_for(JointState, '/rehearsal/effort_command')  # both run


def test_without_test_samples_the_folds_test_the_model(tmp_path, output, capsys):
    """Of an arm whose revolute joints have no limits, and are used as continuous ones."""
    urdf = tmp_path / 'arm.urdf'
    urdf.write_text(re.sub(r'<limit [^>]*/>', '', default_arm_urdf().replace(
        'type="continuous"', 'type="revolute"')))
    record(tmp_path / 'bag')
    assert run(tmp_path, urdf, '--train-fraction', '1.0') == DONE
    printed, err = capsys.readouterr()
    assert "joint 'joint1' is revolute and has no <limit>, it is used as continuous" in err
    assert set(load_arm(tmp_path / 'out/identified.urdf').joint_kinds) == {'continuous'}
    assert 'Residual on the cross-validation folds, RMS relative to the effort:' in printed
    assert 'none for the test' in printed
    assert 'nan' not in printed + (tmp_path / 'out' / 'identified.yaml').read_text()
    one, other = map(figures_of, (output, tmp_path / 'out'))
    assert other['is_cross_validated']
    assert not one['is_cross_validated']
    residual = {name: np.array(test['test']) for name, test in other['residual'].items()}
    assert residual['urdf'] == pytest.approx(np.array(one['residual']['urdf']['test']), rel=0.6)
    for model in ('base', 'consistent'):
        assert (residual[model] > 0.0).all()
        assert (residual[model] < 0.1 * residual['urdf']).all()


def test_the_samples_of_the_test_part_are_exported(output):
    path = output / 'test_samples_bag.csv'
    columns = path.read_text().splitlines()[0].split(',')
    values = dict(zip(columns, np.loadtxt(path, delimiter=',', skiprows=1).T))
    figures = figures_of(output)
    assert len(values['time [s]']) == figures['samples']['test'] == 640
    assert values['time [s]'][0] == pytest.approx(9.6, abs=0.011)
    for j, name in enumerate(ARM.joint_names):
        measured, model = (values[f'{name}.{what} [N m]'] for what in ('measured', 'model'))
        residual = np.sqrt(np.mean((measured - model)**2) / np.mean(measured**2))
        assert residual == pytest.approx(figures['residual']['consistent']['test'][j], rel=1e-5)
        assert np.gradient(values[f'{name}.position [rad]'], 0.01)[5:-40] == pytest.approx(
            values[f'{name}.velocity [rad/s]'][5:-40], abs=0.01)


def test_effort_that_is_current(tmp_path, urdf, capsys):
    record(tmp_path / 'bag', gain=8.0, duration=12.0, off=0.0)
    assert run(tmp_path, urdf) == MISTAKE
    assert 'in another unit, use --effort current' in ' '.join(capsys.readouterr().err.split())
    assert run(tmp_path, urdf, '--effort', 'current', '--force') == DONE
    values = read_parameter_file(tmp_path / 'out' / 'identified.yaml')
    assert values['measured_effort'] == 'motor_current'
    assert 'confounded with the masses of the URDF' in capsys.readouterr().out
    # the masses of the URDF are the reference, and they are correct here
    assert values['actuator.torque_constant'] == pytest.approx([8.0, 8.0], rel=0.02)
    assert max(figures_of(tmp_path / 'out')['residual']['consistent']['test']) < 0.05


def test_a_dry_run_says_what_is_observable_and_writes_nothing(tmp_path, short, urdf, capsys):
    assert main([str(short), '--urdf', str(urdf), '--output', str(tmp_path / 'out'),
                 '--dry-run']) == DONE
    assert '7 of 7 base parameters' in ' '.join(capsys.readouterr().out.split())
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['nowhere'], "'nowhere' does not exist"),
    (['BAG', '--payload', 'other:tool0=1'], "names the recording 'other', expected one of"),
    (['BAG', '--payload', 'bag:nothing=1'], "is 'nothing', expected one of the links"),
    (['BAG', '--train-fraction', '0.05'], 'samples for training together, expected at least'),
    (['BAG', '--payload', 'tool'], 'expected LINK=KG'),
])
def test_mistakes_are_reported(tmp_path, short, urdf, capsys, arguments, words):
    given = [str(short) if each == 'BAG' else each for each in arguments]
    try:
        status = main([*given, '--urdf', str(urdf), '--output', str(tmp_path / 'out')])
    except SystemExit as ended:
        status = ended.code
    assert status == MISTAKE
    said = capsys.readouterr().err
    assert words in said
    assert 'Traceback' not in said


# --- a real arm ----------------------------------------------------------------------------------

@needs_ur10
def test_a_real_ur10():
    read = read_for_arm(UR10, AnalysisSettings(urdf=robot_urdf('ur10')))
    motion = filter_motion(read.series)
    tests, samples = identify(read.arm, [motion]).tests, len(read.series.times)
    assert motion.cutoff_hz == pytest.approx(5.0, rel=0.02)
    assert tests['base'].samples == (int(0.6 * samples), samples - int(0.6 * samples))
    assert (tests['base'].relative() <= PUBLISHED).all()
    assert (tests['consistent'].relative() <= CONSISTENT * PUBLISHED).all()
    # of the node's service for a single state, without presliding hysteresis
    assert (tests['consistent'].relative('test_by_sample') <= CONSISTENT * PUBLISHED).all()
