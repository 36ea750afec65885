# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of `dynamics_monitor`: those that it does not take from `dynamics`."""

from rclpy.exceptions import InvalidTopicNameException
from rclpy.expand_topic_name import expand_topic_name
from rclpy.validate_full_topic_name import validate_full_topic_name
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.ros.parameters.declared_parameters import number, text
from robot_dynamics.ros.parameters.robot_description import REPORT_COVARIANCE_SPEC
from robot_dynamics_tools.monitoring.external_wrench import LARGEST_FORCE, LARGEST_TORQUE

SPECS = (
    text('dynamics', 'dynamics', (
        'Name of the node whose model, parameters and payloads are used, in the namespace of '
        'this node unless it starts with a slash.'), read_only=True),
    number('residual_bandwidth', 10.0, 0.01, 1000.0, (
        'Cut-off frequency [Hz] of the second-order low-pass filter of ~/residual.')),
    text('external_wrench.frame', '', (
        'Link at whose origin, and in whose axes, ~/external_wrench is estimated. If empty, the '
        'link at the end of the arm.'), read_only=True),
    number('external_wrench.largest_force', LARGEST_FORCE, 1e-3, 1e6, (
        'Largest expected external force [N]. Directions of ~/external_wrench in which the joint '
        'efforts are less certain than this count as not observable.'), read_only=True),
    number('external_wrench.largest_torque', LARGEST_TORQUE, 1e-3, 1e6, (
        'Largest expected external torque [N·m] about the origin of external_wrench.frame.'),
        read_only=True),
    REPORT_COVARIANCE_SPEC,
)


def full_name(name: str, namespace: str) -> str:
    """Return the full name of the node `dynamics`; raise InvalidInputError for no name."""
    try:
        found = str(expand_topic_name(name, 'dynamics_monitor', namespace))
        validate_full_topic_name(found)
    except (InvalidTopicNameException, ValueError):
        found = ''
    if not found or '~' in name:
        raise InvalidInputError(
            f'dynamics is {name!r}, expected the name of a node, such as dynamics or '
            '/left/dynamics')
    return found
