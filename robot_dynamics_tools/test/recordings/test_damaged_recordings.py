# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged recordings: the error names the file and the program that repairs it."""

from functools import cache
import shutil
import sqlite3
import subprocess
import sys

import children
from fault_table import fault
import numpy as np
import pytest
from recordings import (
    cut,
    KnownMotion,
    START_NS,
    stored_file,
    write_recording,
    write_split,
)
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings import storage
from robot_dynamics_tools.recordings.bag_files import find_recordings
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.storage import Budget, DecompressionLimitError, zstd_module

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

MOTION = KnownMotion(seconds=30.0)
MESSAGES = MOTION.messages()
WHOLE = len(MESSAGES)
SOME_FORMATS = ('mcap', 'mcap_chunk', 'sqlite3', 'sqlite3_file')
"""The others differ in the compression only, which takes long."""


@pytest.fixture(scope='module')
def recordings(tmp_path_factory):
    """Return a function that returns the recording of a format."""
    directory = tmp_path_factory.mktemp('formats')
    return cache(lambda form: write_recording(directory / form, MESSAGES, form))


@pytest.fixture
def copied(recordings, tmp_path):
    """Return a function that copies the recording of a format."""
    return lambda form: shutil.copytree(recordings(form), tmp_path / form)


def read(path):
    """Return the series, and the notes."""
    with Recording(path) as recording:
        series = recording.joint_series(recording.joint_state_topic())
        return series, list(recording.notes)


def assert_part_of_it(series):
    """Check that every sample is one of the written samples, with its stamp."""
    rows = np.searchsorted(MOTION.stamps_ns, series.stamps_ns)
    np.testing.assert_array_equal(MOTION.stamps_ns[rows], series.stamps_ns)
    np.testing.assert_array_equal(series.position, MOTION.q[rows])
    np.testing.assert_array_equal(series.velocity, MOTION.v[rows])
    np.testing.assert_array_equal(series.effort, MOTION.tau[rows])


def resave(file, change):
    data = bytearray(file.read_bytes())
    change(data)
    file.write_bytes(data)


# --- undamaged -----------------------------------------------------------------------------------

@pytest.mark.parametrize('form', SOME_FORMATS)
def test_every_format_is_read_as_directory_and_as_file(recordings, form):
    for path in (recordings(form), stored_file(recordings(form))):
        series, notes = read(path)
        assert len(series.stamps_ns) == WHOLE
        assert_part_of_it(series)
        assert notes == []
        assert series.faults.words() == []


@pytest.mark.parametrize('form', ['mcap', 'sqlite3'])
def test_split_recordings_are_one(tmp_path, form):
    path = write_split(tmp_path / 'bag', MESSAGES, 3, form)
    series, notes = read(path)
    assert len(series.stamps_ns) == WHOLE
    assert notes == []
    (path / 'metadata.yaml').unlink()
    series, (note,) = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == WHOLE
    assert 'without metadata.yaml' in note
    assert find_recordings([tmp_path]) == [path]


def test_files_that_are_missing_or_not_listed_are_notes(tmp_path):
    more = write_split(tmp_path / 'more', MESSAGES[:2000], 2)
    last = write_recording(tmp_path / 'last', MESSAGES[2000:])
    shutil.copy(stored_file(last), more / 'more_2.mcap')
    series, notes = read(more)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == WHOLE
    assert "does not list ['more_2.mcap']" in notes[0]
    path = write_split(tmp_path / 'bag', MESSAGES, 3)
    (path / 'bag_1.mcap').unlink()
    series, notes = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == 2 * WHOLE // 3
    assert notes[0] == 'bag_1.mcap: listed in metadata.yaml and missing'
    assert series.faults.words()[0].startswith(f'dropped: about {WHOLE // 3} samples, in 1 gap ')
    assert notes[1] == (
        f'metadata.yaml states {WHOLE} messages of /joint_states, but {2 * WHOLE // 3} were found')


@pytest.mark.parametrize('fraction', [0.0, 0.002, 0.5, 0.9])
@pytest.mark.parametrize(('form', 'repair'), [
    ('mcap', 'mcap recover mcap.mcap -o'), ('mcap_chunk', 'mcap recover mcap_chunk.mcap -o'),
    ('sqlite3', "sqlite3 sqlite3.db3 '.recover' | sqlite3 "),
    ('sqlite3_file', 'zstd -d sqlite3_file.db3.zstd, and then')])
def test_a_cut_off_file_is_named_with_the_command_that_repairs_it(copied, form, repair, fraction):
    path = copied(form)
    file = cut(stored_file(path), fraction)
    for each in (path, file):
        with pytest.raises(RecordingError) as caught:
            read(each)
        words = str(caught.value)
        assert words.startswith(f'{file.name} is damaged: ')
        assert f'Repair it with: {repair}' in words
        assert words.endswith('ros2 bag reindex DIRECTORY for a directory of rosbag2')


def test_a_database_with_noise_or_values_of_other_types_is_damaged(copied):
    path = copied('sqlite3')
    file = stored_file(path)
    whole = file.read_bytes()

    def spoil(data):
        page = len(data) // 4096 // 2
        data[4096 * page:4096 * (page + 1)] = bytes(4096)

    resave(file, spoil)
    with pytest.raises(RecordingError, match=r'sqlite3\.db3 is damaged: '):
        read(path)
    file.write_bytes(whole)
    connection = sqlite3.connect(file)
    connection.execute("UPDATE messages SET data = 'text' WHERE id = 700")
    connection.commit()
    connection.close()
    with pytest.raises(RecordingError, match=r'sqlite3\.db3 is damaged: a message of /joint'):
        read(path)


def test_metadata_that_disagrees(copied):
    path = copied('mcap')
    text = (path / 'metadata.yaml').read_text()
    (path / 'metadata.yaml').write_text(
        text.replace(f'message_count: {WHOLE}', 'message_count: 7'))
    _, notes = read(path)
    assert notes == [f'metadata.yaml states 7 messages of /joint_states, but {WHOLE} were found']
    (path / 'metadata.yaml').write_text('rosbag2_bagfile_information: [1, 2')
    series, (note,) = read(path)
    assert len(series.stamps_ns) == WHOLE
    assert 'with a metadata.yaml that cannot be read' in note


@pytest.mark.parametrize('form', SOME_FORMATS)
@pytest.mark.parametrize('seed', [
    0, 1, *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(2, 200))])
def test_any_damage_of_a_recording_is_handled(copied, form, seed):
    """With random bytes the reader returns samples or raises one clear error, no other."""
    rng, path = np.random.default_rng(seed), copied(form)

    def spoil(data):
        for at in rng.integers(0, len(data), 3).tolist():
            noise = rng.bytes(int(rng.integers(1, 300)))
            data[at:at + len(noise)] = noise

    resave(stored_file(path), spoil)
    try:
        series, _ = read(path)
    except RecordingError:
        return
    assert (np.diff(series.stamps_ns) > 0).all()
    assert np.isfinite(series.position).all()


def test_a_database_with_a_journal_is_read_with_what_that_holds(copied):
    path = copied('sqlite3')
    file = stored_file(path)
    connection = sqlite3.connect(file)
    connection.execute('PRAGMA journal_mode=WAL')
    connection.execute('PRAGMA wal_autocheckpoint=0')
    connection.execute('INSERT INTO messages (topic_id, timestamp, data) '
                       'SELECT topic_id, timestamp + 60000000000, data FROM messages LIMIT 100')
    connection.commit()
    killed = shutil.copytree(path, path.with_name('killed'))  # a copy taken during writing
    connection.close()
    with Recording(killed) as recording:
        assert len(recording.joint_states('/joint_states').states) == WHOLE + 100
        assert any('journal' in note for note in recording.notes)


# --- recordings that expand beyond their limit ---------------------------------------------------

COMPRESSED = ('mcap_chunk', 'mcap_message', 'mcap_file', 'sqlite3_message', 'sqlite3_file')
LIMIT = 1_000_000
TOPIC = '/joint_states'


@pytest.fixture
def _low_limit(monkeypatch):
    monkeypatch.setattr(storage, 'LEAST_LIMIT', LIMIT)


def expanding(path, form, size=10 * LIMIT):
    """Return a recording file with one message of zeros."""
    return stored_file(write_recording(path, [(START_NS, b'\0\1\0\0' + bytes(size))], form))


@pytest.mark.usefixtures('_low_limit')
@pytest.mark.parametrize('form', ['mcap_message', 'mcap_file', 'sqlite3_message'])
def test_a_file_that_expands_beyond_its_limit_is_refused(tmp_path, form):
    file = expanding(tmp_path / 'bag', form)
    words = (rf'{file.name} has {file.stat().st_size} bytes and expands to more than [0-9]+, '
             rf'expected at most 200 times its size, or {LIMIT} bytes; .*zstd -d')
    with pytest.raises(DecompressionLimitError, match=words), Recording(file) as recording:
        list(recording.raw_messages(TOPIC))


@pytest.mark.usefixtures('_low_limit')
@pytest.mark.parametrize('form', COMPRESSED)
def test_an_expansion_within_the_limit_is_read(tmp_path, form):
    file = expanding(tmp_path / 'bag', form, LIMIT // 2)
    with Recording(file) as recording:
        assert [len(data) for _, data in recording.raw_messages(TOPIC)] == [4 + LIMIT // 2]
        assert [len(data) for _, data in recording.raw_messages(TOPIC)] == [4 + LIMIT // 2]


def test_no_more_is_decompressed_than_the_limit_allows():
    data = zstd_module().compress(bytes(LIMIT))
    assert Budget('a', 0).decompress(data) == (bytes(LIMIT), True)
    part, is_whole = Budget('a', 0).decompress(data[:-1])
    assert not is_whole
    assert part == bytes(len(part))
    assert Budget('a', 2**28).limit == 200 * 2**28  # a large file may expand further
    budget = Budget('a', 0)
    for _ in range(2**28 // LIMIT):
        budget.decompress(data)
    with pytest.raises(DecompressionLimitError):
        budget.decompress(data)


@fault('External files and web pages', 'a compressed recording that expands to 1 GB of zeros',
       'rejected with the limit; uses less than 300 MB of memory')
def test_a_file_of_zeros_is_refused_in_bounded_memory(tmp_path):
    zstd = zstd_module()
    compressor, file = zstd.ZstdCompressor(), tmp_path / 'zeros.mcap.zstd'
    file.write_bytes(b''.join(
        [*(compressor.compress(bytes(10_000_000)) for _ in range(100)), compressor.flush()]))
    script = (
        'import pathlib, re, sys\n'
        'from robot_dynamics_tools.recordings.reader import Recording\n'
        'try:\n    Recording(pathlib.Path(sys.argv[1]))\n'
        'except ValueError as error:\n    print(type(error).__name__)\n'
        # of this process only: the resource usage includes memory of the parent at the fork
        'status = pathlib.Path("/proc/self/status").read_text()\n'
        'print(re.search("VmHWM: *([0-9]+) kB", status.replace(chr(9), ""))[1])')
    done = children.run(
        [sys.executable, '-c', script, str(file)], stdout=subprocess.PIPE, text=True,
        timeout=children.TIMEOUT)
    error, peak = done.stdout.split()
    assert error == 'DecompressionLimitError'
    assert int(peak) < 300_000  # [KiB]
