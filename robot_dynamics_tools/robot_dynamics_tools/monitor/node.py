# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The node `dynamics_monitor`: what one looks at while `dynamics` commands an arm.

It changes no command: it only subscribes, and asks `dynamics` for its parameters. Only
~/estimate_payload with `apply` calls ~/set_payload of `dynamics`.
"""

from collections.abc import Sequence
import threading

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.middleware.cdr_templates import SensedState
from robot_dynamics.ros.middleware.diagnostics import publish_diagnostics, Status
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.middleware.joint_state_loop import JointStateLoop
from robot_dynamics.ros.middleware.message_bytes import UnreadableMessageError
from robot_dynamics.ros.middleware.shutdown import leave
from robot_dynamics.ros.parameters.declared_parameters import DeclaredParameters, Values
from robot_dynamics.ros.parameters.node_arguments import NodeUsage
from robot_dynamics.ros.running import run_node
from robot_dynamics.validation import check_scalar
from robot_dynamics_interfaces.srv import EstimatePayload
from robot_dynamics_tools.monitor import payload_estimation
from robot_dynamics_tools.monitor.estimates import Estimates, LiveEstimates
from robot_dynamics_tools.monitor.followed_model import Followed, FollowedModel
from robot_dynamics_tools.monitor.markers import LiveMarkers
from robot_dynamics_tools.monitor.parameters import full_name, SPECS
from robot_dynamics_tools.monitor.states import StateInput

NODE = 'dynamics_monitor'

USAGE = NodeUsage(
    NODE, NODE,
    'External efforts, contacts, residuals, markers and payloads of an arm that the node dynamics '
    'commands. It takes model, parameters and payloads from dynamics, and changes no command.',
    (('', 'Monitor the arm of the node /dynamics.'),
     ('--ros-args -r __ns:=/left', 'Monitor the arm of the node /left/dynamics.')),
    SPECS, tuple(spec.name for spec in SPECS),
    (('joint_states', 'Subscribed, sensor_msgs/msg/JointState: measured positions, velocities '
      'and efforts.'),
     ('effort_command', 'Subscribed while there are markers, sensor_msgs/msg/JointState.'),
     ('dynamics/robot_description', 'Subscribed, std_msgs/msg/String: the URDF that dynamics '
      'uses.'),
     ('~/external_effort, ~/residual', 'Published, sensor_msgs/msg/JointState: the external '
      'effort, and measured minus modelled effort.'),
     ('~/external_wrench', 'Published, geometry_msgs/msg/WrenchStamped: the external wrench.'),
     ('~/contacts', 'Published, robot_dynamics_interfaces/msg/Contact: beginnings of contacts.'),
     ('~/markers', 'Published, visualization_msgs/msg/MarkerArray: efforts and forces for RViz.'),
     ('~/estimate_payload', 'Service, robot_dynamics_interfaces/srv/EstimatePayload: estimate '
      'what is attached to a link.')))


class DynamicsMonitor(GuardedCallbacks):
    """Connects topics and services to the estimators; any executor may spin it."""

    NAME = NODE

    def _set_up(self) -> None:
        self._lock = threading.Lock()
        """Protects the model in use and its estimators."""
        self._model: Followed | None = None
        self._states: StateInput | None = None
        self._settings = DeclaredParameters(self, SPECS, self._check, self._apply)
        dynamics = full_name(self._settings.values['dynamics'], self.get_namespace())
        self._markers = LiveMarkers(self)
        self._estimates = LiveEstimates(self, lambda: self._markers.is_on)
        self._estimation = payload_estimation.PayloadEstimation(self)
        self._request = payload_estimation.PayloadRequest(self, dynamics)
        self.create_service(EstimatePayload, '~/estimate_payload', self._estimate_payload)
        self._models = FollowedModel(
            self, dynamics, self._use, lambda: self._settings.values)
        self._loop = JointStateLoop(self, self._on_state, self._refuse)
        publish_diagnostics(self, self._statuses)
        self.call_when_spun(self._loop.start)

    def destroy_node(self) -> None:
        """End the thread of the states, and destroy the rest."""
        for part, end in (('_loop', 'stop'), ('_request', 'close')):
            if hasattr(self, part):
                getattr(getattr(self, part), end)()
                delattr(self, part)
        super().destroy_node()

    def _check(self, values: Values) -> None:
        full_name(values['dynamics'], self.get_namespace())

    def _apply(self, values: Values) -> None:
        with self._lock:
            if self._estimates.estimates is not None:
                self._estimates.estimates.residual.low_pass.set_cutoff(
                    values['residual_bandwidth'])

    # ------------------------------------------------------------------ model and states

    def _use(self, model: Followed | None) -> None:
        """Use a model from the next state on; raise InvalidInputError if that is not possible."""
        before, estimates, states = self._model, self._estimates.estimates, self._states
        is_same = before is not None and model is not None and before.base is model.base
        if model is None:
            estimates = states = None
        elif not is_same:
            estimates = Estimates(model, self._settings.values)
            states = StateInput(model, lambda: self._loop.publisher_count() > 1)
        with self._lock:
            if not is_same:
                self._estimates.set_estimates(estimates)
            self._model, self._states = model, states
            if model is not None and estimates is not None and states is not None:
                estimates.set_model(model)
                states.set_model(model)
                self._estimates.contacts.set_levels(model.values, model.arm)
        self._markers.set_model(model, '' if estimates is None else estimates.wrench.frame)
        self._estimation.set_model(model)

    def _on_state(self, received: SensedState) -> None:
        with self._lock:
            states, estimates, wanted = self._states, self._estimates, self._estimates.wanted
            if states is None:
                return
            if not (any(wanted) or self._estimation.is_on):
                states.rest()
                estimates.rest()
                return
            state = states.take(received)
            if state is None:
                return
            estimates.update(state, wanted)
            self._estimation.keep(state)
            if self._markers.is_on:
                self._markers.update(state, estimates.external_effort, estimates.wrench.newest)

    def _refuse(self, error: UnreadableMessageError) -> None:
        states = self._states
        if states is not None:
            states.refuse(error)

    # ------------------------------------------------------------------ payload, diagnostics

    def _estimate_payload(
        self, request: EstimatePayload.Request, response: EstimatePayload.Response,
    ) -> EstimatePayload.Response:
        seconds = check_scalar('transition_time', request.transition_time, minimum=0.0)
        response.success = True
        if request.start:
            if request.apply or request.stop:
                raise InvalidInputError(
                    'start is true together with apply or stop, expected separate calls')
            self._estimation.start(request.link)
            response.link = request.link
            response.message = f'estimation for {request.link!r} started'
            return response
        estimate = self._estimation.estimate(request.link)
        payload_estimation.estimate_to_ros(estimate, response)
        if request.apply:
            answer = self._request.apply(estimate.payload(), seconds)
            response.message += f'; applied: {answer.message}'
            response.warnings = [*response.warnings, *answer.warnings]
        if request.stop:
            self._estimation.stop()
        return response

    def _statuses(self) -> list[Status]:
        states = self._states
        return [
            *self._models.statuses(), self._estimates.status(),
            *([] if states is None else [states.status()])]


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(DynamicsMonitor, USAGE, args)


if __name__ == '__main__':
    leave(main())
