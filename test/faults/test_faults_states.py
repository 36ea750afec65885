# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint states with invalid values, joints or lengths, and anomalous but valid states."""


from diagnostic_msgs.msg import DiagnosticStatus
from fault_bench import Change, FaultBench, figure_of, NAMES, Q
from fault_stimuli import altered
from fault_table import fault, fault_cases
import pytest
from robot_dynamics.planar.urdf import default_arm_urdf
from sensor_msgs.msg import JointState

NAN, INF = float('nan'), float('inf')
pytestmark = pytest.mark.usefixtures('holding')
GROUP = 'Joint states'
DROPPED = 'dropped and reported; fault `state_timeout` without valid states; commands resume'
ANSWERED = 'answered as usual'
BENCH = {'parameters': {'robot_description': default_arm_urdf()}}


def check_dropped(bench: FaultBench, change: Change, reason: str, reported: str = '') -> None:
    """Check that these states are counted and reported as dropped, and cause a fault."""
    key = f'dropped: {reason}'
    before = bench.known('joint states', key)
    bench.driver.change = change
    bench.wait_status('joint states', lambda status: (
        figure_of(status, key) > before and reported in status.message))
    bench.wait_state_timeout()


@fault_cases(('fields', 'reported'), GROUP, '{}', DROPPED, (
    ('NaN in a position of a joint in use', {'position': [NAN, 0.0]},
     "position of 'joint1' is"),
    ('infinity in a velocity of a joint in use', {'velocity': [0.0, -INF]},
     "velocity of 'joint2' is"),
    ('a duplicate joint', {'name': [*NAMES, 'joint1'], 'position': [*Q, 0.0], 'velocity': []},
     "name has 'joint1' twice"),
    ('fewer positions than names', {'position': Q[:1]}, 'position has 1 values, expected 2')))
def test_a_state_that_cannot_be_used(bench, fields, reported):
    check_dropped(bench, altered(**fields), 'invalid', reported)


@fault(GROUP, 'a missing joint', 'reported as incomplete, with the joint; fault `state_timeout`; '
       'commands resume')
def test_a_joint_that_is_missing(bench):
    bench.driver.change = altered(name=NAMES[:1], position=Q[:1], velocity=[0.0])
    bench.wait_status('joint states', lambda status: (
        status.level == DiagnosticStatus.ERROR
        and "no samples of ['joint2']" in status.message))
    bench.wait_state_timeout()


@fault_cases('velocity', GROUP, '{}', 'the velocity is that of the positions', (
    ('NaN in a velocity of a joint in use', [NAN, 0.0]),
    ('more velocities than names', [0.0] * 3), ('no velocities', [])))
def test_velocities_that_are_missing(bench, velocity):
    bench.driver.change = altered(velocity=velocity)
    bench.efforts.clear()
    bench.check_hold(50)


@fault_cases(
    'change', GROUP, '{}', 'ignored and counted; fault `state_timeout` without valid states; '
    'commands resume', (
        ('positions without names', altered(name=[])),
        ('only joints of another robot', altered(name=['left', 'right']))))
def test_a_state_of_no_joint_of_this_arm(bench, change):
    check_dropped(bench, change, 'other joints')


@fault_cases('fields', GROUP, '{}', ANSWERED, (
    ('another order of joints, and NaN efforts', {
        'name': NAMES[::-1], 'position': Q[::-1], 'effort': [NAN, NAN]}),
    ('fewer efforts than names', {'effort': [1.0]}),
    ('additional joints, with NaN and infinity', {
        'name': ['wheel', NAMES[0], 'lid', NAMES[1]],
        'position': [NAN, Q[0], -9.0, Q[1]], 'velocity': [1.0, 0.0, INF, 0.0]}),
    ('a duplicate joint that is not in use', {
        'name': ['wheel', *NAMES, 'wheel'], 'position': [1.0, *Q, 2.0], 'velocity': []}),
    ('no stamp (0)', {'header': JointState().header})))
def test_an_anomalous_state(bench, fields):
    bench.efforts.clear()
    bench.driver.change = altered(**fields)
    bench.check_hold(50)
    bench.check_efforts()
    bench.check_alive()
    assert bench.status('command').level != DiagnosticStatus.ERROR


def many_joints(count: int) -> Change:
    """Return a change that adds other joints, up to `count` in total."""
    others = [f'other{i}' for i in range(count - 2)]
    message = JointState(
        name=[*others, *NAMES], position=[0.0] * len(others) + Q, velocity=[0.0] * count)

    def change(state: JointState) -> JointState:
        message.header = state.header
        return message

    return change


@fault(GROUP, '10,000 additional joints', ANSWERED)
def test_many_joints(bench):
    bench.efforts.clear()
    bench.driver.change = many_joints(10_000)
    bench.check_hold(5)


@fault(GROUP, 'a message of 200,000 joints', 'dropped undecoded, because decoding would delay '
       'control; reported in a short line; fault `state_timeout` without valid states; commands '
       'resume')
def test_a_message_of_200_000_joints(bench):
    check_dropped(bench, many_joints(200_000), 'unreadable', 'bytes, expected at most 1000000')
    assert max(map(len, bench.node.log.splitlines())) < 400
