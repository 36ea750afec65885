# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A recording that expands to far more than its size is rejected; other recordings are read."""

import subprocess
import sys

import children
from fault_table import fault
import pytest
from recordings import START_NS, stored_file, write_recording
from robot_dynamics_tools.recordings import storage
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.recordings.storage import Budget, DecompressionLimitError, zstd_module

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
