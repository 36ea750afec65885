# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The verb `estimate_payload`: start an estimation, print the estimate, apply it."""

from argparse import Namespace
import math

from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics_interfaces.srv import EstimatePayload
from robot_dynamics_tools.payload_estimation.summary import parameter_rows
from robot_dynamics_tools.reporting.text_table import text_table
from robot_dynamics_tools.ros2_dynamics.answers import Answer, warning_lines
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient


def answer_estimate_payload(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Start an estimation if a link is given, else return the estimate so far."""
    if arguments.link and (arguments.apply or arguments.stop):
        raise InvalidInputError(
            f'LINK is {arguments.link!r} together with --apply or --stop, expected only one')
    request = EstimatePayload.Request(
        start=bool(arguments.link), link=arguments.link or '', apply=arguments.apply,
        stop=arguments.stop, transition_time=arguments.transition)
    monitor = client.monitor
    response = client.call(EstimatePayload, f'{monitor}/estimate_payload', request)
    text = f'{monitor}: {response.message}'
    data = {
        'node': monitor, 'message': response.message, 'link': response.link,
        'duration_s': response.duration, 'holds': response.holds,
        'parameters': list(response.parameters), 'values': list(response.values),
        'deviations': [value if math.isfinite(value) else None for value in response.deviations],
        'verdicts': list(response.verdicts),
        'per_percent_of_effort': list(response.per_percent_of_effort),
        'advice': list(response.advice), 'remarks': list(response.remarks),
        'warnings': list(response.warnings)}
    if response.parameters:
        rows = parameter_rows(
            response.values, response.deviations, response.per_percent_of_effort,
            response.verdicts)
        text += (f'\n{response.duration:.1f} s, {response.holds} holds\n\n'
                 f'{text_table(rows[0], rows[1:], left_columns=1)}\n')
        text += ''.join(f'\n{line}' for line in (
            *response.advice, *response.remarks, *warning_lines(response.warnings)))
    return Answer(data, text)
