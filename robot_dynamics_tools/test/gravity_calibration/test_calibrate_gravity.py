# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tool on recordings: parameter file, report, printed results, and refusals."""

from dataclasses import replace
from pathlib import Path

from calibration_bench import exact_drives, HiddenDrives, load_on, poses_of, record_holds
import numpy as np
import pytest
from robot_dynamics.model.arm_parameters import arm_from_parameters, read_parameter_file
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
from robot_dynamics_tools.commands.calibrate_gravity import main
from robot_dynamics_tools.gravity_calibration.calibration import calibrate_holds
from robot_dynamics_tools.gravity_calibration.recorded_holds import read_holds
from robots import arm_without_gripper

WEIGHT = ['--weight-mass', '2', '--weight-link', 'tool0', '--weight-position', '0.1', '0', '0.05']
GIVEN = """\
/**:
  ros__parameters:
    joints: [joint1, joint2]
    gravity: [0.0, 0.0, -9.81]
    friction:
      viscous: [0.1, 0.2]
dynamics:
  ros__parameters:
    command: gravity_compensation
    effort.report_scale: [1.0, 1.0]
simulated_arm:
  ros__parameters:
    effort:
      report_scale: [0.8, 1.25]
"""
"""A parameter file with a section for each node."""


@pytest.fixture(scope='module')
def drives() -> HiddenDrives:
    return exact_drives(arm_without_gripper('default'), 4)


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory, drives: HiddenDrives) -> Path:
    """Return a directory with recordings of the default arm: bare, with tool, with a weight."""
    directory = tmp_path_factory.mktemp('recordings')
    arm, q = drives.arm, poses_of(drives.arm, 8)
    tool, weight = load_on('default', 1.5), load_on('default', 2.0, (0.1, 0.0, 0.05))
    for name, loads in (('bare', []), ('tool', [tool]), ('weight', [tool, weight])):
        record_holds(directory / name, drives, q, arm.with_payloads(loads))
    (directory / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    (directory / 'arm.yaml').write_text(GIVEN, encoding='utf-8')
    return directory


def run(files: Path, output: Path, recording: str, *options: str) -> int:
    """Run the tool on one of the recordings, or on that of an absolute path."""
    return main([str(files / recording), '--urdf', str(files / 'arm.urdf'), '-o', str(output),
                 *options])


def test_a_weight_gives_the_drives_of_the_arm(files, drives, tmp_path, capsys):
    output = tmp_path / 'calibrated.yaml'
    assert run(files, output, 'tool', '--with-weight', str(files / 'weight'), *WEIGHT,
               '--tool-link', 'tool0', '--parameters', str(files / 'arm.yaml')) == 0
    values = read_parameter_file(output)
    arm = arm_from_parameters(default_arm_urdf(), values)
    assert len(values.pop('effort.report_covariance')) == 10
    assert (np.sqrt(np.diag(arm.report.covariance)) < 1e-8).all()  # recordings without noise
    np.testing.assert_allclose(arm.report.torque(drives.offset), 0.0, atol=1e-3)
    np.testing.assert_allclose(values.pop('effort.report_scale'), drives.scale, rtol=2e-5)
    np.testing.assert_allclose(values.pop('effort.report_offset'), drives.offset, atol=1e-3)
    given = read_parameter_file(files / 'arm.yaml')
    del given['effort.report_scale']
    assert values == given
    simulated = read_parameter_file(output, 'simulated_arm')
    assert simulated['effort.report_scale'] == [0.8, 1.25]
    printed, errors = capsys.readouterr()
    assert errors == ''
    assert 'Verdict on 2 joints: 2 good.' in printed
    assert 'tool: 16 holds, 8 poses approached from both sides' in printed
    assert 'ros2 dynamics payload tool0 1.5 --com 0.0300 0.0000 0.1000' in printed
    page = (tmp_path / 'calibrated.html').read_text(encoding='utf-8')
    assert 'The known weight determines the scales.' in page
    assert page.count('data:image/png;base64,') == 2


def test_the_text_of_the_parameter_file(files, tmp_path):
    output = tmp_path / 'x' / 'calibrated.yaml'
    assert run(files, output, 'bare', '--parameters', str(files / 'arm.yaml')) == 0
    text = output.read_text(encoding='utf-8')
    lines = text.replace('\n        ', ' ').splitlines()  # without the breaks of long arrays
    first = next(i for i, line in enumerate(lines) if not line.startswith('#'))
    assert lines[0] == '# Effort scale and offset by `calibrate_gravity` from bare.'
    assert lines[1].startswith('# Assumed: the masses and centres of mass of the URDF are right.')
    found = read_parameter_file(output)
    assert lines[first:] == GIVEN.replace('    effort.report_scale: [1.0, 1.0]', f"""\
    effort:
      report_scale: {found['effort.report_scale']}
      report_offset: {found['effort.report_offset']}
      report_covariance: {found['effort.report_covariance']}""").splitlines()


def test_without_a_parameter_file_the_joints_are_written(files, tmp_path):
    output = tmp_path / 'calibrated.yaml'
    assert run(files, output, 'tool', '--tool-link', 'tool0', '--tool-mass', '1.5') == 0
    assert list(read_parameter_file(output)) == [
        'joints', 'effort.report_scale', 'effort.report_offset', 'effort.report_covariance']
    assert read_parameter_file(output)['joints'] == ['joint1', 'joint2']


def test_values_are_in_the_order_of_the_joints_of_the_file(files, tmp_path, drives):
    parameters = tmp_path / 'arm.yaml'
    parameters.write_text(
        '/**:\n  ros__parameters:\n    joints: [joint2, joint1]\n', encoding='utf-8')
    output = tmp_path / 'calibrated.yaml'
    assert run(files, output, 'bare', '--parameters', str(parameters)) == 0
    values = read_parameter_file(output)
    np.testing.assert_allclose(values['effort.report_scale'], drives.scale[::-1], rtol=2e-5)


def test_recorded_commands_give_the_calibration_of_the_command(files, drives, tmp_path, capsys):
    """A drive whose report is right by 30 %, and whose command acts reversed, by a half."""
    record_holds(
        tmp_path / 'both', drives, poses_of(drives.arm, 8), command_scale=np.array([-0.5, 1.5]))
    output = tmp_path / 'calibrated.yaml'
    assert run(files, output, str(tmp_path / 'both')) == 0
    values = read_parameter_file(output)
    np.testing.assert_allclose(values['effort.report_scale'], drives.scale, rtol=2e-5)
    np.testing.assert_allclose(values['effort.command_scale'], [-0.5, 1.5], rtol=2e-5)
    np.testing.assert_allclose(values['effort.command_offset'], [0.0, 0.0], atol=1e-3)
    printed, _ = capsys.readouterr()
    assert 'Torque at the joint = effort scale · (commanded effort − effort offset):' in printed


def test_previous_values_of_an_unobservable_joint_are_kept(files, drives):
    settings = AnalysisSettings(default_arm_urdf(), parameters={
        'joints': ['joint2', 'joint1'], 'effort.report_scale': [1.1, 0.9],
        'effort.report_offset': [0.2]})
    recorded = read_holds([files / 'bare'], settings)
    first = np.array(recorded.arm.joint_names) == 'joint1'
    one_side = [hold._replace(approach=np.where(first, 0, hold.approach))
                for hold in recorded.holds]
    found = calibrate_holds(recorded.arm, one_side)
    assert found.is_observable.tolist() == (~first).tolist()
    assert (found.scale[first], found.offset[first]) == (0.9, 0.2)
    limit = recorded.arm.report.limit[first]
    unknown = [np.flatnonzero(first)[0], 2 + np.flatnonzero(first)[0]]
    np.testing.assert_allclose(
        found.covariance[np.ix_(unknown, unknown)],
        np.diag([(0.3 * 0.9)**2, (0.05 * float(limit[0]))**2]), rtol=0.2)
    assert not found.covariance[np.ix_(unknown, [i for i in range(4) if i not in unknown])].any()
    by_name = dict(zip(drives.arm.joint_names, drives.scale))
    np.testing.assert_allclose(found.scale[~first], by_name['joint2'], rtol=2e-5)


def test_values_that_the_nodes_refuse_are_not_written(files, drives, tmp_path, capsys):
    wrong = replace(drives, scale=np.array([1.0, 7.0]))
    record_holds(tmp_path / 'wrong', wrong, poses_of(drives.arm, 8))
    output = tmp_path / 'calibrated.yaml'
    assert run(files, output, str(tmp_path / 'wrong')) == 1
    printed, errors = capsys.readouterr()
    assert not output.exists()
    assert (tmp_path / 'calibrated.html').is_file()
    assert 'the scale is not in ±[0.2, 5]' in printed
    assert errors == (f'calibrate_gravity: {output} is not written, because the nodes would not '
                      'accept all values\n')


@pytest.mark.parametrize(('options', 'message'), [
    (['--weight-mass', '2'],
     'expected --with-weight, --weight-mass and --weight-link together, or none of them'),
    (['--tool-link', 'tool0'],
     '--tool-link is given without --tool-mass, expected it, or --with-weight: effort scale and '
     'mass are confounded'),
    (['--tool-mass', '1'], '--tool-mass is given, expected --tool-link with it'),
    (['--with-weight', 'weight', '--weight-mass', '-1', '--weight-link', 'tool0'],
     '--weight-mass is -1, expected a number in (0, 1e+09]'),
])
def test_incomplete_options_are_refused(options, message, files, tmp_path, capsys):
    assert run(files, tmp_path / 'x.yaml', 'bare', *options) == 2
    assert capsys.readouterr().err.startswith(f'calibrate_gravity: {message}')


def test_an_effort_without_gravity_is_refused(files, tmp_path, capsys):
    parameters = tmp_path / 'arm.yaml'
    parameters.write_text('/**:\n  ros__parameters:\n    measured_effort: none\n')
    assert run(files, tmp_path / 'x.yaml', 'bare', '--parameters', str(parameters)) == 2
    assert capsys.readouterr().err == (
        "calibrate_gravity: measured_effort is 'none', expected an effort that includes gravity\n")


def test_output_files_are_not_replaced(files, tmp_path, capsys):
    for name in ('a.yaml', 'b.html'):
        path = tmp_path / name
        path.write_text('mine', encoding='utf-8')
        assert run(files, path.with_suffix('.yaml'), 'bare') == 2
        assert f'output {str(path)!r} exists' in capsys.readouterr().err
    assert run(files, tmp_path / 'a.yaml', 'bare', '--force') == 0
    assert read_parameter_file(tmp_path / 'a.yaml')['joints'] == ['joint1', 'joint2']
