# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The demo as a user runs it: a process that starts real nodes."""

import io
import os
import re
import signal

from children import is_gone
from demo_process import nodes_of, relative_residuals, run_demo, start_demo, wait_for_line
import numpy as np
import pytest
from report_page import ReportPage
from robot_dynamics.model_check.html_page import Grade
from robot_dynamics_tools.demo.cli import _make_directory, main
from robot_dynamics_tools.demo.report import tracking_verdict
from robot_dynamics_tools.processes import choose_domain
from robot_dynamics_tools.recordings.reader import Recording
from robot_dynamics_tools.reporting.progress import Progress
from ros_harness import TIMEOUT, wait_until
from rosbags.highlevel import AnyReader
from scipy.interpolate import BPoly

NODE_TOPICS = {
    '/joint_states', '/effort_command', '/dynamics/gravity_compensation',
    '/dynamics/computed_torque', '/dynamics/commands', '/dynamics/terms', '/dynamics/payload',
    '/dynamics/joint_trajectory', '/clock', '/diagnostics', '/robot_description'}


def errors_of(out):
    """Return the printed RMS and largest error of each joint [rad] or [m]."""
    rows = re.findall(r'^(\w+) +(\S+) (?:mrad|mm) +(\S+) (?:mrad|mm) +10 ', out, re.MULTILINE)
    return {name: (1e-3 * float(rms), 1e-3 * float(largest)) for name, rms, largest in rows}


# --- the closed loop -----------------------------------------------------------------------------

@pytest.fixture(scope='module')
def closed_loop(tmp_path_factory):
    """Return the directory of a demo of 2 s and its output."""
    directory = tmp_path_factory.mktemp('demo')
    status, out, err = run_demo(directory, '--duration', 2, '--rate', 200, '--out', 'here')
    assert status == 0, out + err
    assert 'Traceback' not in err
    return directory / 'here', out, err


def test_it_tracks_and_reports_the_errors_and_progress_in_lines(closed_loop):
    _, out, err = closed_loop
    fractions = [int(fraction) for fraction in re.findall(r'(\d+) %', err)]
    assert fractions[-1] == 100
    assert fractions == sorted(set(fractions))
    assert '\r' not in err
    errors = errors_of(out)
    assert set(errors) == {'joint1', 'joint2'}
    for rms, largest in errors.values():
        assert 0.0 < rms < 0.01
        assert rms <= largest
    assert 'All joints tracked.' in out
    assert re.search(r'Control +\S+ %.*: 200 .*, \S+ per second\n', out)


@pytest.fixture(scope='module')
def demo_recording(closed_loop):
    """Return the opened recording, its joint states, and the trajectory."""
    with Recording(closed_loop[0] / 'recording') as recording:
        (_, sent), = recording.messages('/dynamics/joint_trajectory')
        yield recording, recording.joint_series('/joint_states'), sent


def test_the_printed_errors_are_those_of_the_recording(closed_loop, demo_recording):
    _, states, sent = demo_recording
    start = sent.header.stamp.sec * 10**9 + sent.header.stamp.nanosec
    # Here from a general interpolation of the points, which are connected by quintics.
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in sent.points]
    curve = BPoly.from_derivatives(
        times, [[p.positions, p.velocities, p.accelerations] for p in sent.points])
    t = 1e-9 * (states.stamps_ns - start)
    during = (t >= 0.0) & (t <= times[-1])
    error = curve(t[during]) - states.position[during]
    for j, name in enumerate(states.joint_names):
        rms, largest = errors_of(closed_loop[1])[name]
        assert rms == pytest.approx(np.sqrt(np.mean(error[:, j]**2)), abs=2e-6)
        assert largest == pytest.approx(np.abs(error[:, j]).max(), abs=2e-6)


def test_every_topic_is_in_the_recording_for_the_motion_and_little_longer(demo_recording):
    """Simulated time waits for the trajectory; the recording ends after the motion."""
    recording, states, sent = demo_recording
    for topic in ('/joint_states', '/effort_command', '/dynamics/computed_torque'):
        stamps = recording.joint_series(topic).stamps_ns
        assert 2.0 <= 1e-9 * (stamps[-1] - stamps[0]) <= 2.5
    first = sent.header.stamp.sec * 10**9 + sent.header.stamp.nanosec
    assert 0 <= first - states.stamps_ns[0] <= 10**8
    assert {t.name for t in recording.topics} == NODE_TOPICS
    assert not [t.name for t in recording.topics if t.message_count == 0]
    with AnyReader([recording.path]) as reader:
        latched = {one.topic for one in reader.connections
                   if one.ext.offered_qos_profiles[0].durability.name == 'TRANSIENT_LOCAL'}
    assert latched == {'/dynamics/payload', '/robot_description'}
    commands = recording.joint_series('/effort_command')
    # the recorder may lose some of either topic on a busy machine
    assert (commands.stamps_ns % 5_000_000 == 0).all()
    assert np.isin(commands.stamps_ns, states.stamps_ns).any()


def test_the_report_begins_with_a_verdict_per_joint_and_the_picture_is_not_blank(closed_loop):
    from matplotlib.image import imread
    directory, _, _ = closed_loop
    pixels = imread(directory / 'demo.png')[..., :3]
    assert 0.01 < (pixels.min(axis=2) < 0.9).mean() < 0.5
    page = ReportPage((directory / 'report.html').read_text(encoding='utf-8'))
    assert page.is_complete
    places = [page.text.index(words) for words in (
        'Verdict on 2 joints: 2 good.', 'the joint tracks: RMS error', 'limit 10 mrad',
        'the planar two-link arm', 'command demo --duration 2 --rate 200 --out here', 'Control ')]
    assert places == sorted(places)


@pytest.mark.parametrize(('rms', 'effort_ratio', 'answered', 'grade', 'words'), [
    (0.0099, 1.0, 1.0, Grade.GOOD, 'RMS error 9.9 mrad, limit 10 mrad'),
    (0.0101, 0.99, 1.0, Grade.BAD, 'the effort reaches its limit'),
    (0.02, 0.97, 0.79, Grade.BAD, '79 % of the states were answered'),
    (0.02, 0.97, 0.81, Grade.BAD, 'does not track'),
    (float('nan'), 0.5, 1.0, Grade.BAD, 'does not track'),
])
def test_the_verdict_on_tracking(rms, effort_ratio, answered, grade, words):
    found = tracking_verdict('joint', 'revolute', rms, effort_ratio, answered)
    assert found.grade is grade
    assert words in found.text


def test_an_interrupt_stops_the_nodes_and_keeps_what_there_is(tmp_path):
    with start_demo(tmp_path, '--duration', 10, '--no-plot', '--out', 'here') as process:
        wait_for_line(process.stderr, '10 %')
        nodes = nodes_of(process)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 130, err
    assert 'Traceback' not in err
    assert set(nodes) == {'dynamics', 'simulated_arm'}
    assert all(is_gone(pid) for pid in nodes.values())
    assert not (tmp_path / 'here' / 'demo.png').exists()
    with Recording(tmp_path / 'here' / 'recording') as recording:
        stamps = recording.joint_series('/joint_states').stamps_ns
    assert len(stamps) > 0
    assert (stamps % 2_000_000 == 0).all()  # the default rate


def test_a_demo_that_is_killed_leaves_no_node_behind(tmp_path):
    with start_demo(tmp_path, '--out', 'here') as process:
        wait_until(lambda: {'dynamics', 'simulated_arm'} <= set(nodes_of(process)), 'the nodes')
        nodes = nodes_of(process)
        process.kill()
        process.communicate(timeout=TIMEOUT)
    wait_until(lambda: all(is_gone(pid) for pid in nodes.values()), 'the end of both nodes')


def test_a_node_that_dies_is_named_with_its_log(tmp_path):
    with start_demo(tmp_path, '--duration', 600, '--rate', 50, '--out', 'here') as process:
        wait_for_line(process.stdout, 'Following')
        nodes = nodes_of(process)
        os.kill(nodes['dynamics'], signal.SIGKILL)
        _, err = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert 'demo: dynamics ended with status -9' in err
    assert "Model 'planar_arm'" in err
    assert 'Traceback' not in err
    assert all(is_gone(pid) for pid in nodes.values())


def test_replay_of_its_own_recording(closed_loop, tmp_path):
    """The model is the one that made the motion: the recording contains its description."""
    recorded, _, _ = closed_loop
    status, out, err = run_demo(tmp_path, '--replay', recorded / 'recording', '--out', 'here')
    assert status == 0, out + err
    assert max(relative_residuals(out).values()) < 10.0
    page = ReportPage((tmp_path / 'here' / 'report.html').read_text(encoding='utf-8'))
    assert 'robot_description of the recording' in page.text


# --- mistakes ------------------------------------------------------------------------------------

@pytest.mark.parametrize(('arguments', 'words'), [
    (['--duration', '0'], r"--duration: '0', expected a number in \[1, 3600\]"),
    (['--robot', 'no_such.urdf'], r"'no_such\.urdf'.*cannot be read"),
    (['--topic', '/x'], '--topic is given without --replay'),
    (['--trajectory', 'x', '--duration', '3'], '--trajectory is given with --duration'),
    (['--trajectory', 'none.yaml'], "'none.yaml' cannot be read"),
    (['--out', __file__], '--out: .*cannot be used'),
])
def test_a_mistake_is_one_line_and_status_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, 'signal', lambda *_: None)  # of the tests
    try:
        status = main(arguments)
    except SystemExit as ended:
        status = ended.code
    err = capsys.readouterr().err
    assert status == 2, err
    assert re.search(words, err), err
    assert len(err.splitlines()) == 1, err
    assert not list(tmp_path.glob('**/recording'))


def test_a_directory_in_use_gets_one_of_its_own_inside(tmp_path):
    assert _make_directory(tmp_path) == tmp_path
    (tmp_path / 'note').write_text('mine')
    first, second = _make_directory(tmp_path), _make_directory(tmp_path)
    assert first.parent == second.parent == tmp_path
    assert first != second
    assert not any(first.iterdir())
    assert (tmp_path / 'note').read_text() == 'mine'


# --- components ----------------------------------------------------------------------------------

def test_domain_settings_of_the_user_are_kept():
    assert choose_domain({'ROS_DOMAIN_ID': '7', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}) == {}
    chosen = choose_domain({})
    assert 0 < int(chosen['ROS_DOMAIN_ID']) < 102
    assert chosen['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'


def test_progress_on_a_terminal_is_one_line(tmp_path):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    with Progress(2.0, 's', terminal) as progress:
        for done in (0.0, 1.0, 2.0, 3.0):
            progress.update(done)
    text = terminal.getvalue()
    assert text.count('\n') == 1
    assert text.endswith('\n')
    assert '100 %  2.0 / 2.0 s' in text
