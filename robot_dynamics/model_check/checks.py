# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of the validity of a model: findings about a URDF and the arm that is created from it.

A finding is an error if the equation of motion has no unique or no physically consistent solution;
the model is then rejected by default. Any finding that leaves M(q) positive definite is a warning.
The checks and their levels are described in docs/model_check.md.
"""

from collections.abc import Iterator

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import arm_from_urdf, ArmModel
from robot_dynamics.model.worst_gravity import Search, THOROUGH, worst_gravity
from robot_dynamics.model_check import body_checks
from robot_dynamics.model_check.density_check import check_densities
from robot_dynamics.model_check.finding import ERROR, errors_of, Finding, WARNING
from robot_dynamics.model_check.mass_matrix_check import InertiaMatrix, survey_inertia
from robot_dynamics.model_check.rotor_check import check_rotors
from robot_dynamics.urdf.inertials import LinkBody, MeshBounds, read_bodies, read_joint_origins
from robot_dynamics.urdf.parser import (
    links_from,
    parse_urdf,
    resolve_mimic,
    safety_controllers,
    UrdfRobot,
)

LARGEST_CONDITION = 1e6
"""Condition number of M(q) above which accelerations lose half the digits of their efforts."""
LARGEST_SURVEY = 256
"""Largest number of positions at which M(q) is evaluated."""
LEAST_MASS_PER_LENGTH = 0.3
"""[kg/m] of all links that move: hobby arms of printed links have 1 kg/m and more."""


def check_model(
    urdf: str, arm: ArmModel | None = None, *, search: Search = THOROUGH,
    meshes: MeshBounds | None = None,
) -> list[Finding]:
    """
    Return the findings about the model in a URDF, errors first.

    `arm` is the arm that was created from the URDF, with its joints, gravity and motors; by
    default, it is loaded from the URDF. Without `meshes`, a mesh counts as geometry that cannot be
    read. A negative mass is reported although no arm can be created with it; the checks of the arm
    are then omitted. Raises ModelError if the URDF cannot be used at all.
    """
    bodies = read_bodies(urdf, meshes)
    negative = errors_of(body_checks.check_masses(bodies))
    if negative:
        return negative
    robot = parse_urdf(urdf)
    arm = arm_from_urdf(urdf) if arm is None else arm
    moved = _moved_bodies(robot, arm, bodies)
    M = survey_inertia(arm, min(search.samples, LARGEST_SURVEY))
    of_bodies = _check_bodies(urdf, arm, moved)
    findings = [
        *of_bodies,
        *_check_inertia_matrix(arm, robot, moved, M, bool(errors_of(of_bodies))),
        *_check_limits(arm), *_check_closed(arm, robot), *_check_safety_controllers(urdf, arm),
        *_check_friction(arm),
        *check_rotors(arm, M.diagonal),
        *_check_gravity(arm, search)]
    return sorted(findings, key=lambda finding: finding.level != ERROR)


def mesh_findings(urdf: str, meshes: MeshBounds) -> list[Finding]:
    """Return the findings that only the meshes of a URDF show; raise ModelError."""
    robot, arm = parse_urdf(urdf), arm_from_urdf(urdf)
    without, found = (
        _check_bodies(urdf, arm, _moved_bodies(robot, arm, read_bodies(urdf, of)))
        for of in (None, meshes))
    return [finding for finding in found if finding not in without]


# ---------------------------------------------------------------------------------------- bodies

def _check_bodies(urdf: str, arm: ArmModel, moved: list[LinkBody]) -> list[Finding]:
    return [
        *body_checks.check_masses(moved), *_check_whole_mass(arm, moved),
        *body_checks.check_inertias(moved),
        *body_checks.check_extents(moved, read_joint_origins(urdf)), *check_densities(moved),
        *body_checks.check_lost_masses(moved)]


def _moved_bodies(robot: UrdfRobot, arm: ArmModel, bodies: list[LinkBody]) -> list[LinkBody]:
    """Return the links that a joint of the arm moves; the mass of other links has no effect."""
    names = {
        name for joint in robot.joints
        if joint.moves and resolve_mimic(joint, robot.joints).leader not in arm.locked_joints
        for name in links_from(robot.joints, [joint.child])}
    return [body for body in bodies if body.name in names]


def _check_whole_mass(arm: ArmModel, moved: list[LinkBody]) -> Iterator[Finding]:
    """Yield an arm that is lighter than any, by its length."""
    model = arm.unloaded_model
    length = sum(float(np.linalg.norm(place.translation)) for place in model.jointPlacements[2:])
    mass = sum(body.mass or 0.0 for body in moved)
    if mass < LEAST_MASS_PER_LENGTH * length:
        yield Finding(
            'mass', WARNING, '',
            f'the links that move have {mass:.3g} kg, and their joints are {length:.3g} m apart, '
            f'expected at least {LEAST_MASS_PER_LENGTH:g} kg per metre: the masses may be those '
            'of an exporter without materials')


# ----------------------------------------------------------------------------------------- joints

def _check_inertia_matrix(
    arm: ArmModel, robot: UrdfRobot, moved: list[LinkBody], M: InertiaMatrix, explained: bool,
) -> Iterator[Finding]:
    """Yield the joints that move no mass, and the findings about M(q) of the others."""
    masses = {body.name: body.mass or 0.0 for body in moved}
    for name in np.array(arm.joint_names)[M.idle].tolist():
        carried = links_from(robot.joints, [robot.joint(name).child])
        mass = sum(masses.get(link, 0.0) for link in carried)
        yield Finding(
            'mass' if mass < body_checks.TINY_MASS else 'inertia', ERROR, name,
            f'joint {name!r} moves {mass:g} kg and no moment of inertia about its axis, so that '
            'M(q) is singular, expected a link with mass and inertia behind it')
    if not M.is_definite and not explained:
        yield Finding(
            'condition', ERROR, '',
            f'M(q) is {"singular" if M.smallest >= 0.0 else "not positive definite"} at position '
            f'{_rounded(M.singular_at)}: its smallest eigenvalue, in units of its diagonal, is '
            f'{M.smallest:.3g}, expected a positive one')
    if M.is_definite and M.condition > LARGEST_CONDITION:
        yield Finding(
            'condition', WARNING, '',
            f'condition number of M(q) is {M.condition:.3g} at position {_rounded(M.worst_at)}, '
            f'expected at most {LARGEST_CONDITION:g}')


def _check_limits(arm: ArmModel) -> Iterator[Finding]:
    """Yield the joints without a limit; a missing limit, or 0, means "not known" in a URDF."""
    limits = arm.limits
    for i, name in enumerate(arm.joint_names):
        missing = [
            words for words, limit in (('velocity', limits.velocity), ('effort', limits.effort))
            if np.isinf(limit[i])]
        lower, upper = limits.lower[i], limits.upper[i]
        if arm.joint_kinds[i] != 'continuous' and (np.isinf(lower) or np.isinf(upper)):
            missing.insert(0, 'position')
        if missing:
            yield Finding(
                'limits', WARNING, name,
                f'joint {name!r} has no {" and no ".join(missing)} limit (none, or 0), expected '
                'one: without it, the value is not bounded')
        if lower == upper:
            yield Finding(
                'limits', WARNING, name,
                f'joint {name!r} has the position limits [{lower:g}, {upper:g}], expected lower '
                'below upper')


def _check_closed(arm: ArmModel, robot: UrdfRobot) -> Iterator[Finding]:
    """Yield the joints that count as fixed because their limits are both 0."""
    for name in arm.locked_joints:
        joint = robot.joint(name)
        if joint.lower == joint.upper == 0.0:
            yield Finding(
                'limits', WARNING, name,
                f'joint {name!r} has the position limits [0, 0] and counts as fixed, expected '
                'lower below upper if it moves')


def _check_safety_controllers(urdf: str, arm: ArmModel) -> Iterator[Finding]:
    """
    Yield the joints whose `<safety_controller>` lets no effort through that holds the arm.

    ros2_control clips the effort at rest to k_velocity times the velocity limit.
    """
    for name, k in safety_controllers(urdf).items():
        if name not in arm.joint_names:
            continue
        j = arm.joint_names.index(name)
        effort, passes = arm.limits.effort[j], k * arm.limits.velocity[j]
        if passes < effort:
            yield Finding(
                'limits', WARNING, name,
                f'<safety_controller> of joint {name!r} has k_velocity {k:g}: with ros2_control '
                f'at most {passes:.4g} of the effort limit {effort:.4g} passes at rest, expected '
                'a k_velocity of at least the effort limit by the velocity limit, or none')


def _check_friction(arm: ArmModel) -> list[Finding]:
    """Return the joints that no effort within the limit moves against friction."""
    dry, limit = arm.friction.counterpart('friction'), arm.limits.effort
    return [
        Finding(
            'friction', ERROR, name,
            f'dry friction F_c + F_a of joint {name!r} is {effort:.4g}, expected less than its '
            f'effort limit, {most:.4g}: no permitted effort would move the joint')
        for name, effort, most in zip(arm.joint_names, dry, limit) if effort > most]


def _check_gravity(arm: ArmModel, search: Search) -> list[Finding]:
    limit = arm.limits.effort
    if not np.isfinite(limit).any() or not np.any(arm.pinocchio_model.gravity.linear):
        return []
    worst = worst_gravity(arm, search)
    return [
        Finding(
            'gravity_capability', WARNING, name,
            f'effort limit of joint {name!r} is {limit[i]:.4g}, but holding the arm takes '
            f'{worst.effort[i]:.4g}, {worst.effort[i] / limit[i]:.3g} times that, at position '
            f'{_rounded(worst.position[i])}, expected a limit that holds it everywhere')
        for i, name in enumerate(arm.joint_names) if worst.effort[i] > limit[i]]


def _rounded(q: FloatArray) -> list[float]:
    return [round(float(value), 3) + 0.0 for value in q]
