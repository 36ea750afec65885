# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Callbacks that cannot end a node.

rclpy ends its spin if a callback raises an error, if the callback of a service returns None, or
if a parameter has an unknown type. Here the error is logged instead, and a service returns it in
its response.
"""

import atexit
from collections.abc import Callable, Sequence
import functools
import math
import time
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError, shortened
from robot_dynamics.ros.middleware.answer_delivery import ExecutorDelivery
from robot_dynamics.ros.middleware.joint_state_loop import LOG_PERIOD
from robot_dynamics.ros.middleware.message_bytes import LARGEST_MESSAGE, read_message
from robot_dynamics.ros.middleware.rclpy_internals import (
    RclError,
    replace_callback,
    UnknownArgumentsError,
)
from robot_dynamics.ros.middleware.shutdown import ends_in_time


def describe_error(error: Exception) -> str:
    """Return the text of an error, with its type if the error is unexpected."""
    if isinstance(error, (RobotDynamicsError, ParameterException)):
        return shortened(str(error))
    if isinstance(error, RclError):  # a trace through C files follows the message
        return shortened(' '.join(str(error).partition(', at /')[0].split()))
    if isinstance(error, UnknownArgumentsError):
        return shortened(f'unknown ROS arguments {error}')
    if isinstance(error, MemoryError):
        return 'this needs more memory than the limit of the node, expected less data at a time'
    return shortened(f'internal error: {error!r}')


class GuardedCallbacks(Node):
    """A base before `Node` or a subclass of it, for callbacks of topics, timers and services."""

    callback_errors = 0
    """Number of callbacks that failed with an unexpected error."""

    NAME = ''
    """Default name of the node."""

    def __init__(self, **node_arguments: object) -> None:
        """
        Take the keyword arguments of rclpy's Node, such as `namespace` or `parameter_overrides`.

        Raises RobotDynamicsError if the parameters or the description of the arm are invalid.
        """
        self._logged_at: dict[str, float] = {}
        self._answers = ExecutorDelivery(self)
        super().__init__(self.NAME, **node_arguments)
        atexit.register(self.destroy_node)  # its threads must end before the interpreter
        for service in self.services:  # rclpy creates some without `create_service`
            if replace_callback(service, self._answering):
                self._answers.take_over(service)
        try:
            self._set_up()
        except BaseException:  # threads of the middleware must not use destroyed objects at exit
            self.destroy_node()
            raise

    def _set_up(self) -> None:
        """Declare parameters, and create what the node needs; may raise RobotDynamicsError."""

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[..., None], *args: object,
        refuse: Callable[[Exception], None] | None = None,
        largest: int = LARGEST_MESSAGE, raw: bool = False, **more: object,
    ) -> Any:
        """
        Create a subscription whose callback cannot end the node.

        `refuse` receives the errors of the callback, and of messages that cannot be read or are
        larger than `largest` bytes. Without `refuse` the errors are logged.
        """
        report = refuse or functools.partial(self._rejected, topic)

        @functools.wraps(callback)
        def read(data: bytes, *info: Any) -> None:
            try:
                callback(read_message(data, msg_type, largest), *info)
            except Exception as error:
                report(error)

        return super().create_subscription(
            msg_type, topic, self._guarded(callback, topic) if raw else read, *args, raw=True,
            **more)

    def destroy_node(self) -> None:
        """Destroy the node, at the latest at exit; end the process if this takes too long."""
        atexit.unregister(self.destroy_node)
        with ends_in_time():
            super().destroy_node()

    def create_timer(
        self, timer_period_sec: float, callback: Callable[..., None], *args: object,
        **more: object,
    ) -> Any:
        """
        Create a timer whose callback cannot end the node.

        By default it follows the steady clock: simulated time may be paused.
        """
        more.setdefault('clock', Clock(clock_type=ClockType.STEADY_TIME))
        return super().create_timer(
            timer_period_sec, self._guarded(callback, 'a timer'), *args, **more)

    def create_guard_condition(
        self, callback: Callable[..., None], *args: object, **more: object,
    ) -> Any:
        """Create a guard condition whose callback cannot end the node."""
        return super().create_guard_condition(
            self._guarded(callback, 'a guard condition'), *args, **more)

    def call_when_spun(self, callback: Callable[[], None]) -> None:
        """Call back once, in the executor, when any executor first spins this node."""
        waiting = [callback]

        def call() -> None:
            while waiting:  # a MultiThreadedExecutor may call a guard condition twice
                waiting.pop()()

        self.create_guard_condition(call).trigger()

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., object], *args: object,
        **more: object,
    ) -> Any:
        """Create a service whose response contains the error if its callback fails."""
        service = super().create_service(
            srv_type, srv_name, self._answering(srv_type, srv_name, callback), *args, **more)
        self._answers.take_over(service)
        return service

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> (
            SetParametersResult):
        """Set all of these parameters or none; the reason of a rejection names the parameter."""
        for parameter in parameter_list:
            if not self.has_parameter(parameter.name):
                return SetParametersResult(successful=False, reason=shortened(
                    f'there is no parameter {parameter.name!r}, expected one of those that '
                    '~/list_parameters names'))
        result = super().set_parameters_atomically(parameter_list)
        names = [parameter.name for parameter in parameter_list]
        if not result.successful and not any(name in result.reason for name in names):
            result.reason = f'{", ".join(names)}: {result.reason}'
        return result

    def _answering(
        self, srv_type: Any, srv_name: str, callback: Callable[..., object],
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
                if not isinstance(error, RobotDynamicsError):
                    self._failed(srv_name, error)
                return _refusal(request, srv_type.Response(), describe_error(error))

        return answer

    def _rejected(self, topic: str, error: Exception) -> None:
        if not isinstance(error, RobotDynamicsError):
            self._failed(topic, error)
            return
        self.get_logger().error(
            f'Rejected a message of {topic}: {describe_error(error)}',
            throttle_duration_sec=LOG_PERIOD)

    def _guarded(self, callback: Callable[..., None], what: str) -> Callable[..., None]:
        @functools.wraps(callback)
        def call(*args: object) -> None:
            try:
                callback(*args)
            except Exception as error:
                self._failed(what, error)

        return call

    def _failed(self, what: str, error: Exception) -> None:
        self.callback_errors += 1
        if self.context.ok():
            self.log_rarely(
                what, self.get_logger().error,
                f'The callback of {what} failed: {describe_error(error)}')

    def log_rarely(self, kind: str, log: Callable[[str], object], words: str) -> None:
        """Call `log` at most once per kind and LOG_PERIOD: rclpy throttles per source line."""
        now = time.monotonic()
        if now - self._logged_at.get(kind, -math.inf) >= LOG_PERIOD:
            self._logged_at[kind] = now
            log(words)


def _check_parameter_types(request: Any) -> None:
    """Raise InvalidInputError if rclpy would raise after it has set some of the parameters."""
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
    """Put an error into the fields of a response that can contain it."""
    refused = SetParametersResult(successful=False, reason=reason)
    if isinstance(request, SetParameters.Request):
        response.results = [refused] * len(request.parameters)
    elif isinstance(request, SetParametersAtomically.Request):
        response.result = refused
    elif hasattr(response, 'message'):
        response.success, response.message = False, reason
    return response
