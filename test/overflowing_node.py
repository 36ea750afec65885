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
A `dynamics` node whose model overflows while a test wants it: no input that is let in does that.

It is the node itself, in its own process, with a service `~/overflow` beside those that it has.
"""

import sys

import numpy as np
from robot_dynamics.rigid_body import RigidBody
from robot_dynamics.ros.dynamics_node import DynamicsNode
from robot_dynamics.ros.running import run_node
from robot_dynamics.validation import FloatArray
from std_srvs.srv import SetBool


class OverflowingBody(RigidBody):
    """Rigid bodies whose gravity is beyond all numbers while `overflows`."""

    overflows = False

    def gravity(self, q: FloatArray) -> FloatArray:
        """Return g(q), or infinity."""
        return np.full_like(q, np.inf) if self.overflows else super().gravity(q)


class OverflowingNode(DynamicsNode):
    """Commands by such bodies."""

    def __init__(self) -> None:
        super().__init__()
        self.create_service(SetBool, '~/overflow', self._overflow)

    def _overflow(self, request: SetBool.Request, response: SetBool.Response) -> (
            SetBool.Response):
        assert self._controller is not None
        body = self._controller._dynamics.rigid_body
        body.__class__ = OverflowingBody
        body.overflows = request.data
        response.success = True
        return response


if __name__ == '__main__':
    sys.exit(run_node(OverflowingNode))
