# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states of CSV files and of data sets of LeRobot."""

import json

import numpy as np
import pytest
from recordings import KnownMotion
from robot_dynamics.exceptions import InvalidInputError, RecordingError
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings, read_for_arm
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robots import robot_urdf

URDF = robot_urdf('ur10')
MOTION = KnownMotion(seconds=4.0, urdf=URDF, rest=-0.8)
TIMES = 1e-9 * (MOTION.stamps_ns - MOTION.stamps_ns[0])


def csv_file(path, head, *columns, separator=','):
    np.savetxt(path, np.column_stack(columns), delimiter=separator, header=separator.join(head),
               comments='')
    return path


def read(path, **settings):
    return read_for_arm(path, AnalysisSettings(urdf=URDF, **settings))


@pytest.mark.parametrize(('pattern', 'time', 'factor', 'separator', 'words'), [
    ('{}.{} [rad]', 'time [s]', 1.0, ',', 'time in s'), ('{1}_{0}', 't', 1e3, ';', 'time in ms'),
    ('{} {}', 'stamp_ns', 1e9, ',', 'time in ns, by its header')])
def test_a_table_is_that_recording(tmp_path, pattern, time, factor, separator, words):
    quantities = {'position': MOTION.q, 'velocity': MOTION.v, 'effort': MOTION.tau}
    head = [time, *(pattern.format(joint, quantity) for quantity in quantities
                    for joint in MOTION.names), 'comment']
    path = csv_file(tmp_path / 'a.csv', head, 1000.0 + factor * TIMES, *quantities.values(),
                    0.0 * TIMES, separator=separator)
    found = read(path)
    for name, values in quantities.items():
        assert getattr(found.series, name) == pytest.approx(values, abs=1e-9)
    assert found.series.times == pytest.approx(TIMES, abs=1e-6)
    assert any(words in remark for remark in found.remarks)


def test_degrees_of_a_table_are_converted_and_said(tmp_path):
    """Columns that are named, and velocities in rad/s."""
    head = ['t', *(f'a{i}' for i in range(6)), *(f'qd_{joint}' for joint in MOTION.names)]
    path = csv_file(tmp_path / 'a.csv', head, TIMES, 3.0 * np.degrees(MOTION.q), 3.0 * MOTION.v)
    columns = tuple((f'{joint}.position', f'a{i}') for i, joint in enumerate(MOTION.names))
    found = read(path, columns=columns)
    assert found.series.position == pytest.approx(3.0 * MOTION.q, abs=1e-9)
    assert found.series.velocity == pytest.approx(3.0 * MOTION.v, abs=1e-9)
    assert any('positions in degrees' in remark for remark in found.remarks)


@pytest.mark.parametrize('version', ['v3.0', 'v2.1'])
def test_a_data_set_of_lerobot(tmp_path, version):
    pyarrow, parquet = pytest.importorskip('pyarrow'), pytest.importorskip('pyarrow.parquet')
    names = [f'{joint}.pos' for joint in MOTION.names]
    features = {'observation.state': {'names': names if version == 'v3.0' else {'motors': names}},
                'observation.image': {}, 'action': {'names': names}}
    (tmp_path / 'meta').mkdir()
    (tmp_path / 'data/chunk-000').mkdir(parents=True)
    (tmp_path / 'meta/info.json').write_text(json.dumps(
        {'codebase_version': version, 'fps': 100, 'features': features}))
    half = len(TIMES) // 2
    tables = [pyarrow.table({
        'observation.state': np.degrees(MOTION.q[part]).tolist(),
        'episode_index': [k] * half, 'frame_index': list(range(half))})
        for k, part in enumerate((slice(0, half), slice(half, None)))]
    if version == 'v3.0':
        tables = [pyarrow.concat_tables(tables)]
    for k, table in enumerate(tables):
        parquet.write_table(table, tmp_path / f'data/chunk-000/file-{k:03d}.parquet')
    assert find_recordings([tmp_path]) == [tmp_path]
    with pytest.raises(InvalidInputError, match='expected --unit deg or --unit range'):
        read(tmp_path)
    found = read(tmp_path, unit='deg')
    assert found.series.position == pytest.approx(MOTION.q)
    assert [len(rows) for rows in found.series.stretches()] == [half, half]


def test_other_files_are_named(tmp_path):
    for name, words in (
            ('a.bag', 'rosbags-convert --src'), ('a.txt', 'is a file .txt, expected a file')):
        (tmp_path / name).write_text('text')
        with pytest.raises(RecordingError, match=words):
            find_recordings([tmp_path / name])
    path = csv_file(tmp_path / 'a.csv', ['a', 'b'], TIMES, TIMES)
    with pytest.raises(RecordingError, match=r"has the columns \['a', 'b'\], expected a time and"):
        read(path)
