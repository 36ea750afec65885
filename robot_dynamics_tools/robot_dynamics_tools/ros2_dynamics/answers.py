# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What the verbs of `ros2 dynamics` answer: each as data for JSON, and as text for people."""

from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from robot_dynamics.exceptions import ModelError
from robot_dynamics.joints.units import LINEAR, ROTARY
from robot_dynamics_interfaces.srv import InverseDynamics, ManipulatorEquation
from robot_dynamics_tools.reporting.text_table import matrix_table, text_table
from robot_dynamics_tools.ros2_dynamics.client import DynamicsClient
from robot_dynamics_tools.ros2_dynamics.joint_arguments import joint_values

TERMS = ('inertial', 'coriolis', 'gravity', 'friction', 'external', 'effort')
MOTORS = {
    'motor_current': 'current [A]', 'motor_voltage': 'voltage [V]',
    'current_ratio': 'of its limit', 'voltage_ratio': 'of its limit'}
VECTORS = {'gravity': 'g(q)', 'nonlinear': 'C v + g', 'friction': 'friction'}
DERIVATIVES = {f'effort_{by}_derivative': by for by in ('position', 'velocity', 'acceleration')}


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

    def table(self, names: Sequence[str], columns: Mapping[str, Sequence[float | str]]) -> str:
        """Return a table of values by joint; `columns` have a unit in their headings."""
        first = {'joint': names, **self.kind_column(names)}
        rows = list(zip(*first.values(), *columns.values()))
        return text_table([*first, *columns], rows, left_columns=len(first))

    def kind_column(self, names: Sequence[str]) -> dict[str, Sequence[str]]:
        """Return the column of the kinds of these joints, nothing if they do not differ."""
        return {'kind': [self.kinds[name] for name in names]} if self.kinds else {}


def answer_inverse(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the efforts of a motion."""
    names, motion, units = state = _state(
        client, arguments, ('position', 'velocity', 'acceleration'))
    response = client.call(InverseDynamics, 'inverse_dynamics', InverseDynamics.Request(
        joint_names=names, include_derivatives=arguments.derivatives, **motion))
    terms = {name: list(getattr(response.terms, name)) for name in TERMS}
    motors = {field: list(getattr(response, field)) for field in MOTORS}
    blocks = [f'Effort by term [{units.effort}]\n{units.table(names, terms)}']
    deviation = list(response.effort_deviation)
    if deviation:
        heading = f'deviation [{units.effort}]'
        blocks.append('Standard deviation of a measured effort, by model and noise\n'
                      + units.table(names, {heading: deviation}))
    derivatives = {}
    for field, by in DERIVATIVES.items() if arguments.derivatives else ():
        D = np.reshape(getattr(response, field), (len(names), -1))
        derivatives[field] = D.tolist()
        blocks.append(f'Derivative of the efforts by {by}\n{matrix_table("", names, D)}')
    if motors['motor_current']:
        blocks.append('Motors\n' + text_table(
            ['joint', *MOTORS.values()], list(zip(names, *motors.values()))))
    optional = {'effort_deviation': deviation, **derivatives, **motors}
    return _answer(client, state, blocks, {
        'effort': list(response.effort), 'terms': terms,
        **{key: value for key, value in optional.items() if value}},
        response.terms, response.warnings)


def warning_lines(warnings: Iterable[str]) -> list[str]:
    """Return the warnings of a response as lines of text."""
    return [f'Warning: {warning}' for warning in warnings]


def answer_equation(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return the parts of the manipulator equation."""
    names, motion, units = state = _state(client, arguments, ('position', 'velocity'))
    n = len(names)
    response = client.call(
        ManipulatorEquation, 'manipulator_equation', ManipulatorEquation.Request(
            joint_names=names, include_christoffel=arguments.christoffel, **motion))
    M = np.array(response.mass_matrix).reshape(n, n)
    C = np.array(response.coriolis_matrix).reshape(n, n)
    vectors = {name: list(getattr(response, name)) for name in VECTORS}
    inertia = {'N·m': 'kg·m²', 'N': 'kg'}.get(units.effort, 'kg·m², kg·m, kg')
    rate = {'N·m': 'N·m·s/rad', 'N': 'N·s/m'}.get(units.effort, 'N·m·s, N·s, N·s/m')
    blocks = [
        f'Mass matrix M(q) [{inertia}]\n{matrix_table("", names, M)}',
        f'Coriolis matrix C(q, v) [{rate}]\n{matrix_table("", names, C)}',
        f'Vectors [{units.effort}]\n' + units.table(
            names, dict(zip(VECTORS.values(), vectors.values())))]
    symbols = {}
    if arguments.christoffel:
        c = np.array(response.christoffel).reshape(n, n, n)
        symbols['christoffel'] = c.tolist()
        rows = [[names[i], names[j], names[k], float(c[i, j, k])]
                for i, j, k in np.argwhere(np.abs(c) > 1e-12)]
        blocks.append('Christoffel symbols c_ijk that are not 0\n' + text_table(
            ['i', 'j', 'k', 'c_ijk'], rows))
    return _answer(client, state, blocks, {
        'mass_matrix': M.tolist(), 'coriolis_matrix': C.tolist(), **vectors, **symbols},
        response, response.warnings)


def answer_check(client: DynamicsClient, arguments: Namespace) -> Answer:
    """Return what the model check finds in URDF, friction and motors of the node."""
    from robot_dynamics.model.arm_parameters import arm_from_parameters
    from robot_dynamics.model_check import report
    from robot_dynamics.model_check.finding import CHECKS, errors_of
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
    checked = report.check_description(xml, list(parameters['joints'] or []), arm)
    return Answer(
        {'node': client.name, **report.findings_as_data(checked, ignored)},
        report.findings_report(client.name, checked, ignored),
        1 if errors_of(checked.findings, ignored) else 0)


_State = tuple[list[str], dict[str, list[float]], Units]
"""The joints, their motion in the same order, and their units."""


def _state(client: DynamicsClient, arguments: Namespace, fields: Sequence[str]) -> _State:
    """Return the state in the arguments."""
    names = client.joint_names()
    motion = {'position': joint_values('position', arguments.position, names)}
    for field in fields[1:]:
        texts = getattr(arguments, field)
        motion[field] = joint_values(field, texts, names, 0.0) if texts else [0.0] * len(names)
    return names, motion, Units.of(names, {} if arguments.json else client.joint_kinds())


def _answer(
    client: DynamicsClient, state: _State, blocks: Sequence[str], data: Mapping[str, Any],
    energies: Any, warnings: Sequence[str],
) -> Answer:
    """Return the answer of a service at a state, with the energies in a message."""
    names, motion, units = state
    kinetic, potential = energies.kinetic_energy, energies.potential_energy
    of_time = {'position': '', 'velocity': '/s', 'acceleration': '/s²'}
    table = units.table(names, {
        f'{field} [{", ".join(unit + of_time[field] for unit in units.position.split(", "))}]':
            values for field, values in motion.items()})
    return Answer(
        {'node': client.name, 'joint_names': names, **motion, **data, 'kinetic_energy': kinetic,
         'potential_energy': potential, 'warnings': list(warnings)},
        '\n\n'.join([
            f'Motion\n{table}', *blocks, f'Kinetic energy {kinetic:.4f} J, potential energy '
            f'{potential:.4f} J', *warning_lines(warnings)]))
