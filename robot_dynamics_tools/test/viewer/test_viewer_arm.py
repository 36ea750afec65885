# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The arm that the viewer displays: from a node, a topic or a file."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import cycle
import threading

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
import rclpy
from rclpy.context import Context
from robot_dynamics.planar.urdf import default_arm_urdf, planar_arm_urdf
from robots import must_have_everything, robot_path
from ros_harness import (
    DYNAMICS,
    MONITOR,
    NodeProcess,
    running,
    SIMULATED_ARM,
    TIMEOUT,
    UNHURRIED,
    wait_until,
)
from sensor_msgs.msg import JointState

if not must_have_everything():
    pytest.importorskip('viser', reason='the viewer needs viser')
from robot_dynamics_tools.viewer import app
from robot_dynamics_tools.viewer.node import ViewerNode
from viewer_bench import served


class Watched:
    def __init__(self, viewer, work):
        self.viewer, self._work = viewer, work

    def wait_for(self, *words, without=(), meanwhile=lambda: None):
        """Wait until the page contains each of `words`, and none of `without`."""
        def is_so():
            meanwhile()
            said = self.viewer._words.content
            return self._work.done() or (
                all(word in said for word in words) and not any(word in said for word in without))

        try:
            wait_until(is_so, f'{words} without {without}')
        except AssertionError as error:
            pytest.fail(f'{error}; the page says\n{self.viewer._words.content}')
        assert not self._work.done(), self._work.result()

    def sliders(self):
        return [slider.value for slider in self.viewer._page.panel._sliders]


@contextmanager
def watched(namespace, robot=None):
    context, over = Context(), threading.Event()
    rclpy.init(context=context)
    node = ViewerNode(rclpy.create_node('viewer', context=context, namespace=namespace),
                      'dynamics', 'simulated_arm')
    with served() as server, ThreadPoolExecutor(1) as pool:
        viewer = app.Viewer(server, node, robot)
        work = pool.submit(viewer.run, over.is_set)
        try:
            yield Watched(viewer, work)
        finally:
            over.set()
            work.result(TIMEOUT)
            viewer.close()
            node.close()
            rclpy.shutdown(context=context)


def one_link(name):
    return planar_arm_urdf([2.0], [1.0], [0.5], [0.1], name=name)


def test_the_arm_is_that_of_dynamics_or_the_named_one(client, tmp_path):
    (tmp_path / 'arm.urdf').write_text(one_link('named'))
    with watched('/viewed') as page:
        page.wait_for('no arm yet', 'no node dynamics', 'joint_states has no publisher')
        simulated = NodeProcess(SIMULATED_ARM, {
            'initial_position': [0.5, -0.5], 'rate': 100.0, 'command_timeout': 0.0},
            namespace='/viewed')
        with running(
                NodeProcess(DYNAMICS, UNHURRIED, namespace='/viewed'), simulated,
                NodeProcess(MONITOR, namespace='/viewed')):
            page.wait_for('planar_arm, 2 joints', 'follows a reference',
                          without=('no node', 'no joint states'))
            wait_until(lambda: page.sliders() == pytest.approx([0.5, -0.5], abs=0.1), 'sliders')
        page.wait_for('planar_arm, 2 joints', 'no node dynamics', 'joint_states has no publisher')
        parameters = {'robot_description_file': str(robot_path('ur10'))}
        with NodeProcess(DYNAMICS, parameters, namespace='/viewed'), \
                client.describing('/viewed') as publish:
            page.wait_for('ur10, 6 joints', 'no node dynamics_monitor, which draws efforts',
                          without=('planar_arm', 'not drawn', 'no node dynamics:'))
            publish(one_link('topical'))
            with watched('/viewed', str(tmp_path / 'arm.urdf')) as other:
                source = other.viewer._source
                wait_until(lambda: source._described and source._topic_xml, 'what both say')
                other.wait_for(
                    'named, 1 joint', 'follows no reference', without=['ur10', 'topical'])
            page.wait_for('ur10, 6 joints', without=['topical'])


def test_a_viewer_that_is_always_late_performs_the_requests_of_its_page(monkeypatch):
    monkeypatch.setattr(app, 'PERIOD', 0.0)
    performed = threading.Event()
    with watched('/late') as page:
        page.viewer._asked.put(performed.set)
        assert performed.wait(TIMEOUT)


def test_diagnostics_of_another_namespace_are_skipped(client):
    context = Context()
    rclpy.init(context=context)
    viewer = ViewerNode(
        rclpy.create_node('viewer', context=context, namespace='/viewed'), 'dynamics', 'arm')
    try:
        publisher = client.publisher(DiagnosticArray, '/diagnostics')
        found, namespaces = [], cycle(('/other', '/viewed'))

        def has_received():
            publisher.publish(DiagnosticArray(status=[
                DiagnosticStatus(name=f'{next(namespaces)}/dynamics: command')]))
            message = viewer.receive().get('diagnostics')
            found.extend([] if message is None else message.status)
            return found

        wait_until(has_received, 'diagnostics of /viewed/dynamics')
        assert {status.name for status in found} == {'/viewed/dynamics: command'}
    finally:
        viewer.close()
        rclpy.shutdown(context=context)


def test_without_dynamics_the_arm_is_that_of_the_topic(client):
    with client.describing('/topical') as publish:
        publish(one_link('first'))
        with watched('/topical') as page:
            page.wait_for('first, 1 joint', 'no node dynamics', 'joint_states has no publisher')
            publish(one_link('second'))
            page.wait_for('second, 1 joint', without=['first'])
            publish('<robot name="broken"')
            page.wait_for('second, 1 joint', 'robot_description is not well-formed XML')
            publish(one_link('second'))  # the former one again
            page.wait_for('second, 1 joint', without=['well-formed'])


def test_a_description_that_cannot_be_read_is_reported(client, tmp_path):
    """A file of another computer, until the topic has the arm."""
    file = tmp_path / 'arm.urdf'
    file.write_text(default_arm_urdf())
    parameters = {'robot_description_file': str(file)}
    states = client.publisher(JointState, '/remote/joint_states', subscribers=0)

    def send():
        states.publish(JointState(name=['joint1', 'joint2'], position=[0.2, 0.1]))

    with client.describing('/remote') as publish, \
            NodeProcess(DYNAMICS, parameters, namespace='/remote'):
        file.unlink()
        with watched('/remote') as page:
            page.wait_for('no arm yet', str(file), 'or on the topic robot_description')
            publish(default_arm_urdf())
            page.wait_for('planar_arm, 2 joints', without=[str(file), 'no joint states'],
                          meanwhile=send)


def test_states_that_cannot_be_shown_are_reported_until_others_come(client, tmp_path):
    (tmp_path / 'arm.urdf').write_text(default_arm_urdf())
    states = client.publisher(JointState, '/stated/joint_states', subscribers=0)
    with watched('/stated', str(tmp_path / 'arm.urdf')) as page:
        for names, position, words in (
                (['joint1', 'finger'], [0.1, 0.2], "joint_states lack ['joint2']"),
                (['joint1', 'joint2'], [0.1, float('nan')], "no finite position of ['joint2']")):
            page.wait_for('joint_states', words, meanwhile=lambda: states.publish(
                JointState(name=names, position=position)))  # noqa: B023
            page.wait_for(without=['joint_states'], meanwhile=lambda: states.publish(
                JointState(name=['joint2', 'joint1'], position=[0.2, 0.1])))
            assert page.sliders() == [0.1, 0.2]
