# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tool check_model, and the table in its documentation."""

from collections.abc import Callable
from importlib import metadata
from importlib.util import find_spec, module_from_spec, spec_from_file_location
import json
from pathlib import Path
import re
import subprocess
import sys
from typing import NamedTuple

import children
import pytest
from report_page import ReportPage
from robot_dynamics.model_check.finding import CHECKS
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.model_check.report import check_description, NEXT_STEPS
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.tools.check_model import main
from robots import missing, PACKAGE, robot_path

ROOT = Path(__file__).parents[2]
POINT_MASS = """<robot name="r"><link name="base"/>
  <link name="arm"><inertial><mass value="2"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><origin xyz="0 0 0.2"/><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
  <joint name="wrist" type="revolute"><parent link="base"/><child link="hand"/>
    <limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
</robot>"""


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Return a function that runs the tool in this process."""
    def run(*arguments: object) -> Done:
        try:
            status = main([*map(str, arguments)])
        except SystemExit as error:
            status = error.code
        return Done(status, *capsys.readouterr())
    return run


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    path = tmp_path / 'bad.urdf'
    path.write_text(POINT_MASS, encoding='utf-8')
    return path


def test_a_good_model(run, tmp_path):
    path = tmp_path / 'good.urdf'
    path.write_text(default_arm_urdf(), encoding='utf-8')
    done = run(path)
    assert (done.returncode, done.stderr) == (0, '')
    lines = done.stdout.splitlines()
    assert lines[:2] == ['Errors: 0', 'Warnings: 0']
    checked = check_description(default_arm_urdf(), meshes=MeshReader(tmp_path))
    assert ' '.join(lines[2:-1]) == f'Scope: {checked.scope}'
    assert lines[-1] == f'{path}: no errors'


def test_a_robot_is_given_by_name_or_package(run):
    robot_path('ur3')
    named = run('ur3', '--joints', 'wrist_3_joint')
    assert (named.returncode, named.stderr) == (0, '')
    assert named.stdout.splitlines()[-1] == 'ur3: no errors'
    unknown = run('package://unknown_package/arm.urdf')
    assert unknown.returncode == 2
    assert "there is no package 'unknown_package'" in unknown.stderr


def test_errors_and_warnings_by_level(run, bad):
    done = run(bad)
    assert (done.returncode, done.stderr) == (1, '')
    errors, warnings = done.stdout.split('Warnings: 2')
    assert re.search(r"^Errors: 1\n  inertia +joint 'hinge' moves 2 kg and no moment", errors)
    assert 'point mass' in warnings
    assert "joint 'wrist' has no effort limit" in warnings
    assert warnings.splitlines()[-1] == f'{bad}: 1 error'
    assert 100 < max(map(len, done.stdout.splitlines()[:-1])) <= 110
    ignored = run(bad, '--ignore', 'inertia', 'mass')
    assert ignored.returncode == 0
    assert '(ignored)' in ignored.stdout
    assert ignored.stdout.splitlines()[-1] == f'{bad}: accepted, as the errors are ignored'
    locked = run(bad, '--joints', 'wrist')
    assert locked.returncode == 0
    assert 'hinge' not in locked.stdout


def test_a_negative_mass_and_unread_geometry_are_reported(run, bad):
    bad.write_text(POINT_MASS.replace('value="2"', 'value="-2"'), encoding='utf-8')
    done = run(bad)
    assert done.returncode == 1
    assert re.search(r"mass +mass of link 'arm' is -2 kg, expected a positive", done.stdout)
    bad.write_text(POINT_MASS.replace(
        '<link name="arm">', '<link name="arm"><visual><geometry><mesh filename="no.stl"/>'
        '</geometry></visual>'), encoding='utf-8')
    assert 'Scope: links compared with their shapes and meshes (not compared: 1 link);' in (
        run(bad).stdout)


def test_the_report_begins_with_verdicts_per_joint_and_names_its_origin(run, bad, tmp_path):
    done = run(bad, '--report', tmp_path / 'new' / 'check.html')
    assert done.stdout == run(bad).stdout
    page = ReportPage((tmp_path / 'new' / 'check.html').read_text(encoding='utf-8'))
    assert page.is_complete
    places = [page.text.index(words) for words in (
        'Verdict on 4 joints, links and the whole arm: 1 good, 2 to check, 1 bad.',
        "hinge bad joint 'hinge' moves 2 kg",
        'new export from CAD', "wrist check joint 'wrist' has no effort limit",
        'add the limit from the data sheet', 'arm check', 'whole arm good no findings',
        str(bad), f'command check_model {bad} --report', 'Findings')]
    assert places[0] < min(places[1:])
    assert places[-3:] == sorted(places[-3:])
    assert max(places[:-3]) < places[-3]
    assert set(NEXT_STEPS) == set(CHECKS)


def test_json(run, bad):
    done = run(bad, '--json', '--ignore', 'limits')
    assert done.returncode == 1
    data = json.loads(done.stdout)
    assert data['links_with_unread_geometry'] == []
    assert data['scope'].startswith('links compared with their shapes and meshes; ')
    assert [(f['check'], f['level'], f['where'], f['ignored']) for f in data['findings']] == [
        ('inertia', 'error', 'hinge', False), ('inertia', 'warning', 'arm', False),
        ('limits', 'warning', 'wrist', True)]


def test_without_arguments_it_explains_itself(run):
    done = run()
    assert done.returncode == 2
    assert done.stderr.startswith('usage: check_model')
    asked = run('--help')
    assert (asked.returncode, asked.stdout) == (0, done.stderr)
    for name in CHECKS:
        assert name in asked.stdout


@pytest.mark.parametrize(('arguments', 'words'), [
    (['/no/such/arm.urdf'], r"^check_model: URDF is '/no/such/arm.urdf', which cannot be read"),
    (['BAD', '--joints', 'elbow'], r"^check_model: joints has 'elbow', expected joints out of"),
    (['BAD', '--ignore', 'beauty'], r"invalid choice: 'beauty'"),
    (['TEXT'], r'^check_model: robot_description is not well-formed XML'),
])
def test_bad_usage(run, bad, tmp_path, arguments, words):
    text = tmp_path / 'text.urdf'
    text.write_text('joint1, joint2', encoding='utf-8')
    paths = {'BAD': bad, 'TEXT': text}
    done = run(*(paths.get(argument, argument) for argument in arguments))
    assert (done.returncode, done.stdout) == (2, '')
    assert re.search(words, done.stderr), done.stderr


@pytest.mark.skipif(find_spec('xacro') is None, reason='xacro is not installed')
def test_xacro(tmp_path):
    path = tmp_path / 'arm.urdf.xacro'
    path.write_text(
        POINT_MASS.replace('name="r"', 'name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"')
        .replace('value="2"', 'value="${1 + $(arg load)}"'), encoding='utf-8')
    done = children.run(  # xacro changes how minidom writes XML
        [sys.executable, '-m', 'robot_dynamics.tools.check_model', f'{path} load:=2'],
        capture_output=True, text=True)
    assert "joint 'hinge' moves 3 kg" in done.stdout


# --- the table of the documentation --------------------------------------------------------------

NUMBER = re.compile(r'(?<![\w.])\d+(?:\.\d+)?(?:e[+-]\d+)?(?![\w])')


@pytest.fixture(scope='module')
def command():
    """Return the module that writes the table of the page."""
    spec = spec_from_file_location('table', ROOT / 'docs' / 'tables' / 'model_check.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def committed(command):
    """Return the lines of the committed table; skip the test for another version of the robots."""
    robot_path('panda')
    text = command.PAGE.read_text(encoding='utf-8').split(command.BEGIN)[1].split(command.END)[0]
    try:
        version = metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        missing(f'{PACKAGE} is not installed as a wheel')
    of = re.search(rf'^\d+ robots of {PACKAGE} (\S+):$', text, re.MULTILINE)
    assert of is not None, 'the start of the table differs from the output of its command'
    if of[1] != version:
        pytest.skip(f'the table is of another version than {PACKAGE} {version}')
    return text.splitlines()


def assert_same_line(line, expected):
    """Compare text and counts exactly, figures within their rounding: engines differ slightly."""
    assert NUMBER.sub('#', line) == NUMBER.sub('#', expected)
    assert [float(n) for n in NUMBER.findall(line)] == pytest.approx(
        [float(n) for n in NUMBER.findall(expected)], rel=0.11), line


@pytest.mark.parametrize('robot', ['ur5', pytest.param('tiago_no_hand', marks=pytest.mark.soak)])
def test_the_table_has_what_the_check_finds(command, committed, robot):
    path = robot_path(robot)
    expected, = (line for line in committed if line.startswith(f'| {path.stem} |'))
    assert_same_line(command.row(path.stem, path).rstrip('\n'), expected)


def test_guide_and_readme_state_the_counts_of_the_table(command):
    text = command.PAGE.read_text(encoding='utf-8')
    rows = [line.split(' | ') for line in text.splitlines() if line.startswith('| ')][2:]
    errors = sum(row[2] != '–' for row in rows)
    clean = sum(row[2] == row[3] == '–' for row in rows)
    assert (
        f'Of its {len(rows)} robots that can be loaded, {errors} have an error, and {clean} have '
        'no finding.') in (ROOT / 'docs' / 'model_check.md').read_text(encoding='utf-8')
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    assert f'[{len(rows)} published robots](docs/evidence/model_check_robots.md)' in readme


@pytest.mark.soak
def test_the_table_is_what_the_command_writes(command, committed):
    written = command.table(command.robot_directory())
    for line, expected in zip(written.splitlines(), committed, strict=True):
        assert_same_line(line, expected)


def test_a_reader_that_ends_early_is_no_error(tmp_path):
    """As in `check_model arm.urdf | head -1`: the output breaks off without a message."""
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf(), encoding='utf-8')
    with children.popen(
            [sys.executable, '-u', '-c', 'from robot_dynamics.tools.check_model import main; '
             'import sys; sys.exit(main(["arm.urdf"]))'],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as process:
        process.stdout.close()
        assert process.stderr.read() == ''
    assert process.returncode == 141
