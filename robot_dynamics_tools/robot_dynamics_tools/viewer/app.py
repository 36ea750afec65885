# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The viewer: a page of one arm, updated from the topics of its nodes, and the actions of the page.

One thread does all of this, once per PERIOD. The threads of the page only put requests into a
queue.
"""

from collections.abc import Callable, Mapping, Sequence
from html import escape
import math
from pathlib import Path
import queue
import time
from typing import Any, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics_tools.recordings.sample_faults import counted
from robot_dynamics_tools.viewer.actions import ArmPage
from robot_dynamics_tools.viewer.node import (
    ArmSource,
    Description,
    drive_words,
    ViewerNode,
    worst_words,
)
from robot_dynamics_tools.viewer.panel import ArmPanel
from robot_dynamics_tools.viewer.plots import TERMS
from robot_dynamics_tools.viewer.scene import ArmScene
from robot_dynamics_tools.viewer.views import Cameras
from sensor_msgs.msg import JointState

if TYPE_CHECKING:
    import viser

PERIOD = 0.05
"""[s] between two updates of the arm."""
PLOT_PERIOD = 0.2
"""[s] between two updates of the plots and the text."""
SILENCE = 1.0
"""[s] without a message after which its content is outdated."""
SLOW = 3.0
"""[s] without diagnostics, which come once per second, after which a node is slow."""
LARGEST_LAG = 0.01
"""Longest time [s] between a reference and the compared state; it is extrapolated."""
TEXT_STYLE = 'height: 130px; overflow-y: auto; font-size: 13px; padding: 2px 10px'
"""Of the text above the controls: a fixed height, so that no button moves under a pointer."""


class Viewer:
    """A page on a viser server, for the nodes to which `node` subscribes."""

    def __init__(
        self, server: 'viser.ViserServer', node: ViewerNode, robot: str | None = None,
        mesh_paths: Sequence[Path] = (),
    ) -> None:
        """
        Show the arm of the URDF in the file `robot`, or else of `dynamics` or of a topic.

        `mesh_paths` are directories in which meshes of a URDF from a topic may be opened.
        """
        self._server, self._node, self._cameras = server, node, Cameras(server)
        # (SimpleQueue.get would wait indefinitely after a signal at the end of its timeout)
        self._asked: queue.Queue[Callable[[], None]] = queue.Queue()
        self._words = server.gui.add_html(text_box(['Waiting for an arm …']))
        self._page: ArmPage | None = None
        self._arm_problem = self._state_problem = ''
        self._q: FloatArray | None = None
        self._v: FloatArray | None = None
        self._state_time = self._plot_time = -SILENCE
        self._newest_stamp = self._marks_stamp = 0.0
        self._efforts: dict[str, dict[str, float]] = {'command': {}, 'state': {}}
        self._newest: dict[str, Any] = {}
        """Newest message of each topic, and the time [s] of its arrival, by field."""
        self._times = {'diagnostics': time.monotonic()}
        self._source = ArmSource(node, robot)
        self._mesh_paths = mesh_paths

    def run(self, is_over: Callable[[], bool]) -> None:
        """Update the page until the end."""
        while not is_over():
            due = time.monotonic() + PERIOD
            self._take(self._node.receive())
            self._turn()
            self._perform_requests(due)

    def _perform_requests(self, due: float) -> None:
        """Perform the requests of the page that wait, and those until `due` [s]."""
        while True:
            try:
                asked = self._asked.get(timeout=max(due - time.monotonic(), 0.0))
            except queue.Empty:
                return
            try:
                asked()
            except RobotDynamicsError as error:
                self._arm_problem = str(error)

    def close(self) -> None:
        """End all actions on the arm, and remove it."""
        if self._page is not None:
            self._page.close()

    # ------------------------------------------------------------------ the arm

    def _use(self, description: Description) -> None:
        """Show this arm; if that fails, keep the arm before and show the reason."""
        xml, directory, joints = description
        try:
            arm = arm_from_urdf(xml, joints)
        except RobotDynamicsError as error:
            self._arm_problem = str(error)
            return
        self._arm_problem = ''
        if self._page is not None and (
                (xml, arm.joint_names) == (self._page.xml, self._page.arm.joint_names)):
            return
        self.close()
        self._words.content = text_box([f'Drawing {arm.name} …'])
        scene = ArmScene(self._server, arm, xml, directory, self._mesh_paths)
        panel = ArmPanel(self._server.gui, arm, self._asked.put)
        self._page = ArmPage(self._node, xml, arm, scene, panel)
        self._q, self._state_problem = None, ''
        scene.move(np.clip(np.zeros(arm.joint_count), arm.limits.lower, arm.limits.upper))
        self._cameras.restart(scene.extent())

    # ------------------------------------------------------------------ what is received

    def _take(self, new: Mapping[str, Any]) -> None:
        self._newest.update(new)
        self._times.update(dict.fromkeys(new, time.monotonic()))
        if 'description' in new:
            self._source.take_topic(new['description'].data)
        for field, values in self._efforts.items():
            if field in new:
                values.update(zip(new[field].name, new[field].effort))
            elif self._age(field) > SILENCE:
                values.clear()
        page = self._page
        if page is None:
            return
        if 'trajectory' in new:
            page.receive(new['trajectory'])
        if 'state' in new:
            self._take_state(page, new['state'])
        if 'markers' in new:
            markers = new['markers'].markers
            self._marks_stamp = max(map(seconds_of, markers), default=0.0)
            page.scene.mark(markers)
        elif self._newest_stamp - self._marks_stamp > SILENCE:  # the arm moves on without marks
            page.scene.mark(())
        self._plot(page, new)

    def _age(self, field: str) -> float:
        """Return the time [s] since the newest message of a topic."""
        return time.monotonic() - self._times.get(field, -math.inf)

    def _take_state(self, page: ArmPage, state: JointState) -> None:
        q = values_of(page.arm, state)
        if q is None:
            self._state_problem = lacking(page.arm, state)
            return
        self._q, self._state_problem, self._state_time = q, '', time.monotonic()
        self._v = values_of(page.arm, state, 'velocity')
        page.scene.move(q)

    def _plot(self, page: ArmPage, new: Mapping[str, Any]) -> None:
        arm, panel = page.arm, page.panel
        state, terms, reference = map(new.get, ('state', 'terms', 'reference'))
        for message in (state, terms):
            if message is not None:
                self._newest_stamp = seconds_of(message)
        name = arm.joint_names[panel.shown_joint]
        if terms is not None and name in terms.joint_names:
            i = list(terms.joint_names).index(name)
            panel.plots[0].add(seconds_of(terms), [getattr(terms, term)[i] for term in TERMS])
        if reference is not None and state is not None and self._q is not None:
            lag = seconds_of(state) - seconds_of(reference)
            wanted = values_of(arm, reference)
            speed = values_of(arm, reference, 'velocity')
            if abs(lag) <= LARGEST_LAG and wanted is not None and speed is not None:
                i = panel.shown_joint
                error = float(wanted[i] + lag * speed[i] - self._q[i])
                if arm.joint_kinds[i] == 'continuous':
                    error = math.remainder(error, 2.0 * math.pi)
                panel.plots[1].add(seconds_of(state), [1e3 * error])

    # ------------------------------------------------------------------ one cycle

    def _turn(self) -> None:
        now = time.monotonic()
        description = self._source.news()
        if description is not None:
            self._use(description)
        page = self._page
        if page is None:
            self._say(['no arm yet'])
            return
        page.turn(self._q, self._v)
        if now - self._plot_time < PLOT_PERIOD:
            return
        self._plot_time = now
        for plot in page.panel.plots:
            plot.show(self._newest_stamp)
        page.panel.show_efforts(self._efforts['command'], self._efforts['state'])
        if self._q is not None or not self._node.has_states:
            self._cameras.show(page.scene.extent())
        lasts = min(self._age('reference'), now - page.sent_time) < SILENCE
        if self._q is not None and not (page.is_own and lasts) and not page.is_wished:
            page.panel.follow(self._q)
        joints = counted(page.arm.joint_count, 'joint')
        self._say([f'{page.arm.name}, {joints}'], page.answer)

    def _say(self, lines: list[str], answer: str = '') -> None:
        node = self._node
        if time.monotonic() - self._state_time > SILENCE:
            lines.append('no joint states' + (
                ' received' if node.has_states else ': joint_states has no publisher'))
        silent = self._age('diagnostics')
        if node.has_dynamics and silent > SLOW:
            lines.append(f'⚠ {node.dynamics} has sent no diagnostics for {silent:.0f} s')
        if silent > SLOW or not node.has_dynamics:
            self._newest.pop('diagnostics', None)
        if not node.has_dynamics:
            self._newest.pop('payload', None)
            lines.append(
                f'no node {node.dynamics}: start it with `ros2 run robot_dynamics dynamics_node`')
        else:
            follows = self._age('reference') < SILENCE
            lines.append(f'follows {"a" if follows else "no"} reference')
            if not node.has_monitor:
                lines.append(f'no node {node.monitor}, which draws efforts: start it with `ros2 '
                             'run robot_dynamics_tools dynamics_monitor`')
        statuses = self._newest.get('diagnostics', DiagnosticArray())
        lines += drive_words(statuses)
        payload = self._newest.get('payload')
        if payload is not None and payload.inertia.m > 0.0:
            lines.append(f'payload of the controller: {payload.inertia.m:.3g} kg on '
                         f'{payload.header.frame_id}')
        missing = [] if self._page is None else self._page.scene.missing
        if missing:
            count = '1 mesh is' if len(missing) == 1 else f'{len(missing)} meshes are'
            lines.append(f'{count} not drawn; the first one: {missing[0]}')
        lines += [f'⚠ {words}' for words in (
            *worst_words(statuses), self._source.problem, self._arm_problem, self._state_problem)
            if words]
        if answer:
            lines.append(answer)
        words = text_box(lines)
        if self._words.content != words:
            self._words.content = words


def text_box(lines: Sequence[str]) -> str:
    """Return HTML of these lines, as a list whose height does not depend on them."""
    items = ''.join(f'<div>{escape(line, quote=False)}</div>' for line in lines)
    return f'<div style="{TEXT_STYLE}">{items}</div>'


def seconds_of(message: Any) -> float:
    """Return the stamp of a message [s]."""
    return 1e-9 * stamp_from_ros(message.header.stamp)


def values_of(arm: ArmModel, message: JointState, field: str = 'position') -> FloatArray | None:
    """Return a field of joint states in the order of an arm (n,), None if a joint is missing."""
    values = dict(zip(message.name, getattr(message, field)))
    if any(name not in values for name in arm.joint_names):
        return None
    found = np.array([values[name] for name in arm.joint_names])
    return found if np.isfinite(found).all() else None


def lacking(arm: ArmModel, state: JointState) -> str:
    """Return a text about the joints of an arm without a position in the joint states."""
    given = dict(zip(state.name, state.position))
    missing = [name for name in arm.joint_names if name not in given]
    if missing:
        return f'joint_states lack {missing}, expected a position of every joint of the arm'
    wrong = [name for name in arm.joint_names if not math.isfinite(given[name])]
    return f'joint_states have no finite position of {wrong}'
