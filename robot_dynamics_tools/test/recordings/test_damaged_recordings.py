# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Damaged recordings: readable data are returned unchanged, and losses are reported."""

from functools import cache
import shutil
import sqlite3
import struct
import sys

import numpy as np
import pytest

pytest.importorskip('rosbags')
from recordings import (  # noqa: E402
    cut,
    KnownMotion,
    stored_file,
    write_recording,
    write_split,
)
from robot_dynamics.exceptions import MissingDependencyError, RecordingError  # noqa: E402
from robot_dynamics_tools.recordings.bag_files import find_recordings  # noqa: E402
from robot_dynamics_tools.recordings.reader import Recording  # noqa: E402

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

MOTION = KnownMotion(seconds=30.0)
MESSAGES = MOTION.messages()
WHOLE = len(MESSAGES)
SOME_FORMATS = ('mcap', 'mcap_chunk', 'sqlite3', 'sqlite3_file')
"""The others differ in the compression only, which takes long."""
LONG_MOTION = KnownMotion(seconds=100.0)
"""Of more than one chunk."""


@pytest.fixture(scope='module')
def recordings(tmp_path_factory):
    """Return a function that returns the recording of a format."""
    directory = tmp_path_factory.mktemp('formats')
    return cache(lambda form: write_recording(directory / form, MESSAGES, form))


@pytest.fixture(scope='module')
def long_recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp('long') / 'bag', LONG_MOTION.messages())


@pytest.fixture
def copied(recordings, tmp_path):
    """Return a function that copies the recording of a format."""
    return lambda form: shutil.copytree(recordings(form), tmp_path / form)


def read(path):
    """Return the series, and the reported losses."""
    with Recording(path) as recording:
        series = recording.joint_series(recording.joint_state_topic())
        return series, list(recording.losses), list(recording.notes)


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
        series, losses, notes = read(path)
        assert len(series.stamps_ns) == WHOLE
        assert_part_of_it(series)
        assert losses == []
        assert notes == []
        assert series.faults.words() == []


@pytest.mark.parametrize('form', ['mcap', 'sqlite3'])
def test_split_recordings_are_one(tmp_path, form):
    path = write_split(tmp_path / 'bag', MESSAGES, 3, form)
    series, losses, notes = read(path)
    assert len(series.stamps_ns) == WHOLE
    assert losses == notes == []
    (path / 'metadata.yaml').unlink()
    series, losses, (note,) = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == WHOLE
    assert 'without metadata.yaml' in note
    assert find_recordings([tmp_path]) == [path]


def test_chunks_in_lz4_without_an_index(recordings, tmp_path):
    """As from some writers; rosbags does not write LZ4, so the test compresses a chunk."""
    lz4 = pytest.importorskip('lz4.frame')
    data = stored_file(recordings('mcap')).read_bytes()
    (length,) = struct.unpack_from('<Q', data, 9)
    at = 17 + length
    (chunk_length,) = struct.unpack_from('<Q', data, at + 1)
    first, last, size, _, no_name, stored = struct.unpack_from('<QQQIIQ', data, at + 9)
    assert (data[at], no_name, stored) == (6, 0, size)
    packed = lz4.compress(data[at + 9 + 40:at + 9 + chunk_length])
    body = struct.pack('<QQQII', first, last, size, 0, 3) + b'lz4' + struct.pack(
        '<Q', len(packed)) + packed
    chunk = struct.pack('<BQ', 6, len(body)) + body
    end = struct.pack('<BQI', 15, 4, 0) + struct.pack('<BQQQI', 2, 20, 0, 0, 0) + data[:8]
    path = tmp_path / 'lz4.mcap'
    path.write_bytes(data[:at] + chunk + end)
    series, losses, _ = read(path)
    assert_part_of_it(series)
    assert losses == []
    assert series.stamps_ns[-1] == last
    path.write_bytes((data[:at] + chunk)[:-len(packed) // 2])
    half, losses, _ = read(path)
    assert_part_of_it(half)
    assert 0 < len(half.stamps_ns) < len(series.stamps_ns)
    assert 'cut off' in losses[0].reason


# --- missing parts -------------------------------------------------------------------------------

def test_a_missing_file_of_a_split_recording(tmp_path):
    path = write_split(tmp_path / 'bag', MESSAGES, 3)
    (path / 'bag_1.mcap').unlink()
    series, losses, _ = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == 2 * WHOLE // 3
    missing = losses[0]
    assert (missing.file, missing.lost_messages) == ('bag_1.mcap', WHOLE // 3)
    assert (missing.start_ns, missing.end_ns) == (
        MESSAGES[WHOLE // 3][0], MESSAGES[2 * WHOLE // 3 - 1][0])
    assert missing.words(MESSAGES[0][0]) == (
        'bag_1.mcap: listed in metadata.yaml and missing; lost: 1000 messages, from 10.000 s to '
        '19.990 s')
    assert series.faults.dropped == WHOLE // 3
    (path / 'bag_1.mcap').write_bytes(b'')  # empty next to complete ones
    assert len(read(path)[0].stamps_ns) == 2 * WHOLE // 3


def test_metadata_that_disagrees(copied):
    path = copied('mcap')
    text = (path / 'metadata.yaml').read_text()
    (path / 'metadata.yaml').write_text(
        text.replace(f'message_count: {WHOLE}', 'message_count: 7'))
    _, losses, notes = read(path)
    assert losses == []
    assert notes == [f'metadata.yaml states 7 messages of /joint_states, but {WHOLE} were found']
    (path / 'metadata.yaml').write_text('rosbag2_bagfile_information: [1, 2')
    series, _, (note,) = read(path)
    assert len(series.stamps_ns) == WHOLE
    assert 'with a metadata.yaml that cannot be read' in note


def test_a_file_that_metadata_does_not_list(tmp_path):
    path = write_split(tmp_path / 'bag', MESSAGES[:2000], 2)
    more = write_recording(tmp_path / 'more', MESSAGES[2000:])
    shutil.copy(stored_file(more), path / 'bag_2.mcap')
    series, losses, notes = read(path)
    assert len(series.stamps_ns) == WHOLE
    assert losses == []
    assert "does not list ['bag_2.mcap']" in notes[0]


def test_an_empty_file(copied):
    path = copied('sqlite3_file')
    stored_file(path).write_bytes(b'')
    with pytest.raises(RecordingError, match='is empty'):
        Recording(path)


# --- truncation ----------------------------------------------------------------------------------

@pytest.mark.parametrize('form', SOME_FORMATS)
def test_of_a_cut_off_file_about_its_fraction_is_read(copied, form):
    path, fraction = copied(form), 0.4
    file = cut(stored_file(path), fraction)
    series, losses, _ = read(path)
    assert_part_of_it(_without_half_written(series))
    # The time index of sqlite3 occupies some pages anywhere in the file.
    assert (fraction - 0.25) * WHOLE < len(series.stamps_ns) <= WHOLE
    assert losses[0].file == file.name
    assert 'cut off' in ' '.join(loss.reason for loss in losses)
    if len(series.stamps_ns) < WHOLE:  # otherwise only the index was truncated
        stated = losses[-1]
        assert stated.file == 'metadata.yaml'
        assert stated.lost_messages == WHOLE - series.faults.message_count
        assert stated.end_ns == MESSAGES[-1][0]
    assert len(read(file)[0].stamps_ns) == len(series.stamps_ns)


def _without_half_written(series):
    """Return the series without a last row that sqlite3 fills with zeros after its page's end."""
    known = np.isin(series.stamps_ns, MOTION.stamps_ns)
    rows = np.searchsorted(MOTION.stamps_ns, series.stamps_ns[known])
    whole = (series.effort[known] == MOTION.tau[rows]).all(axis=1)
    assert (~whole).sum() + (~known).sum() <= 1
    return series.at(np.flatnonzero(known)[whole])


# --- random damage -------------------------------------------------------------------------------

def test_noise_in_a_chunk_costs_the_rest_of_that_chunk(long_recording, tmp_path):
    motion, path = LONG_MOTION, shutil.copytree(long_recording, tmp_path / 'bag')
    file = stored_file(path)

    def spoil(data):
        data[200_000:202_000] = np.random.default_rng(1).bytes(2000)

    resave(file, spoil)
    series, losses, _ = read(path)
    rows = np.searchsorted(motion.stamps_ns, series.stamps_ns)
    np.testing.assert_array_equal(motion.stamps_ns[rows], series.stamps_ns)
    np.testing.assert_array_equal(motion.q[rows], series.position)
    # the messages before the noise, and all messages of the next chunk
    (gap,) = np.flatnonzero(np.diff(rows) > 1)
    assert gap > 800
    assert rows[-1] == len(motion.q) - 1
    assert losses[0].file == file.name
    assert 'no record at byte' in losses[0].reason
    assert losses[0].lost_bytes > 2000


def test_a_chunk_that_fails_its_checksum_is_left_out(long_recording, tmp_path):
    motion, path = LONG_MOTION, shutil.copytree(long_recording, tmp_path / 'bag')
    file = stored_file(path)

    def spoil(data):
        # The first chunk follows the magic and the header: its CRC is at byte 24 of the record.
        (length,) = struct.unpack_from('<Q', data, 9)
        at = 8 + 9 + length
        assert data[at] == 6
        struct.pack_into('<I', data, at + 9 + 24, 12345)

    resave(file, spoil)
    series, losses, _ = read(path)
    left = len(series.stamps_ns)
    assert 0 < left < 10_000
    np.testing.assert_array_equal(series.stamps_ns, motion.stamps_ns[-left:])
    np.testing.assert_array_equal(series.effort, motion.tau[-left:])
    assert 'fails its checksum' in losses[0].reason
    assert losses[0].start_ns == motion.stamps_ns[0]
    assert losses[0].end_ns == motion.stamps_ns[-left - 1]
    assert losses[-1].lost_messages == 10_000 - left


def test_without_any_readable_message_the_reason_is_reported(copied):
    path = copied('mcap')
    stored_file(path).write_bytes(stored_file(path).read_bytes()[:300])
    with pytest.raises(RecordingError, match=r'can.* be read.*mcap\.mcap: cut off'):
        read(path)


def test_without_mcap_a_damaged_file_names_it(copied, monkeypatch):
    path = copied('mcap')
    monkeypatch.setitem(sys.modules, 'mcap', None)
    with Recording(path) as recording:
        assert recording.topics[0].message_count == WHOLE
    cut(stored_file(path), 0.5)
    with pytest.raises(MissingDependencyError, match=r'mcap\.mcap is damaged.*pip install mcap'):
        Recording(path)


def test_a_page_of_noise_in_a_database(copied):
    path = copied('sqlite3')
    file = stored_file(path)

    def spoil(data):
        page = len(data) // 4096 // 2
        data[4096 * page:4096 * (page + 1)] = bytes(4096)

    resave(file, spoil)
    series, losses, _ = read(path)
    assert_part_of_it(series)
    lost = WHOLE - len(series.stamps_ns)
    assert 0 < lost < 40
    assert [loss.lost_messages for loss in losses] == [lost, lost]
    assert losses[0].start_ns < losses[0].end_ns
    assert series.faults.dropped == lost


def test_rows_with_values_of_other_types_are_lost(copied):
    path = copied('sqlite3')
    connection = sqlite3.connect(stored_file(path))
    connection.execute("UPDATE messages SET data = 'text' WHERE id = 700")
    connection.execute("UPDATE messages SET timestamp = 'noon' WHERE id = 900")
    connection.execute("UPDATE messages SET topic_id = '' WHERE id = 1100")
    connection.commit()
    connection.close()
    series, losses, _ = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == WHOLE - 3
    assert [loss.lost_messages for loss in losses] == [3, 3]


def test_a_time_beyond_int64_is_lost(tmp_path):
    path = write_recording(tmp_path / 'bag', [*MESSAGES, (2**64 - 1, MESSAGES[-1][1])])
    series, losses, _ = read(path)
    assert_part_of_it(series)
    assert len(series.stamps_ns) == WHOLE
    assert [(loss.file, loss.lost_messages) for loss in losses] == [('metadata.yaml', 1)]


def test_a_chunk_with_an_impossible_length_is_named(copied):
    def spoil(data):
        at = 8
        while data[at] != 6:  # the first chunk
            at += 9 + int.from_bytes(data[at + 1:at + 9], 'little')
        name = at + 9 + 28  # of the compression
        length = name + 4 + int.from_bytes(data[name:name + 4], 'little')
        data[length:length + 8] = (2**63 + 1).to_bytes(8, 'little')
        del data[-30:]  # without an end, the file is read record by record

    path = copied('mcap')
    resave(stored_file(path), spoil)
    with pytest.raises(RecordingError, match='the chunk record at byte'):
        read(path)


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
        series, losses, _ = read(path)
    except RecordingError:
        return
    assert (np.diff(series.stamps_ns) > 0).all()
    assert np.isfinite(series.position).all()
    assert all(loss.words() for loss in losses)


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
        states = recording.joint_states('/joint_states')
        assert len(states.times_ns) == WHOLE + 100
        assert any('journal' in note for note in recording.notes)
