# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The tool `analyze`: its output, its files, its exit status."""

import csv
import re
import shutil

import numpy as np
import pytest
from recordings import cut, KnownMotion, stored_file, write_recording
from report_page import ReportPage
import robot_dynamics
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.commands.analyze import main
from robot_dynamics_tools.recordings.reader import Recording, stack

MOTION = KnownMotion()
JOINTS = ('joint1', 'joint2')


@pytest.fixture(scope='module')
def directory(tmp_path_factory):
    """Return a folder: a URDF, a complete, a truncated and an empty recording, and a text file."""
    path = tmp_path_factory.mktemp('analyze')
    (path / 'arm.urdf').write_text(default_arm_urdf())
    write_recording(path / 'bags' / 'whole', MOTION.messages())
    cut(stored_file(write_recording(path / 'bags' / 'cut', MOTION.messages(), 'sqlite3')), 0.6)
    empty = write_recording(path / 'bags' / 'deep' / 'empty', MOTION.messages())
    stored_file(empty).write_bytes(b'')
    lone = stored_file(write_recording(path / 'elsewhere', MOTION.messages(), 'mcap_chunk'))
    lone.rename(path / 'bags' / 'lone.mcap')
    return path


@pytest.fixture(scope='module')
def written(directory):
    """Return the outputs of the whole recording."""
    out = directory / 'out'
    assert main([str(directory / 'bags' / 'whole'), '--urdf', str(directory / 'arm.urdf'),
                 '--output', str(out), '--parquet']) == 0
    return out


def run(directory, capsys, *arguments):
    """Return the exit status, the output and the error output."""
    status = main([*map(str, arguments), '--urdf', str(directory / 'arm.urdf')])
    return status, *capsys.readouterr()


def test_the_console(directory, capsys):
    status, out, err = run(directory, capsys, directory / 'bags' / 'whole')
    assert status == 0
    assert [line.split()[:2] for line in err.splitlines()] == [
        ['30', '%'], ['60', '%'], ['100', '%']]  # one line per step
    lines = out.splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith('joint '))
    for line, name, rms in zip(lines[head + 1:], JOINTS, np.sqrt(np.mean(MOTION.tau**2, axis=0))):
        cells = line.split()
        assert cells[0] == name
        assert float(cells[1]) == pytest.approx(rms, rel=0.1)
        assert float(cells[5]) < 0.5  # relative, in percent
        assert float(cells[-1]) > 0.999


def test_the_report_begins_with_the_verdict_names_its_origin_and_needs_nothing_else(
    directory, written,
):
    page = ReportPage((written / 'report.html').read_text(encoding='utf-8'))
    assert page.is_complete
    assert len(page.links) == 2
    assert (written / 'report.png').read_bytes().startswith(b'\x89PNG')
    places = [page.text.index(words) for words in (
        'Verdict on 2 joints: 2 good.', 'the model predicts the effort', 'use the model',
        str(directory / 'arm.urdf'), f'robot_dynamics {robot_dynamics.__version__}',
        f"command analyze {directory / 'bags' / 'whole'} --urdf", 'Effort over time')]
    assert places == sorted(places)


def test_the_table_has_every_sample_and_adds_up(written):
    with (written / 'samples.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert [int(row['stamp [ns]']) for row in rows] == MOTION.stamps_ns.tolist()
    for name in JOINTS:
        def column(what, name=name):
            return np.array([float(row[f'{name}.{what}']) for row in rows])

        terms = sum(column(f'{term} [N m]') for term in (
            'inertial', 'coriolis', 'gravity', 'friction'))
        np.testing.assert_allclose(column('model [N m]'), terms, atol=1e-6)
        np.testing.assert_allclose(
            column('residual [N m]'), column('measured [N m]') - column('model [N m]'), atol=1e-6)
    assert {row['counts'] for row in rows} == {'0', '1'}


def test_parquet_has_the_same(written):
    parquet = pytest.importorskip('pyarrow.parquet')
    table = parquet.read_table(written / 'samples.parquet')
    with (written / 'samples.csv').open(newline='') as file:
        rows = list(csv.reader(file))
    assert table.column_names == rows[0]
    assert table['stamp [ns]'].to_pylist() == MOTION.stamps_ns.tolist()
    values = np.array([[float(cell) for cell in row[2:]] for row in rows[1:]])
    np.testing.assert_allclose(
        np.column_stack([table[name].to_numpy() for name in rows[0][2:]]), values, rtol=1e-9)


def test_the_terms_are_a_recording_on_the_original_stamps(written):
    fields = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')
    with Recording(written / 'terms') as recording:
        assert recording.topic('/dynamics/terms').message_type == (
            'robot_dynamics_interfaces/msg/DynamicsTerms')
        messages = list(recording.messages('/dynamics/terms'))
        residual = recording.joint_series('/dynamics_monitor/residual')
    stamps, terms = stack(messages, fields)
    np.testing.assert_array_equal(stamps, MOTION.stamps_ns)
    assert [time_ns for time_ns, _ in messages] == MOTION.stamps_ns.tolist()
    np.testing.assert_allclose(sum(terms[name] for name in fields[:-1]), terms['effort'])
    k, inside = 600, slice(200, -200)
    one = ArmDynamics(MOTION.arm).terms(MOTION.q[k], MOTION.v[k], MOTION.a[k])
    np.testing.assert_allclose(terms['gravity'][k], one.gravity, atol=0.05)
    assert messages[k][1].potential_energy == pytest.approx(one.potential_energy, abs=0.05)
    assert messages[k][1].kinetic_energy == pytest.approx(one.kinetic_energy, abs=0.05)
    np.testing.assert_allclose(
        residual.effort[inside], (MOTION.tau - terms['effort'])[inside], atol=0.1)


def test_a_folder_of_recordings(directory, capsys, tmp_path):
    """The outputs inside of the folder are no recordings in the next run."""
    shutil.copytree(directory / 'bags', tmp_path / 'bags')
    out = tmp_path / 'bags' / 'out'
    arguments = (tmp_path / 'bags', '--output', out, '--no-report', '--jobs', 1)
    status, said, err = run(directory, capsys, *arguments)
    assert status == 1  # one recording is cut off, one is empty
    assert [line.split()[0] for line in said.splitlines()[1:3]] == ['lone.mcap', 'whole']
    assert 'Together: 2 recordings of planar_arm' in said
    assert 'analyze: recordings that could not be used: 2\n  cut: cut.db3 is damaged: ' in err
    assert 'it is empty' in err
    for name in ('lone.mcap', 'whole'):
        assert (out / name / 'samples.csv').exists()
        assert not (out / name / 'report.html').exists()
    status, said, _ = run(directory, capsys, *arguments)
    assert (status, '2 of them from an earlier run' in said) == (1, True)


@pytest.mark.parametrize(('arguments', 'words'), [
    (['{bags}/whole', '--parquet'], '--parquet is given without --output'),
    (['{bags}/nothing'], "'.*nothing' does not exist, expected a file .mcap or .db3"),
    (['{bags}/whole', '--map', 'a'], "'a', expected two names such as fer_joint1=panda_joint1"),
    (['{bags}/whole', '--map', 'a=b'], '--map a=b matches no joint'),
    (['{bags}/whole', '--urdf', '/nowhere.urdf'], "--urdf is '/nowhere.urdf'"),
])
def test_mistakes_get_one_clear_message(directory, capsys, arguments, words):
    given = [text.format(bags=directory / 'bags') for text in arguments]
    given += [] if '--urdf' in given else ['--urdf', str(directory / 'arm.urdf')]
    try:
        status = main(given)
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    out, err = capsys.readouterr()
    assert out == ''
    lines = [line for line in err.splitlines() if not line.endswith(' steps')]  # the progress
    assert lines[0].startswith('analyze: ')
    assert re.search(words, err)
