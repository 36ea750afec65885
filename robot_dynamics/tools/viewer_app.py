# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The viewer at work: a page of one arm, kept up to what its nodes say, and what the page asks for.

All of it happens in one thread, PERIOD by PERIOD; the page's own threads only put into a queue
what was asked.
"""

from collections.abc import Callable
import math
from pathlib import Path
import queue
import time
from typing import Any, NamedTuple

from geometry_msgs.msg import InertiaStamped
import numpy as np
from robot_dynamics.arm_model import ArmModel, load_arm
from robot_dynamics.exceptions import RobotDynamicsError
from robot_dynamics.ros.conversions import stamp_from_ros
from robot_dynamics.ros.robot_description import (
    description_path,
    embedded_description,
    read_description_file,
)
from robot_dynamics.tools.viewer_node import Described, Heard, ViewerNode, worst_words
from robot_dynamics.tools.viewer_panel import ArmPanel
from robot_dynamics.tools.viewer_requests import ball, force_on, motion_time, reference_to
from robot_dynamics.tools.viewer_scene import ArmScene
from robot_dynamics.validation import FloatArray
from sensor_msgs.msg import JointState

CAMERA = (1.1, -1.7, 0.8)
"""Where the page looks from, in reaches of the arm."""
FIELD_OF_VIEW = 0.8
"""[rad]"""
PERIOD = 0.05
"""[s] between two pictures."""
PLOT_PERIOD = 0.2
"""[s] between two pictures of the plots and the words."""
ASK_PERIOD = 1.0
"""[s] between two questions for the arm."""
SEND_PERIOD = 0.1
"""[s] between two references while a slider is moved."""
SILENCE = 1.0
"""[s] without a message after which what it said no longer holds."""
LARGEST_LAG = 0.01
"""[s] from a reference to the state it is compared with; its velocity carries it there."""
LOAD_TIME = 0.5
"""[s] over which the controller takes a load, so that its effort does not step."""


class _Push(NamedTuple):
    force: FloatArray
    link: str
    until: float


class _Shown(NamedTuple):
    """An arm on the page."""

    xml: str
    arm: ArmModel
    scene: ArmScene
    panel: ArmPanel


class Viewer:
    """A page on a server of viser, beside the nodes that `node` hears."""

    def __init__(self, server: Any, node: ViewerNode, robot: str | None = None) -> None:
        """`robot` is the file of a URDF; without one, it is that of `dynamics`, or a topic's."""
        self._server, self._node, self._robot = server, node, robot
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._words = server.gui.add_markdown('Waiting for an arm …')
        self._shown: _Shown | None = None
        self._described: Described | None = None
        self._topic_xml = ''
        self._problem = self._answer = ''
        self._q: FloatArray | None = None
        self._v: FloatArray | None = None
        self._state_time = self._reference_time = self._marks_time = -SILENCE
        self._asked_time = self._sent_time = self._plot_time = -ASK_PERIOD
        self._newest_stamp = 0.0
        self._is_following = self._is_to_send = False
        self._push: _Push | None = None
        self._load = ''
        self._warnings: list[str] = []
        self._sender = f'viewer-{id(self):x}'
        if robot is not None:
            self._use_file(robot, ())

    def run(self, is_over: Callable[[], bool]) -> None:
        """Keep the page up to date until it is over."""
        while not is_over():
            began = time.monotonic()
            self._take(self._node.hear())
            self._turn()
            while (left := began + PERIOD - time.monotonic()) > 0.0:
                try:
                    asked = self._asked.get(timeout=left)
                except queue.Empty:
                    break
                try:
                    asked()
                except RobotDynamicsError as error:
                    self._answer = str(error)

    def close(self) -> None:
        """Leave nothing behind that acts on the arm."""
        self._end_push()

    # ------------------------------------------------------------------ which arm

    def _find_arm(self) -> None:
        """Ask for the arm where it is not known yet, and again when `dynamics` was away."""
        now = time.monotonic()
        if not self._node.has_dynamics:
            self._described = None
            if self._topic_xml and self._robot is None:
                self._use(self._topic_xml, Path(), ())
        elif self._described is None and now - self._asked_time >= ASK_PERIOD:
            self._asked_time = now
            self._node.ask_description(self._take_description)

    def _take_description(self, described: Described) -> None:
        self._described = described
        file = self._robot or described.file
        if file:
            try:
                self._use_file(file, described.joints)
                return
            except RobotDynamicsError as error:  # a file of another computer
                self._problem = f'{error}; expected it here too, or on the topic robot_description'
                if not self._topic_xml:
                    return
        xml = described.xml or self._topic_xml or embedded_description()
        self._use(xml, Path(), described.joints)

    def _use_file(self, file: str, joints: tuple[str, ...]) -> None:
        self._use(read_description_file(file), description_path(file).parent, joints)

    def _use(self, xml: str, directory: Path, joints: tuple[str, ...]) -> None:
        """Show this arm; where it cannot be, keep the one before and say so."""
        try:
            arm = load_arm(xml, joints)
        except RobotDynamicsError as error:
            self._problem = str(error)
            return
        if self._shown is not None:
            if (xml, arm.joint_names) == (self._shown.xml, self._shown.arm.joint_names):
                return
            self._shown.scene.close()
            self._shown.panel.close()
        self._words.content = f'Drawing {arm.name} …'
        scene = ArmScene(self._server, arm, xml, directory)
        panel = ArmPanel(self._server.gui, arm, self._asked.put)
        panel.on_reference, panel.on_push = self._wish_reference, self._begin_push
        panel.on_attach, panel.on_detach = self._attach, self._detach
        panel.on_reset = self._reset
        self._shown, self._q, self._problem = _Shown(xml, arm, scene, panel), None, ''
        reach = scene.reach
        camera = self._server.initial_camera
        camera.fov = FIELD_OF_VIEW
        camera.position = tuple(reach * np.array(CAMERA))
        camera.look_at = (0.0, 0.0, 0.3 * reach)
        scene.move(np.clip(np.zeros(arm.joint_count), arm.limits.lower, arm.limits.upper))

    # ------------------------------------------------------------------ what is heard

    def _take(self, heard: Heard) -> None:
        now = time.monotonic()
        if heard.description is not None:
            self._topic_xml = heard.description.data
            if self._described is not None:
                self._take_description(self._described)
        if heard.diagnostics is not None:
            self._warnings = worst_words(heard.diagnostics)
        if heard.payload is not None:
            inertia, link = heard.payload.inertia, heard.payload.header.frame_id
            self._load = f'{inertia.m:.3g} kg on {link}' if inertia.m > 0.0 else ''
        if heard.trajectory is not None:
            self._is_following = heard.trajectory.header.frame_id == self._sender
        if heard.reference is not None:
            self._reference_time = now
        shown = self._shown
        if shown is None:
            return
        if heard.state is not None:
            self._take_state(shown, heard.state)
        if heard.markers is not None:
            self._marks_time = now
            shown.scene.mark(heard.markers.markers)
        elif now - self._marks_time > SILENCE:
            shown.scene.mark(())
        self._plot(shown, heard)

    def _take_state(self, shown: _Shown, state: JointState) -> None:
        q = values_of(shown.arm, state)
        if q is None:
            missing = [name for name in shown.arm.joint_names if name not in state.name]
            self._problem = f'joint_states lack {missing}, expected every joint of the arm'
            return
        self._q, self._problem, self._state_time = q, '', time.monotonic()
        self._v = values_of(shown.arm, state, 'velocity')
        shown.scene.move(q)

    def _plot(self, shown: _Shown, heard: Heard) -> None:
        arm, panel = shown.arm, shown.panel
        for message in (heard.state, heard.terms):
            if message is not None:
                self._newest_stamp = 1e-9 * stamp_from_ros(message.header.stamp)
        name = arm.joint_names[panel.shown_joint]
        terms, reference, state = heard.terms, heard.reference, heard.state
        if terms is not None and name in terms.joint_names:
            i = list(terms.joint_names).index(name)
            panel.plot_terms(1e-9 * stamp_from_ros(terms.header.stamp), {
                term: getattr(terms, term)[i] for term in (
                    'effort', 'gravity', 'inertial', 'coriolis', 'friction', 'external')})
        if reference is not None and state is not None and self._q is not None:
            lag = 1e-9 * (stamp_from_ros(state.header.stamp)
                          - stamp_from_ros(reference.header.stamp))
            wanted = values_of(arm, reference)
            speed = values_of(arm, reference, 'velocity')
            if abs(lag) <= LARGEST_LAG and wanted is not None and speed is not None:
                i = panel.shown_joint
                error = float(wanted[i] + lag * speed[i] - self._q[i])
                if arm.joint_kinds[i] == 'continuous':
                    error = math.remainder(error, 2.0 * math.pi)
                panel.plot_error(1e-9 * stamp_from_ros(state.header.stamp), error)

    # ------------------------------------------------------------------ what is done each turn

    def _turn(self) -> None:
        now = time.monotonic()
        self._find_arm()
        shown = self._shown
        if shown is None:
            self._say(['No arm yet.'])
            return
        if self._is_to_send and now - self._sent_time >= SEND_PERIOD:
            self._send_reference(shown, now)
        if self._push is not None:
            self._go_on_pushing(shown, self._push, now)
        if now - self._plot_time < PLOT_PERIOD:
            return
        self._plot_time = now
        shown.panel.show_plots(self._newest_stamp)
        lasts = now - max(self._reference_time, self._sent_time) < SILENCE
        if self._q is not None and not (self._is_following and lasts) and not self._is_to_send:
            shown.panel.follow(self._q)
        self._say([f'**{shown.arm.name}**, {len(shown.arm.joint_names)} joints'])

    def _say(self, lines: list[str]) -> None:
        now, node = time.monotonic(), self._node
        if now - self._state_time > SILENCE:
            lines.append('no joint states' + (
                ' arrive' if node.has_states else ': nobody publishes joint_states'))
        if not node.has_dynamics:
            lines.append(f'no node {node.dynamics}: `ros2 run robot_dynamics dynamics_node`')
        elif now - self._reference_time < SILENCE:
            lines.append('follows a reference')
        else:
            lines.append('no reference: gravity compensation')
        if self._load:
            lines.append(f'the controller knows of {self._load}')
        if self._shown is not None and self._shown.scene.missing:
            missing = self._shown.scene.missing
            lines.append(f'{len(missing)} meshes are not drawn; the first: {missing[0]}')
        lines += [f'⚠ {words}' for words in (*self._warnings, self._problem) if words]
        if self._answer:
            lines.append(self._answer)
        words = '\n'.join(f'- {_plain(line)}' for line in lines)
        if self._words.content != words:
            self._words.content = words

    # ------------------------------------------------------------------ what is asked for

    def _wish_reference(self) -> None:
        self._is_to_send = True

    def _send_reference(self, shown: _Shown, now: float) -> None:
        self._is_to_send = False
        goal = shown.panel.take_goal()
        if self._q is None:
            self._answer = 'There are no joint states to start from.'
            return
        seconds = motion_time(shown.arm, self._q, goal, shown.panel.speed, self._v)
        self._node.send_trajectory(reference_to(shown.arm, goal, seconds, self._sender))
        self._sent_time, self._is_following = now, True
        self._answer = f'Reference sent: {seconds:.1f} s'

    def _begin_push(self) -> None:
        if self._shown is None:
            return
        if not self._node.has_simulated_arm:
            self._answer = (
                f'{self._node.simulated_arm} is not there; a real arm is pushed by hand.')
            return
        force, link, seconds = self._shown.panel.push
        self._end_push()
        self._push = _Push(force, link, time.monotonic() + seconds)

    def _go_on_pushing(self, shown: _Shown, push: _Push, now: float) -> None:
        if now >= push.until or push.link not in shown.arm.link_names:
            self._end_push()
            return
        self._node.push(force_on(push.link, push.force, shown.scene.rotation(push.link)))

    def _end_push(self) -> None:
        if self._push is not None:
            self._node.push(force_on(self._push.link, np.zeros(3), np.eye(3)))
            self._push = None

    def _attach(self) -> None:
        if self._shown is not None:
            mass, link = self._shown.panel.load
            self._set_load(ball(link, mass))

    def _detach(self) -> None:
        if self._shown is not None:
            self._set_load(ball(self._shown.panel.load[1], 0.0))

    def _set_load(self, load: InertiaStamped) -> None:
        if self._shown is None:
            return
        is_told, is_carried = self._shown.panel.load_is_for
        if is_told:  # both at once, where a simulated arm is to carry it, which does so at once
            self._node.set_payload(
                self._node.dynamics, load, 0.0 if is_carried else LOAD_TIME, self._take_answer)
        if is_carried:
            self._node.set_payload(self._node.simulated_arm, load, 0.0, self._take_answer)

    def _reset(self) -> None:
        self._end_push()
        self._is_following = self._is_to_send = False
        self._node.reset_simulated_arm(self._take_answer)

    def _take_answer(self, words: str) -> None:
        self._answer = words


def values_of(arm: ArmModel, message: JointState, field: str = 'position') -> FloatArray | None:
    """Return a field of joint states in the order of an arm (n,), None where a joint lacks."""
    values = dict(zip(message.name, getattr(message, field)))
    if any(name not in values for name in arm.joint_names):
        return None
    found = np.array([values[name] for name in arm.joint_names])
    return found if np.isfinite(found).all() else None


def _plain(line: str) -> str:
    """Return a line without what Markdown or HTML would make something else of."""
    return line.replace('<', '‹').replace('>', '›')
