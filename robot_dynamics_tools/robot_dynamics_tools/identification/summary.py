# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The results of an identification as rows of text, for the console and for the report.

They include the bounds of friction and rotors that act: parameters that the data place beyond a
bound.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from robot_dynamics.joints.friction import FRICTION_FIELDS, JointFriction
from robot_dynamics.joints.parameter_field import ParameterField
from robot_dynamics_tools.identification import drive_gains, friction_regressor
from robot_dynamics_tools.identification.bag_identification import BagIdentification
from robot_dynamics_tools.identification.identified_arm import fitted_friction, fitted_offset
from robot_dynamics_tools.identification.model_selection import REGULARIZATIONS
from robot_dynamics_tools.identification.pipeline import Identification, Observability
from robot_dynamics_tools.identification.recording_agreement import factor_of
from robot_dynamics_tools.reporting.text_table import cells, column_rows, percent, Rows

MODELS = {
    'urdf': 'URDF', 'urdf and friction': 'URDF + friction', 'base': 'base parameters',
    'consistent': 'consistent'}
"""The models that are compared, with their titles."""
FRICTION_TITLE = 'Friction and rotors [N·m, rad, kg·m², or N, m, kg]'
GAIN_TITLE = 'Drive gains [effort at the joint / recorded effort]'
ILL_CONDITIONED = 100.0
"""Condition number above which base parameters are uncertain (a usual bound of excitation)."""
LOST = 1.2
"""Ratio of the residuals of the consistent set and of the base parameters that is a warning."""
_MOST_NAMES = 12
LEAST_NOISE = 1e-4
"""Noise of the effort, by its RMS, below which it was removed before the effort was recorded."""
LEAST_DIFFERENCE = 1e-6
"""Smallest difference from the estimate without bounds, relative to the largest value."""
_UNITS = (
    'kg·m² or kg', *(' or '.join(column.parameter.units)
                     for column in friction_regressor.FRICTION_COLUMNS))


class ActiveBound(NamedTuple):
    """A parameter at its bound, and its estimate without any bounds."""

    parameter: str
    unit: str
    value: float
    unbounded: float


def fact_rows(found: BagIdentification) -> Rows:
    """Return the facts of an identification, with a name and a value in each row."""
    identification = found.identification
    motions = [recording.motion for recording in identification.recordings]
    test = identification.tests['consistent']
    cutoffs = sorted({f'{each.cutoff_hz:.3g}' for each in motions}, key=float)
    return [
        ('arm', f'{identification.arm.name}, {identification.arm.joint_count} joints'),
        ('recordings', ', '.join(bag.name for bag in found.bags[:_MOST_NAMES]) + (
            f' and {len(found.bags) - _MOST_NAMES} more' if len(found.bags) > _MOST_NAMES
            else '')),
        ('samples', f'{test.samples[0]} for training, '
                    + ('none for the test' if identification.is_cross_validated else
                       f'the following {test.samples[1]} for the test')
                    + f', at {motions[0].sample_rate_hz:.4g} Hz'),
        ('filter', f'Butterworth, order 4, forward and backward, {" … ".join(cutoffs)} Hz'
                   + (f': {motions[0].cutoff_reason}' if len(cutoffs) == 1 else '')),
        ('base parameters', f'{identification.base.rank} of '
                            f'{identification.base.matrix.shape[1]} parameters (rank)'),
        ('condition number', f'{identification.estimate.condition:.3g} of their columns'),
        ('regularisation towards the URDF',
         f'κ = {identification.models.problem.regularization:g}, chosen by cross-validation'),
        ('bodies by those of the URDF', _bodies(identification)),
    ]


def _bodies(identification: Identification) -> str:
    difference = identification.difference
    names = list(identification.arm.pinocchio_model.names)[1:]
    most = int(np.argmax(difference))
    return (f'a factor of {factor_of(difference):.3g}, the body of {names[most]} '
            f'{factor_of(difference[[most]]):.3g}')


def noise_rows(found: BagIdentification) -> Rows:
    """Return the residual of each recording by the noise of its effort."""
    rows: Rows = [('recording', *found.identification.arm.joint_names)]
    for bag, recording in zip(found.bags, found.identification.recordings):
        test = recording.tests['consistent']
        residual = test.relative() if test.samples[1] else test.relative('train')
        noise = recording.motion.effort_noise
        rows.append((bag.name, *(
            f'{r / s:.2g}' if s > LEAST_NOISE and np.isfinite(r) else '-'
            for r, s in zip(residual, noise))))
    return rows


def residual_title(identification: Identification) -> str:
    """Return what the residuals of `residual_rows` are computed on."""
    return ('Residual on the cross-validation folds' if identification.is_cross_validated
            else 'Residual on samples that were not used for training')


def residual_rows(identification: Identification) -> Rows:
    """Return the residual of the models on samples that were not used for training."""
    tests = identification.tests
    return column_rows(
        'joint', identification.arm.joint_names,
        *((title, map(percent, tests[model].relative())) for model, title in MODELS.items()),
        ('sample by sample', map(percent, tests['consistent'].relative('test_by_sample'))))


def friction_rows(identification: Identification) -> Rows:
    """Return friction, offset of the effort and rotor of each joint."""
    arm, fit = identification.arm, identification.models.consistent
    friction = fitted_friction(arm, fit)
    return column_rows(
        'joint', arm.joint_names,
        *((field.heading, [_friction_cell(field, friction, j) for j in range(arm.joint_count)])
          for field in FRICTION_FIELDS if field.heading),
        ('offset', cells(fitted_offset(fit), '.4g')),
        ('reflected inertia', cells(fit.joint_values[:, friction_regressor.INERTIA], '.4g')))


def _friction_cell(field: ParameterField, friction: JointFriction, joint: int) -> str:
    if field.needs and not any(getattr(friction, name)[joint] for name in field.needs):
        return '-'
    value = float(getattr(friction, field.name)[joint])
    return f'{value:.4g}' if field.unit else percent(value)


def gain_rows(identification: Identification, gains: drive_gains.GainEstimate) -> Rows:
    """Return the drive gains."""
    def note(j: int) -> str:
        if not gains.is_known[j]:
            return ('sign by friction, no size: -1 is used' if gains.is_reversed[j]
                    else 'not identifiable: 1 is used')
        return '; '.join(text for text, is_so in (
            ('the effort has the opposite sign', gains.is_reversed[j]),
            ('confounded with the masses of the URDF', gains.is_confounded[j])) if is_so)

    return column_rows(
        'joint', identification.arm.joint_names,
        ('gain K', cells(gains.gain, '.4g')), ('deviation', cells(gains.deviation, '.2g')),
        ('by noise only', cells(gains.noise, '.2g')), ('', map(note, range(len(gains.gain)))))


def warnings(identification: Identification) -> list[str]:
    """Return the warnings to consider before the model is used."""
    return [*_of_friction(identification), *_of_bounds(identification),
            *_of_excitation(identification), *_of_models(identification),
            *_of_effort(identification)]


def observable_lines(found: Observability) -> list[str]:
    """Return what recordings determine and what they do not, in sentences."""
    estimate = found.estimate
    total, known = len(estimate.names), int(estimate.excited.sum())
    return [f'{known} of {total} parameters are excited, of them '
            f'{int(estimate.excited[:estimate.base_count].sum())} of {estimate.base_count} base '
            f'parameters; condition number {estimate.condition:.3g}',
            *_of_friction(found), *_of_excitation(found), *([] if found.gains is None else [
                f'{name}: the drive gain is {"" if is_known else "not "}identifiable'
                for name, is_known in zip(found.arm.joint_names, found.gains.is_known)])]


def not_separable(identification: Observability) -> dict[str, tuple[str, ...]]:
    """Return the friction parameters that were left out, by joint, for joints with effort."""
    information = identification.information
    return {
        name: information.excitation.left_out(j)
        for j, name in enumerate(identification.arm.joint_names)
        if information.is_measured[j] and information.excitation.left_out(j)}


def _of_friction(identification: Observability) -> Iterator[str]:
    names = identification.arm.joint_names
    excitation = identification.information.excitation
    structures = identification.models.problem.structures
    for name in not_separable(identification):
        j = names.index(name)
        used = [word for word, columns in (
            ('viscous friction', friction_regressor.VISCOUS),
            ('dry friction', friction_regressor.DRY), ('an offset', friction_regressor.OFFSET))
            if structures[j].has(columns)]
        yield (f'{name}: {excitation.reason(j)}: viscous friction, dry friction and offset are '
               f'not separable; the model has only {" and ".join(used) or "none of them"}')


def bounds_by_joint(identification: Identification) -> dict[int, list[ActiveBound]]:
    """Return the bounds that keep a parameter at 0, or make it smaller, by number of the joint."""
    bounded, unbounded = (identification.models.by_name[name] for name in ('base', 'unbounded'))
    by_joint: dict[int, list[ActiveBound]] = {}
    for j, structure in enumerate(bounded.structures):
        for column in structure.columns:
            value = float(bounded.joint_values[j, column])
            other = float(unbounded.joint_values[j, column])
            least = LEAST_DIFFERENCE * max(abs(value), abs(other))
            if column not in friction_regressor.OFFSET and other < -least and (
                    abs(value) <= -1e-3 * other):
                by_joint.setdefault(j, []).append(ActiveBound(
                    friction_regressor.COLUMN_NAMES[column], _UNITS[column], value, other))
    return by_joint


def _of_bounds(identification: Identification) -> Iterator[str]:
    tests = identification.tests
    base, unbounded = tests['base'].relative(), tests['unbounded'].relative()
    for j, bounds in bounds_by_joint(identification).items():
        listed = ', '.join(
            f'{bound.parameter} {bound.value:.3g} instead of {bound.unbounded:.3g} {bound.unit}'
            for bound in bounds)
        text, without = percent(base[j]), percent(unbounded[j])
        yield f'{identification.arm.joint_names[j]}: bounds act: {listed}' + (
            '' if text == without else '; without bounds, the residual of the base parameters is '
            f'{without} instead of {text}')


def _of_excitation(identification: Observability) -> Iterator[str]:
    estimate = identification.estimate
    if estimate.condition > ILL_CONDITIONED:
        yield (f'the condition number of the base parameters is {estimate.condition:.3g}, above '
               f'{ILL_CONDITIONED:g}: some parameters are poorly excited; record a trajectory '
               'generated with `excite`')
    if estimate.unexcited:
        names = ', '.join(estimate.unexcited)
        base = int(np.sum(estimate.excited[:estimate.base_count] == 0))
        yield (f'{base} of {estimate.base_count} base parameters and '
               f'{len(estimate.unexcited) - base} of {len(estimate.names) - estimate.base_count} '
               f'joint parameters are not excited and stay near the URDF, or 0: {names}')
    if identification.models.problem.regularization == REGULARIZATIONS[-1]:
        yield ('in the cross-validation, no masses predict the recording better than those of '
               'the URDF: only friction was identified')


def _of_models(identification: Identification) -> Iterator[str]:
    tests, names = identification.tests, identification.arm.joint_names
    if identification.is_cross_validated:
        yield ('all samples were used for training: the residuals are those of the '
               'cross-validation folds, which also selected the model, and are slightly too small')
    base, consistent = tests['base'].relative(), tests['consistent'].relative()
    simple, urdf = tests['urdf and friction'].relative(), tests['urdf'].relative()
    for j, name in enumerate(names):
        if consistent[j] > LOST * base[j]:
            yield (f'{name}: the residual of the consistent set, {percent(consistent[j])}, is '
                   f'above {LOST:g} times that of the base parameters, {percent(base[j])}')
        if consistent[j] > 1.05 * min(simple[j], urdf[j]):
            yield (f'{name}: the URDF'
                   f'{" with friction" if simple[j] <= urdf[j] else ""} predicts the test '
                   f'samples better, {percent(min(simple[j], urdf[j]))} against '
                   f'{percent(consistent[j])}')
        if np.isnan(base[j]):
            yield f'{name}: no effort was recorded: no parameter of this joint was identified'
        if consistent[j] > 0.5:
            yield f'{name}: the model does not explain half of the effort or more'


def _of_effort(identification: Identification) -> Iterator[str]:
    names, gains = identification.arm.joint_names, identification.gains
    if gains is not None:
        if gains.differ:
            yield ('the gains of most joints differ: efforts are interpreted as currents, with '
                   'the masses of the URDF as reference; use --effort torque to disable this')
        confounded = [name for name, is_confounded in zip(
            names, gains.is_confounded & gains.is_known) if is_confounded]
        if confounded:
            yield (f'drive gains of {", ".join(confounded)} are confounded with the masses of the '
                   f'URDF, of which an error of {100.0 * drive_gains.MASS_ERROR:g} % is assumed: '
                   'to determine them, record the arm with and without a weighed load, and give '
                   'the load with --payload RECORDING:LINK=KG,X,Y,Z')
        unknown = [name for name, known in zip(names, gains.is_known) if not known]
        if unknown:
            yield (f'drive gain not identifiable for {", ".join(unknown)}: gravity load too small '
                   'relative to friction or to the errors of the masses; their effort '
                   'stays in the unit of the recording')
        return
    if identification.seeming_gains.is_off.any():
        yield drive_gains.other_unit(names, identification.seeming_gains)


def recording_lines(found: BagIdentification, kind: str) -> list[str]:
    """Return the 'remarks' or likely 'contradictions' of the recordings, with their names."""
    return [f'{bag.name}: {line}'
            for bag, recording in zip(found.bags, found.identification.recordings)
            for line in getattr(recording, kind)]
