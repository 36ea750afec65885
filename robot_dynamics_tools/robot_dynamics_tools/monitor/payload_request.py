# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A call of `~/set_payload` of `dynamics` from the callback of a service.

A callback cannot wait for its own executor: a hidden node with another executor calls.
"""

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.payload import Payload
from robot_dynamics.ros.middleware.conversions import payload_to_ros
from robot_dynamics_interfaces.srv import SetPayload

PATIENCE = 5.0
"""[s] for the answer."""


class PayloadRequest:
    """Sets a payload of the node `dynamics`."""

    def __init__(self, node: Node, dynamics: str) -> None:
        """`dynamics` is the full name of the node."""
        self._service = f'{dynamics}/set_payload'
        self._helper = rclpy.create_node(
            f'_{node.get_name()}_requests', namespace=node.get_namespace(), context=node.context,
            use_global_arguments=False, start_parameter_services=False, enable_rosout=False)
        self._client = self._helper.create_client(SetPayload, self._service)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._helper)

    def apply(self, payload: Payload, transition_time: float) -> SetPayload.Response:
        """Return the answer; raise InvalidInputError if the payload is not set."""
        if not self._client.service_is_ready():
            raise InvalidInputError(
                f'the payload is not applied: there is no service {self._service}, expected the '
                'node dynamics to run')
        request = self._client.call_async(SetPayload.Request(
            payload=payload_to_ros(payload), transition_time=transition_time))
        self._executor.spin_until_future_complete(request, PATIENCE)
        if not request.done():
            self._client.remove_pending_request(request)
            raise InvalidInputError(
                f'the payload may not be applied: {self._service} has not answered in '
                f'{PATIENCE:g} s')
        answer = request.result()
        if not answer.success:
            raise InvalidInputError(f'the payload is not applied: {answer.message}')
        return answer

    def close(self) -> None:
        """Destroy the hidden node."""
        self._executor.shutdown()
        self._helper.destroy_node()
