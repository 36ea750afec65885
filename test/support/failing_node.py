# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A `dynamics` node with failing callbacks; no input of the real node makes its callbacks fail.

It is the real node in a separate process, with additional services, an additional subscription and
parameter callback, and a transition that fails once.
"""

import sys
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from robot_dynamics.ros.dynamics.node import DynamicsNode, USAGE
from robot_dynamics.ros.running import run_node
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

WORDS = 'as this test wants it'


class FailingNode(DynamicsNode):
    """A node that fails in every kind of callback."""

    def __init__(self) -> None:
        super().__init__()
        self._fails_cleanup = True
        self.create_service(Trigger, '~/raises', self._fail)
        self.create_service(Trigger, '~/answers_another_type', lambda *_: SetBool.Response())
        self.create_subscription(String, '~/raises', self._fail, 10)
        self.add_on_set_parameters_callback(self._judge)

    def _fail(self, *_: Any) -> Any:
        raise ZeroDivisionError(WORDS)

    def _judge(self, parameters: list[Parameter]) -> SetParametersResult:
        if any(parameter.name == 'hold_time' for parameter in parameters):
            self._fail()
        return SetParametersResult(successful=True)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Fail the first time."""
        if self._fails_cleanup:
            self._fails_cleanup = False
            self._fail()
        return super().on_cleanup(state)


if __name__ == '__main__':
    sys.exit(run_node(FailingNode, USAGE))
