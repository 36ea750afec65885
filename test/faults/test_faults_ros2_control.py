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

"""Faults in operation with ros2_control and with replayed recordings, on the real nodes."""

from fault_table import fault
import numpy as np
from ros_harness import KEEP_MANY, NodeProcess, RosClient, SIMULATED_ARM
from sensor_msgs.msg import JointState

GROUP = 'ros2_control and replayed recordings'
NAMES = ['joint1', 'joint2']

# ------------------------------------------------------------------ the drives of simulated_arm


@fault(GROUP, '`simulated_arm` receives 5,000 N m on a joint with an effort limit of 60 N m',
       '60 N m act on the arm and are reported; a warning names joint, value, limit and '
       '`clip_efforts`; with `clip_efforts: false` 5,000 N m act')
def test_an_effort_beyond_the_limit_is_clipped(client: RosClient) -> None:
    parameters = {'lock_step': True, 'rate': 500.0}
    with NodeProcess(
            SIMULATED_ARM, parameters, namespace='/clips',
            remaps={'/clock': '/clips/clock'}) as node, \
            client.collect(JointState, '/clips/joint_states', KEEP_MANY) as states:
        publisher = client.publisher(JointState, '/clips/effort_command', 1)

        def answer(effort: list[float]) -> JointState:
            state = states.wait_for()
            command = JointState(header=state.header, name=NAMES, effort=effort)
            after = client.ask(
                publisher, command, states, lambda m: m.header.stamp != state.header.stamp)
            states.clear()
            return after

        clipped = answer([1.0, -5000.0])
        assert list(clipped.effort) == [1.0, -60.0]
        assert np.isfinite(clipped.position).all()
        line = node.wait_for_log("Clipped the effort of 'joint2'")
        assert 'received -5000 N m, the effort limit of the URDF is 60 N m (clip_efforts)' in line
        result, = client.set_parameters('/clips/simulated_arm', {'clip_efforts': False})
        assert result.successful, result.reason
        assert list(answer([0.0, 5000.0]).effort) == [0.0, 5000.0]
        client.node.destroy_publisher(publisher)
