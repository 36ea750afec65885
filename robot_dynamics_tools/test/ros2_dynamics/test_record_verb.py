# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""`ros2 dynamics record` with real nodes."""

from collections.abc import Iterator
import json
import os
import signal
from typing import Any

import numpy as np
import pytest
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics_tools.recordings.reader import Recording
from ros_harness import DYNAMICS, MONITOR, NodeProcess, running, SIMULATED_ARM
from verb_bench import assert_refused, finish, first_line, start

TOPICS = {
    '/joint_states', '/effort_command', '/dynamics/terms', '/dynamics/computed_torque',
    '/dynamics/gravity_compensation', '/dynamics/reference', '/dynamics/payload', '/diagnostics'}


@pytest.fixture(scope='module', autouse=True)
def nodes() -> Iterator[None]:
    with running(
            NodeProcess(DYNAMICS, {'lock_step': True}),
            NodeProcess(SIMULATED_ARM, {
                'rate': 100.0, 'lock_step': True, 'real_time_factor': 1.0}),
            NodeProcess(MONITOR), NodeProcess(DYNAMICS, namespace='/idle')):
        yield


def counts(answer: dict[str, Any]) -> dict[str, int]:
    return {row['topic']: row['recorded'] for row in answer['topics']}


def test_a_recording_has_the_description_and_all_topics(ask, tmp_path):
    ask('move', '0.5', '0.5', '--duration', '1')
    for attempt in range(20):  # a loaded machine may deliver nothing in the given time
        bag = tmp_path / str(attempt)
        status, out, err = ask('record', '-o', str(bag), '--duration', '2', '--json')
        assert status == 0, err
        answer = json.loads(out)
        if all(counts(answer).values()):
            break
    assert set(counts(answer)) == TOPICS
    # Several nodes publish diagnostics, whose losses cannot be counted.
    assert [row['topic'] for row in answer['topics'] if row['lost'] is None] == ['/diagnostics']
    with Recording(bag) as recording:
        found = {topic.name: topic.message_count for topic in recording.topics}
        assert found == counts(answer) | {'/robot_description': 1}
        assert answer['recorded'] == sum(counts(answer).values())
        time_ns, message = next(iter(recording.messages('/robot_description')))
        assert '<robot name="planar_arm"' in message.data
        assert all(time_ns <= next(recording.messages(topic))[0] for topic in TOPICS)
        series = recording.joint_series(recording.joint_state_topic())
        np.testing.assert_allclose(wrap_to_pi(series.position - 0.5), 0.0, atol=5e-3)


def test_topics_by_name_and_the_table(ask, tmp_path):
    bag = tmp_path / 'bag'
    status, out, err = ask(
        'record', 'joint_states', 'dynamics_monitor/residual', '-o', str(bag), '--duration', '0.5')
    assert status == 0
    assert err == f'Recording 2 topics to {bag}; ends after 0.5 s.\n'
    lines = [line.split() for line in out.splitlines()]
    assert [line[0] for line in lines[:3]] == [
        'topic', '/joint_states', '/dynamics_monitor/residual']


def test_a_signal_ends_the_recording_in_order(tmp_path):
    """SIGTERM; the quick start of README ends one by SIGINT."""
    bag = tmp_path / 'bag'
    process = start('record', '--output', str(bag), '--json')
    assert first_line(process) == f'Recording 8 topics to {bag}; Ctrl-C ends.\n'
    process.send_signal(signal.SIGTERM)
    status, out, err = finish(process)
    assert status == 0, err
    with Recording(bag) as recording:
        assert not recording.notes
        assert {topic.name: topic.message_count for topic in recording.topics} == (
            counts(json.loads(out)) | {'/robot_description': 1})


@pytest.mark.parametrize(('words', 'said'), [
    (['/absent'], "TOPIC is '/absent', expected a topic that exists"),
    (['joint_states', '/joint_states'], "TOPIC has '/joint_states' twice, expected"),
    (['--duration', '-1'], '--duration is -1, expected'),
])
def test_invalid_arguments_of_record(ask, dynamics_client, monkeypatch, tmp_path, words, said):
    assert dynamics_client.name == '/dynamics'
    monkeypatch.setattr(dynamics_client, 'timeout', 2.0)
    bag = tmp_path / 'bag'
    assert_refused(ask, ['record', '-o', bag, *words], said)
    assert not bag.exists()


def test_a_directory_is_not_overwritten(ask, tmp_path):
    (tmp_path / 'notes').write_text('keep')
    assert_refused(ask, ['record', '-o', tmp_path],
                   f'--output is {str(tmp_path)!r}, which exists; expected a new directory')
    assert os.listdir(tmp_path) == ['notes']
