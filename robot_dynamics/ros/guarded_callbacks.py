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
Callbacks that cannot end a node.

rclpy ends its spin at whatever a callback raises, at a service that answers None, and at a
parameter of a type that it does not know. Here an error is logged instead, and a service answers
with what failed.
"""

import atexit
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import functools
import math
import time
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_dynamics.exceptions import InvalidInputError, LONGEST_MESSAGE, RobotDynamicsError
from robot_dynamics.ros.answer_delivery import AnswerDelivery
from robot_dynamics.ros.message_bytes import (
    LARGEST_MESSAGE,
    read_message,
    UnreadableMessageError,
)
from robot_dynamics.ros.message_loop import LOG_PERIOD
from robot_dynamics.ros.rclpy_internals import RclError, replace_callback, UnknownArgumentsError
from robot_dynamics.ros.shutdown import ends_in_time

LONGEST_REASON = LONGEST_MESSAGE
"""Characters; a reason that quotes more of what arrived leaves out its middle."""


@contextmanager
def destroyed_unless_made(node: Node) -> Iterator[None]:
    """
    Destroy a node that cannot be set up, in the statement, before its error goes on.

    Left to the end of the process, the middleware's threads may meet what is gone by then, and
    the process ends by a signal instead of with its status.
    """
    try:
        yield
    except BaseException:
        node.destroy_node()
        raise


def describe_error(error: Exception) -> str:
    """Return what is wrong in words; of an error that nobody foresaw, its type too."""
    words = _words_of(error)
    half = LONGEST_REASON // 2
    return words if len(words) <= LONGEST_REASON else f'{words[:half]} … {words[-half:]}'


def _words_of(error: Exception) -> str:
    if isinstance(error, (RobotDynamicsError, ParameterException)):
        return str(error)
    if isinstance(error, RclError):  # whose trace through C files follows
        return ' '.join(str(error).partition(', at /')[0].split())
    if isinstance(error, UnknownArgumentsError):
        return f'unknown ROS arguments {error}'
    if isinstance(error, MemoryError):
        return 'this takes more memory than the node may have, expected less at a time'
    return f'internal error: {error!r}'


class GuardedCallbacks(Node):
    """A base before `Node` or a subclass of it, for callbacks of topics, timers and services."""

    callback_errors = 0
    """Callbacks that failed with an error that nobody foresaw."""

    def __init__(self, *args: Any, **more: Any) -> None:
        self._logged_at: dict[str, float] = {}
        self._answers = AnswerDelivery(self)
        super().__init__(*args, **more)
        atexit.register(self.destroy_node)  # its threads must end before the interpreter does
        for service in self.services:  # rclpy makes some past `create_service`
            if replace_callback(service, self._answering):
                self._answers.take_over(service)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., None], *args: Any,
        refuse: Callable[[UnreadableMessageError], None] | None = None,
        largest: int = LARGEST_MESSAGE, raw: bool = False, **more: Any,
    ) -> Any:
        """
        Create a subscription whose callback cannot end the node.

        `refuse` gets the errors of messages that cannot be read, or are larger than `largest`
        bytes; without it they are logged.
        """
        guarded = self._guarded(callback, topic)
        report = refuse or functools.partial(self._unreadable, topic)

        @functools.wraps(callback)
        def read(data: bytes, *info: Any) -> None:
            try:
                message = read_message(data, msg_type, largest)
            except UnreadableMessageError as error:
                report(error)
            else:
                guarded(message, *info)

        return super().create_subscription(
            msg_type, topic, guarded if raw else read, *args, raw=True, **more)

    def destroy_node(self) -> None:
        """Destroy the node, at exit at the latest; end the process where that does not end."""
        atexit.unregister(self.destroy_node)
        with ends_in_time():
            super().destroy_node()

    def create_timer(
        self, timer_period_sec: float, callback: Callable[..., None], *args: Any, **more: Any,
    ) -> Any:
        """Create a timer whose callback cannot end the node."""
        return super().create_timer(
            timer_period_sec, self._guarded(callback, 'a timer'), *args, **more)

    def call_when_spun(self, callback: Callable[[], None]) -> None:
        """Call back once, in the executor, when any executor first spins this node."""
        waiting = [callback]

        def call() -> None:
            while waiting:  # a MultiThreadedExecutor may call a guard condition twice
                waiting.pop()()

        self.create_guard_condition(self._guarded(call, 'the first spin')).trigger()

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any], *args: Any, **more: Any,
    ) -> Any:
        """Create a service that answers with what failed where its callback fails."""
        service = super().create_service(
            srv_type, srv_name, self._answering(srv_type, srv_name, callback), *args, **more)
        self._answers.take_over(service)
        return service

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> (
            SetParametersResult):
        """Set all of these or none; say in a refusal which parameter it is about."""
        for parameter in parameter_list:
            if not self.has_parameter(parameter.name):
                error = InvalidInputError(
                    f'there is no parameter {parameter.name!r}, expected one of those that '
                    '~/list_parameters names')
                return SetParametersResult(successful=False, reason=describe_error(error))
        result = super().set_parameters_atomically(parameter_list)
        names = [parameter.name for parameter in parameter_list]
        if not result.successful and not any(name in result.reason for name in names):
            result.reason = f'{", ".join(names)}: {result.reason}'
        return result

    def _answering(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any],
    ) -> Callable[..., Any]:
        @functools.wraps(callback)
        def answer(request: Any, response: Any) -> Any:
            try:
                _check_parameter_types(request)
                answered = callback(request, response)
                if not isinstance(answered, srv_type.Response):
                    raise TypeError(f'the service {srv_name} answered {answered!r}')
                return answered
            except Exception as error:
                self._failed(srv_name, error)
                return _refusal(request, srv_type.Response(), describe_error(error))

        return answer

    def _unreadable(self, topic: str, error: UnreadableMessageError) -> None:
        self.get_logger().error(
            f'Refused a message of {topic}: {error}', throttle_duration_sec=LOG_PERIOD)

    def _guarded(self, callback: Callable[..., None], what: str) -> Callable[..., None]:
        @functools.wraps(callback)
        def call(*args: Any) -> None:
            try:
                callback(*args)
            except Exception as error:
                self._failed(what, error)

        return call

    def _failed(self, what: str, error: Exception) -> None:
        self.callback_errors += 1
        # Each callback has its own pause, which rclpy's throttle would give all of them together.
        now = time.monotonic()
        if self.context.ok() and now - self._logged_at.get(what, -math.inf) > LOG_PERIOD:
            self._logged_at[what] = now
            self.get_logger().error(f'The callback of {what} failed: {describe_error(error)}')


def _check_parameter_types(request: Any) -> None:
    """Raise InvalidInputError where rclpy would raise with half of the parameters set."""
    if not isinstance(request, (SetParameters.Request, SetParametersAtomically.Request)):
        return
    known = {kind.value for kind in Parameter.Type}
    for parameter in request.parameters:
        if parameter.value.type not in known:
            raise InvalidInputError(
                f'parameter {parameter.name!r} has the type {parameter.value.type}, expected '
                f'one of {sorted(known)}, of rcl_interfaces/msg/ParameterType; none of the '
                'request was set')


def _refusal(request: Any, response: Any, reason: str) -> Any:
    """Say in a response what failed, wherever its type has a place for that."""
    refused = SetParametersResult(successful=False, reason=reason)
    if isinstance(request, SetParameters.Request):
        response.results = [refused] * len(request.parameters)
    elif isinstance(request, SetParametersAtomically.Request):
        response.result = refused
    elif hasattr(response, 'message'):
        response.success, response.message = False, reason
    return response
