# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A motion of an arm with its efforts by term, energies, work and heat.

The motion is simulated, or it is the measured motion of a recording, compared with its model.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from robot_dynamics.arrays import BoolArray, FloatArray
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, make_gains
from robot_dynamics.dependencies import optional
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory
from robot_dynamics.trajectories.quintics import quintic_point_to_point
from robot_dynamics_tools.excitation.demo_motion import make_reference_motion

CONTROL_PERIOD = 2e-3
"""[s]"""
DAMPING_TIME = 15.0
"""Time constant [s] of the friction that is added to an arm: F_v = largest M_ii / this value."""
LIFT_FRACTION = 0.35
"""Fraction of the duration of a swing in which the motors lift the arm."""
LEAN, FOLD = 1.4, 0.9
"""Pose [rad] to which the arm is lifted: joint 1 from the upright, and each further joint."""


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """
    m instants of n joints, in the order of `arm.joint_names`.

    `times` (m,) [s]; `position`, `velocity`, `acceleration` (m, n) [rad or m, per second];
    `terms` by name, each (m, n) [N·m or N], add up to the term `effort`; `kinetic`, `potential`,
    the `work` of the efforts and the `heat` of friction since the start are (m,) [J]. The
    potential energy is relative to its minimum in the motion. `driven` (m,) is false while the
    motors are off.
    """

    arm: ArmModel
    times: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    terms: Mapping[str, FloatArray]
    kinetic: FloatArray
    potential: FloatArray
    work: FloatArray
    heat: FloatArray
    driven: BoolArray

    @property
    def energy(self) -> FloatArray:
        """Kinetic and potential energy (m,) [J]."""
        return self.kinetic + self.potential

    def at(self, times: FloatArray) -> 'ArmMotion':
        """Return the instants next to these times [s]."""
        rows = np.abs(self.times[:, None] - times).argmin(axis=0)
        arrays = {name: values[rows] for name, values in vars(self).items()
                  if isinstance(values, np.ndarray)}
        terms = {name: values[rows] for name, values in self.terms.items()}
        return replace(self, **arrays, terms=terms)


def simulate_motion(
    arm: ArmModel, duration: float, rate: float,
    on_time: Callable[[float], object] = lambda _: None,
) -> ArmMotion:
    """
    Return a simulated motion for `duration` [s], with `rate` instants per second.

    An arm whose joints all turn freely is lifted from its lowest pose and then released, with its
    motors off. If it has no friction, viscous friction is added, because it would swing
    indefinitely. Any other arm follows a reference motion within its limits. `on_time` is called
    with the simulated time [s] at each instant. Raises RobotDynamicsError if neither is possible.
    """
    if any(kind != 'continuous' for kind in arm.joint_kinds):
        motion = make_reference_motion(arm, duration)
        return _simulate(arm, motion.trajectory, motion.start, duration, np.inf, rate, on_time)
    hanging = lowest_position(arm)
    if arm.friction.is_zero:
        inertia = np.diag(RigidBody(arm).mass_matrix(hanging))
        arm = arm.with_friction(make_friction(arm.joint_names, [inertia.max() / DAMPING_TIME]))
    lifted = hanging + FOLD
    lifted[0] = hanging[0] + np.copysign(np.pi, -hanging[0]) + LEAN
    lift = LIFT_FRACTION * duration
    path = quintic_point_to_point(arm.joint_names, hanging, lifted, lift)
    return _simulate(arm, path, hanging, duration, lift, rate, on_time)


def _simulate(
    arm: ArmModel, path: JointTrajectory, start: FloatArray, duration: float, driven: float,
    rate: float, on_time: Callable[[float], object],
) -> ArmMotion:
    """Follow a path under computed torque for `driven` [s]; then the motors are off."""
    simulation, dynamics = ArmSimulation(arm, start), ArmDynamics(arm)
    simulation.release()
    feedback = ErrorFeedback(make_gains(arm.joint_names), arm.joint_kinds)
    count = int(round(duration * rate)) + 1
    steps = max(1, int(np.ceil(1.0 / (rate * CONTROL_PERIOD))))
    period = 1.0 / (rate * steps)
    all_times = np.asarray(period * np.arange(count * steps), dtype=np.float64)
    reference = ActiveTrajectory(path, 0, 0, Reference(start, *np.zeros((2, len(start)))))
    q, v, tau = (np.zeros((count, arm.joint_count)) for _ in range(3))
    work, heat = np.zeros(count), np.zeros(count)
    for k, t in enumerate(all_times):
        now = simulation.state
        effort = np.zeros(arm.joint_count)
        if t < driven:
            effort = dynamics.inverse_dynamics(
                *now, feedback.track(reference, round(1e9 * t), *now).acceleration)
        if k % steps == 0:
            row = k // steps
            q[row], v[row] = now
            tau[row], work[row], heat[row] = effort, simulation.work, simulation.heat
            on_time(float(t))
        simulation.step(effort, period)
    a = np.array([dynamics.forward_dynamics(*state) for state in zip(q, v, tau)])
    times = all_times[::steps]
    return replace(motion_of(arm, times, q, v, a, None, times < driven), work=work, heat=heat)


def motion_of(
    arm: ArmModel, times: FloatArray, q: FloatArray, v: FloatArray, a: FloatArray,
    effort: FloatArray | None, driven: BoolArray,
) -> ArmMotion:
    """
    Return a motion with the efforts of the arm's model, and the measured effort (m, n) if given.

    The measured effort minus the model is the term `residual`. Work and heat are integrals by the
    trapezoidal rule.
    """
    dynamics, integrate = ArmDynamics(arm), optional('scipy.integrate', 'an animation')
    rows = [dynamics.terms(*state) for state in zip(q, v, a)]
    terms = {name: np.array([getattr(row, name) for row in rows])
             for name in ('inertial', 'coriolis', 'gravity', 'friction', 'effort')}
    if effort is not None:
        terms['residual'] = effort - terms['effort']
        terms['effort'] = effort
    potential = np.array([row.potential_energy for row in rows])
    work, heat = (
        integrate.cumulative_trapezoid((terms[name] * v).sum(axis=1), times, initial=0.0)
        for name in ('effort', 'friction'))
    return ArmMotion(
        arm, times, q, v, a, terms, np.array([row.kinetic_energy for row in rows]),
        potential - potential.min(), work, heat, driven)


def lowest_position(arm: ArmModel) -> FloatArray:
    """
    Return a position (n,) in [−π, π] where an arm whose joints all turn freely hangs at rest.

    Along each joint the potential energy is a + b cos q + c sin q, whose lowest point follows
    from its derivative g_j at two positions. Iteration over the joints leads to a pose in which no
    single joint can lower the energy. Joints without gravity torque stay at 0.
    """
    body, n = RigidBody(arm), arm.joint_count
    q = np.full(n, 0.1)
    for _ in range(200):
        before = q.copy()
        for j in range(n):
            at_zero, at_right_angle = q.copy(), q.copy()
            at_zero[j], at_right_angle[j] = 0.0, 0.5 * np.pi
            c, b = body.gravity(at_zero)[j], -body.gravity(at_right_angle)[j]
            q[j] = np.arctan2(-c, -b) if np.hypot(b, c) > 1e-9 else 0.0
        if np.abs(np.sin(0.5 * (q - before))).max() < 1e-12:
            break
    return q
