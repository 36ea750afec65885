# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Whole recordings: what the library and `analyze` read.

Those that rosbag2 itself wrote are outside of the repository; the others are made here.
"""

import re

import pytest

pytest.importorskip('rosbags')
pytest.importorskip('scipy')
pytest.importorskip('matplotlib')
from recordings import MADE, recording_path, recordings_of  # noqa: E402
from robot_dynamics.planar.urdf import default_arm_urdf  # noqa: E402
from robot_dynamics_tools.commands import analyze  # noqa: E402
from robot_dynamics_tools.recordings.reader import Recording  # noqa: E402
import yaml  # noqa: E402

CONVERTED = ('mcap_chunks_zstd', 'mcap_split_zstd', 'sqlite3_zstd')
"""Conversions of the recording `sqlite3_lock_step`."""
ALL = ('made_sqlite3', 'mcap', 'sqlite3_lock_step', *CONVERTED)
ORIGINAL = {
    **{name: 'made_sqlite3' for name in MADE if name != 'made_sqlite3'},
    **dict.fromkeys(CONVERTED, 'sqlite3_lock_step')}
"""The recording with the same messages in another format, by name."""


@pytest.fixture(scope='module')
def directory(tmp_path_factory):
    return tmp_path_factory.mktemp('recordings')


@pytest.fixture
def urdf(tmp_path):
    file = tmp_path / 'arm.urdf'
    file.write_text(default_arm_urdf(), encoding='utf-8')
    return str(file)


@pytest.mark.parametrize('name', recordings_of(ALL))
def test_every_message_that_the_metadata_count_is_read(name, directory):
    path = recording_path(name, directory)
    about = yaml.safe_load((path / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    counts = {topic['topic_metadata']['name']: topic['message_count']
              for topic in about['topics_with_message_count']}
    with Recording(path) as recording:
        read = {topic.name: sum(1 for _ in recording.raw_messages(topic.name))
                for topic in recording.topics}
        assert recording.notes == []
    assert read == counts
    assert sum(read.values()) == about['message_count']


@pytest.mark.parametrize('name', recordings_of(ORIGINAL))
def test_conversions_have_the_same_messages(name, directory):
    original = recording_path(ORIGINAL[name], directory)
    with Recording(original) as one, Recording(recording_path(name, directory)) as other:
        terms = () if name in MADE else ('/dynamics/terms',)
        for topic in ('/joint_states', '/effort_command', *terms):
            assert list(one.raw_messages(topic)) == list(other.raw_messages(topic))


@pytest.mark.parametrize('name', recordings_of(['made_mcap', 'mcap', 'sqlite3_lock_step']))
def test_analyze(name, urdf, capsys, directory):
    assert analyze.main([str(recording_path(name, directory)), '--urdf', urdf]) == 0
    relative = [float(share) for share in re.findall(
        r'^joint\d .*?([\d.]+) % +[-+]?[\d.]+ N', capsys.readouterr().out, re.MULTILINE)]
    assert len(relative) == 2
    assert max(relative) < 0.5  # the arm was simulated with this model
