# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the verbs of `ros2 dynamics` answer: each as data for JSON, and as text for people."""

from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import InertiaStamped
from lifecycle_msgs.srv import GetState
import numpy as np
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.joints.units import LINEAR, ROTARY
from robot_dynamics.ros.middleware.diagnostics import (
    DRIVE_STIFFNESS,
    FRICTION_ERROR,
    STIFFNESS,
    values_per_joint,
)
from robot_dynamics_interfaces.srv import InverseDynamics, ManipulatorEquation, SetPayload
from robot_dynamics_tools.reporting.text_table import matrix_table, text_table
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient, NoAnswerError
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values

TERMS = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')
MOTORS = {
    'motor_current': 'current [A]', 'motor_voltage': 'voltage [V]',
    'current_ratio': 'of its limit', 'voltage_ratio': 'of its limit'}
DERIVATIVES = {f'effort_{by}_derivative': by for by in ('position', 'velocity', 'acceleration')}
LEVELS = {
    DiagnosticStatus.OK: 'ok', DiagnosticStatus.WARN: 'warning', DiagnosticStatus.ERROR: 'ERROR',
    DiagnosticStatus.STALE: 'stale'}


class Answer(NamedTuple):
    """What a verb answers: `data` for JSON, `text` for people, the exit status."""

    data: Mapping[str, Any]
    text: str
    status: int = 0


class Units(NamedTuple):
    """The units of positions and efforts of an arm, and a column of kinds where they differ."""

    position: str
    effort: str
    kinds: Mapping[str, str]

    @classmethod
    def of(cls, names: Sequence[str], kinds: Mapping[str, str]) -> 'Units':
        """Return the units of these joints; both where their kinds are not known."""
        slides = {kinds[name] == 'prismatic' for name in names} if set(names) <= set(kinds) else (
            {True, False})
        if slides == {False}:
            return cls(ROTARY.position, ROTARY.effort, {})
        if slides == {True}:
            return cls(LINEAR.position, LINEAR.effort, {})
        return cls('rad, m', 'N·m, N', {name: kinds.get(name, '') for name in names})

    @property
    def error(self) -> str:
        """The units of position errors: mrad, mm."""
        return ', '.join(f'm{unit}' for unit in self.position.split(', '))

    def table(
        self, headings: Sequence[str], columns: Mapping[str, Sequence[float | str]],
    ) -> str:
        """Return a table of values by joint; `columns` have a unit in their headings."""
        heads = ['joint', 'kind'] if self.kinds else ['joint']
        rows = [[name, self.kinds[name], *values] if self.kinds else [name, *values]
                for name, *values in zip(headings, *columns.values())]
        return text_table([*heads, *columns], rows, left_columns=len(heads))


def answer_inverse(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the efforts of a motion."""
    names, motion = _motion(client, arguments, ('position', 'velocity', 'acceleration'))
    response = client.call(InverseDynamics, 'inverse_dynamics', InverseDynamics.Request(
        joint_names=names, include_derivatives=arguments.derivatives, **motion))
    terms = {name: list(getattr(response.terms, name)) for name in TERMS}
    motors = {field: list(getattr(response, field)) for field in MOTORS}
    units = Units.of(names, {} if arguments.json else client.joint_kinds())
    energies = _energies(response.terms)
    blocks = [
        _motion_table(units, names, motion),
        f'Effort by term [{units.effort}]\n{units.table(names, terms)}']
    deviation = list(response.effort_deviation)
    if deviation:
        heading = f'deviation [{units.effort}]'
        blocks.append('Standard deviation of a measured effort, by model and noise\n'
                      + units.table(names, {heading: deviation}))
    derivatives = {}
    if arguments.derivatives:
        for field, by in DERIVATIVES.items():
            D = np.reshape(getattr(response, field), (len(names), -1))
            derivatives[field] = D.tolist()
            blocks.append(f'Derivative of the efforts by {by}\n{matrix_table("", names, D)}')
    if motors['motor_current']:
        blocks.append('Motors\n' + text_table(
            ['joint', *MOTORS.values()],
            [[name, *row] for name, *row in zip(names, *motors.values())]))
    blocks.append(_in_words(energies))
    blocks += warning_lines(response.warnings)
    optional = {'effort_deviation': deviation, **derivatives, **motors}
    return Answer({
        'node': client.name, 'joint_names': names, **motion, 'effort': list(response.effort),
        'terms': terms, **energies, **{key: value for key, value in optional.items() if value},
        'warnings': list(response.warnings)}, '\n\n'.join(blocks))


def warning_lines(warnings: Iterable[str]) -> list[str]:
    """Return the warnings of a response as lines of text."""
    return [f'Warning: {warning}' for warning in warnings]


def answer_equation(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the parts of the manipulator equation."""
    names, motion = _motion(client, arguments, ('position', 'velocity'))
    n = len(names)
    response = client.call(
        ManipulatorEquation, 'manipulator_equation', ManipulatorEquation.Request(
            joint_names=names, include_christoffel=arguments.christoffel, **motion))
    M = np.array(response.mass_matrix).reshape(n, n)
    C = np.array(response.coriolis_matrix).reshape(n, n)
    vectors = {
        'gravity': list(response.gravity), 'nonlinear': list(response.nonlinear),
        'friction': list(response.friction)}
    units = Units.of(names, {} if arguments.json else client.joint_kinds())
    energies = _energies(response)
    inertia = {'N·m': 'kg·m²', 'N': 'kg'}.get(units.effort, 'kg·m², kg·m, kg')
    rate = {'N·m': 'N·m·s/rad', 'N': 'N·s/m'}.get(units.effort, 'N·m·s, N·s, N·s/m')
    blocks = [
        _motion_table(units, names, motion),
        f'Mass matrix M(q) [{inertia}]\n{matrix_table("", names, M)}',
        f'Coriolis matrix C(q, v) [{rate}]\n{matrix_table("", names, C)}',
        f'Vectors [{units.effort}]\n' + units.table(names, {
            'g(q)': vectors['gravity'], 'C v + g': vectors['nonlinear'],
            'friction': vectors['friction']})]
    data = {
        'node': client.name, 'joint_names': names, **motion, 'mass_matrix': M.tolist(),
        'coriolis_matrix': C.tolist(), **vectors, **energies, 'warnings': list(response.warnings)}
    if arguments.christoffel:
        c = np.array(response.christoffel).reshape(n, n, n)
        data['christoffel'] = c.tolist()
        rows = [[names[i], names[j], names[k], float(c[i, j, k])]
                for i, j, k in np.argwhere(np.abs(c) > 1e-12)]
        blocks.append('Christoffel symbols c_ijk that are not 0\n' + text_table(
            ['i', 'j', 'k', 'c_ijk'], rows))
    blocks.append(_in_words(energies))
    blocks += warning_lines(response.warnings)
    return Answer(data, '\n\n'.join(blocks))


def answer_check(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return what the model check finds in URDF, friction and motors of the node."""
    from robot_dynamics.model.arm_parameters import arm_from_parameters
    from robot_dynamics.model_check.finding import CHECKS, errors_of
    from robot_dynamics.model_check.report import (
        check_description,
        findings_as_data,
        findings_report,
    )
    from robot_dynamics.ros.parameters.robot_description import ACTUATOR_SPECS, FRICTION_SPECS
    from robot_dynamics.validation import check_choice
    parameters = client.parameters(['joints', 'ignore_checks', 'gravity', *(
        spec.name for spec in (*ACTUATOR_SPECS, *FRICTION_SPECS))])
    ignored = arguments.ignore if arguments.ignore is not None else parameters['ignore_checks']
    for name in ignored:
        check_choice('--ignore', name, tuple(CHECKS))
    xml = client.description()
    try:
        arm = arm_from_parameters(xml, parameters)
    except ModelError:
        arm = None  # a finding
    checked = check_description(xml, list(parameters['joints'] or []), arm)
    return Answer(
        {'node': client.name, **findings_as_data(checked, ignored)},
        findings_report(client.name, checked, ignored),
        1 if errors_of(checked.findings, ignored) else 0)


def answer_payload(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the active payloads, after a change if one is requested."""
    if arguments.clear and arguments.link:
        raise InvalidInputError(
            f'LINK is {arguments.link!r} together with --clear, expected only one')
    if arguments.link and arguments.mass is None:
        raise InvalidInputError(f'LINK is {arguments.link!r} without a MASS, expected both')
    if arguments.link or arguments.clear:
        request = SetPayload.Request(
            payload=_payload_to_ros(arguments), transition_time=arguments.transition)
        response = client.call(SetPayload, 'set_payload', request)
        data = {'node': client.name, 'message': response.message,
                'transition_time': arguments.transition, 'warnings': list(response.warnings)}
        lines = [f'{client.name}: {response.message}' + (
            f', in {arguments.transition:g} s' if arguments.transition else ''),
            *warning_lines(response.warnings)]
        if arguments.simulated:
            arm = client.resolve('simulated_arm')
            data['simulated'] = client.call(
                SetPayload, f'{arm}/set_payload', request).message
            lines.append(f'{arm}: {data["simulated"]}')
        return Answer(data, '\n'.join(lines))
    payloads = _payloads_in_force(client)
    if payloads is None:
        raise NoAnswerError(f'{client.name} does not publish its payloads')
    return Answer({'node': client.name, 'payload': payloads[-1], 'payloads': _loads(payloads)},
                  f'{client.name}: {_describe_payloads(payloads)}')


AT_REST = (
    'At rest: stiffness of the feedback [N·m/rad, N/m], and position error [rad, m] up to which '
    'the\nknown dry friction can hold a joint')


def values_at_rest(node: str, statuses: Iterable[DiagnosticStatus]) -> dict[str, dict[str, float]]:
    """Return stiffness and error by joint in the diagnostics, and the stiffness of drives."""
    pairs = [pair for status in statuses if status.name == f'{node}: reference'
             for pair in status.values]
    drives = values_per_joint(pairs, DRIVE_STIFFNESS)
    return {'stiffness': values_per_joint(pairs, STIFFNESS),
            'friction_error': values_per_joint(pairs, FRICTION_ERROR),
            **({'drive_stiffness': drives} if drives else {})}


def answer_status(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return how the node is."""
    name = client.name
    state = client.call(GetState, 'get_state', GetState.Request()).current_state.label
    command = client.parameters(['command'])['command']
    joints = client.joint_names() if state in ('active', 'inactive') else []
    payloads = _payloads_in_force(client) if joints else None
    checks = client.receive(DiagnosticArray, '/diagnostics', 10, lambda message: [
        status for status in message.status if status.name.startswith(f'{name}: ')] or None)
    if checks is None:
        raise NoAnswerError(f'{name} sends no /diagnostics')
    rows = [[status.name.partition(': ')[2], LEVELS[status.level], status.message]
            for status in checks]
    facts = {'state': state, 'command': command, 'joints': ', '.join(joints) or 'none yet'}
    facts |= {} if payloads is None else {'payload': _describe_payloads(payloads)}
    blocks = [f'{name}\n' + text_table([], list(facts.items())),
              text_table(['check', 'level', 'message'], rows)]
    at_rest = values_at_rest(name, checks)
    if any(at_rest.values()):
        blocks.insert(1, AT_REST + '\n' + text_table(
            ['joint', *at_rest], [
                [joint, *(f'{values[joint]:.4g}' if joint in values else '-'
                          for values in at_rest.values())]
                for joint in joints]))
    if arguments.verbose:
        blocks += [f'{row[0]}\n' + text_table([], [
            [pair.key, pair.value] for pair in status.values])
            for row, status in zip(rows, checks) if status.values]
    return Answer(
        {'node': name, **facts, 'joints': joints,
         'at_rest': at_rest, 'payload': payloads[-1] if payloads else None,
         'payloads': _loads(payloads or ()), 'checks': [
            {'check': row[0], 'level': row[1].lower(), 'message': row[2],
             'values': {pair.key: pair.value for pair in status.values}}
            for row, status in zip(rows, checks)]},
        '\n\n'.join(blocks),
        1 if any(status.level == DiagnosticStatus.ERROR for status in checks) else 0)


# ------------------------------------------------------------------------------ motions, energies

def _motion(
    client: DynamicsClient, arguments: Namespace, fields: Sequence[str],
) -> tuple[list[str], dict[str, list[float]]]:
    """Return the joints, and the motion of the arguments in the same order."""
    names = client.joint_names()
    motion = {'position': joint_values('position', arguments.position, names)}
    for field in fields[1:]:
        texts = getattr(arguments, field)
        motion[field] = joint_values(field, texts, names, 0.0) if texts else [0.0] * len(names)
    return names, motion


def _motion_table(units: Units, names: Sequence[str], motion: Mapping[str, list[float]]) -> str:
    of_time = {'position': '', 'velocity': '/s', 'acceleration': '/s²'}
    return 'Motion\n' + units.table(names, {
        f'{field} [{", ".join(unit + of_time[field] for unit in units.position.split(", "))}]':
            values for field, values in motion.items()})


def _energies(message: Any) -> dict[str, float]:
    return {'kinetic_energy': message.kinetic_energy, 'potential_energy': message.potential_energy}


def _in_words(energies: Mapping[str, float]) -> str:
    return (f'Kinetic energy {energies["kinetic_energy"]:.4f} J, potential energy '
            f'{energies["potential_energy"]:.4f} J')


# ------------------------------------------------------------------------------ the payload

def _payload_to_ros(arguments: Namespace) -> InertiaStamped:
    message = InertiaStamped()
    if arguments.clear:
        return message
    message.header.frame_id = arguments.link
    inertia = message.inertia
    inertia.m = arguments.mass
    inertia.com.x, inertia.com.y, inertia.com.z = arguments.com
    (inertia.ixx, inertia.ixy, inertia.ixz,
     inertia.iyy, inertia.iyz, inertia.izz) = arguments.inertia
    return message


def _payloads_in_force(client: DynamicsClient) -> list[dict[str, Any]] | None:
    """Return the messages with the newest stamp: all payloads; None without any message."""
    messages = client.receive_latched(InertiaStamped, f'{client.name}/payload')
    if not messages:
        return None
    newest = messages[-1].header.stamp
    return [_payload_as_data(message) for message in messages
            if message.header.stamp == newest]


def _loads(payloads: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [payload for payload in payloads if payload['mass'] > 0.0]


def _payload_as_data(message: InertiaStamped) -> dict[str, Any]:
    inertia = message.inertia
    return {
        'link': message.header.frame_id, 'mass': inertia.m,
        'com': [inertia.com.x, inertia.com.y, inertia.com.z],
        'inertia': [inertia.ixx, inertia.ixy, inertia.ixz, inertia.iyy, inertia.iyz, inertia.izz]}


def _describe_payloads(payloads: Sequence[Mapping[str, Any]]) -> str:
    return '; '.join(
        f'{one["mass"]:g} kg on {one["link"]!r}, centre of mass '
        f'({", ".join(f"{value:g}" for value in one["com"])}) m'
        for one in payloads if one['mass'] > 0.0) or 'no payload'
