# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Other nodes: publishers of the same topics, and a node of the same name."""

from diagnostic_msgs.msg import DiagnosticStatus
from fault_table import fault, fault_cases
from ros_harness import DYNAMICS, NodeProcess, SIMULATED_ARM
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

GROUP = 'Other nodes'
WARNED = 'a warning in the log, and in the status `other nodes` until it has ended'


def is_alone(status: DiagnosticStatus) -> bool:
    return (status.level == DiagnosticStatus.OK
            and status.message == 'no other publisher or node of this name')


@fault_cases(('key', 'kind'), GROUP, 'a second publisher of `{}`', WARNED, (
    ('effort_command', 'effort_command', JointState),
    ('~/commands', '~/commands', Float64MultiArray)))
def test_a_second_publisher_of_the_command(bench, key, kind):
    bench.wait_status('other nodes', is_alone)
    full = f'{bench.namespace}/{key}'.replace('~', 'dynamics')
    words = f'{full} has other publishers: [{bench.client.node.get_fully_qualified_name()!r}]'
    publisher = bench.client.node.create_publisher(kind, full, 1)
    try:
        status = bench.wait_status('other nodes', lambda status: status.message == words)
        assert status.level == DiagnosticStatus.WARN
        assert bench.known('other nodes', f'publishers of {key}') == 2
        bench.check_alive()
        assert '[WARN]' in bench.node.wait_for_log(f'{full} has other publishers: .* Stop all')
    finally:
        bench.client.node.destroy_publisher(publisher)
    bench.wait_status('other nodes', is_alone)


@fault(GROUP, 'a second node of the same full name', WARNED)
def test_a_second_node_of_the_same_name(bench):
    full_name = f'{bench.namespace}/dynamics'
    bench.wait_status('other nodes', is_alone)
    with NodeProcess(DYNAMICS, {'autostart': False}, namespace=bench.namespace, ready=None):
        status = bench.wait_message('other nodes', f'.*another node is named {full_name}.*')
        assert status.level == DiagnosticStatus.WARN
        line = bench.node.wait_for_log(f'another node is named {full_name}')
        assert '[WARN]' in line
        assert '-r __node:=NAME' in line
    bench.wait_status('other nodes', is_alone)
    bench.check_alive()


@fault(GROUP, 'a second publisher of `joint_states` next to `simulated_arm`',
       'a warning in the log, which names the publisher')
def test_a_second_publisher_of_joint_states(client):
    with NodeProcess(SIMULATED_ARM, namespace='/faults_double') as arm:
        publisher = client.node.create_publisher(JointState, '/faults_double/joint_states', 1)
        try:
            line = arm.wait_for_log(
                '/faults_double/joint_states has other publishers: '
                rf"\['{client.node.get_fully_qualified_name()}'\]")
            assert '[WARN]' in line
        finally:
            client.node.destroy_publisher(publisher)
