# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes: contact levels from the file that `learn_contact_levels` writes."""


from closed_loop import closed_loop, NAMES, send, START
from disturbances import push
from free_motion_recording import learn_contact_levels, record_free_motion
import numpy as np
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.ros.middleware.conversions import stamp_from_ros
from robot_dynamics_interfaces.msg import Contact
from ros_harness import KEEP_MANY, LONG
from sensor_msgs.msg import JointState

LEFT = [0.3, 0.9]


def test_a_push_exceeds_the_learned_levels_and_motion_does_not(client, tmp_path):
    """In lock-step: as fast as in the recording, then pushed at rest."""
    record_free_motion(tmp_path)
    file = tmp_path / 'levels.yaml'
    assert learn_contact_levels(tmp_path, '-o', str(file)) == 0
    learned = read_parameter_file(file)
    with client.collect(Contact, '/learned/dynamics/contacts') as contacts, \
            client.collect(JointState, '/learned/joint_states', KEEP_MANY) as states, \
            closed_loop('/learned', arguments=('--ros-args', '--params-file', str(file))):
        contacts.wait_matched()
        client.wait_for(JointState, '/learned/dynamics/reference')  # the arm is held
        for goal in (LEFT, START):
            send(client, '/learned', (1.0, goal))
            states.wait_for(lambda m, goal=goal: np.allclose(
                m.position, goal, atol=0.01) and np.abs(m.velocity).max() < 0.1, LONG)
            states.clear()
        states.wait_count(50, LONG)
        assert not contacts.messages
        last = stamp_from_ros(states.messages[-1].header.stamp)
        push(client, '/learned/simulated_arm', (30.0, 0.0, 0.0))
        contact = contacts.wait_count(1, LONG)[0]
    assert stamp_from_ros(contact.header.stamp) > last
    i = NAMES.index(contact.joint_name)
    least = learned['contact.effort'][i]
    assert least <= contact.level < 2.0 * least
    assert abs(contact.effort) > contact.level
