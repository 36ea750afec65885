# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Hand guiding: the arm weighs nothing, its joints turn easily, and neither too fast nor too far.

τ = g(q) + α τ_f + M(q) K_d (q̇_a − q̇) + f. q̇_a is the velocity q̇ within the bounds

    max(−q̇_max, −β (q − q_lower)) <= q̇_a <= min(q̇_max, β (q_upper − q)),  β = K_p/K_d

so that a joint which is too fast is braked, and comes to its position limit as slowly as the
feedback K_p e + K_d ė would bring it there; at rest beyond the limit the effort is that of a
spring, M K_p e, and a joint that returns receives no energy of it. K_p and K_d are those of
computed torque, scaled by rate and noise of the joint states.

Only a person starts or keeps a motion. With the power P_f of the known friction, of which the true
one is at least the share λ, and u = τ − g, a person supplies at least

    P = d(½ q̇ᵀ M' q̇)/dt + σ (λ P_f − uᵀ q̇),  M' = M + usual rotors

P fills a tank of STOPPING P_f / 20 to the share s. If it is not full, the speed x = √(q̇ᵀ M' q̇) is
at most w, which falls from its value at the last full tank to 0 in STOPPING. Of the excess

    δ = (1 − s) (1 − w/x),  >= 0,

the compensation loses its part, and the brake −min(K_d) δ M q̇ with negative power acts. Since
α <= λ, u gives less energy than friction takes: a released arm loses energy, and its tank empties.

Compensation of dry friction at the measured velocity is negative damping, and where friction
yields before it slides it feeds a vibration (`JointFriction.tracking_effort`). The direction z of
the compensation therefore follows the way of the joint: dz = dq / w − (v_d / w) z dt, within ±1,
with the width w of the compensation at rest. Slower than v_d it is less than full, and at rest it
fades, so that the whole dry friction holds the arm. In motion at least MASS_ERROR of gravity
remains of dry friction. If that is more than 1 − LEAST_SHARE, the compensation up to LEAST_SHARE
begins after a way of PLAY: before, a gearbox that yields under a released arm would start a motion
that the rest of friction does not stop.

Towards a position limit it is at most the share of v_d that is allowed: nothing moves a joint into
its limit. g and M are those of the position q + q̇ (T + LOOP_DELAY)/2 when the effort acts
on average (`gain_scaling`): late gravity is negative damping, and accelerates light wrists.
"""

import math
from typing import Any

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.gains.gain_scaling import LOOP_DELAY
from robot_dynamics.control.gate import LEFT
from robot_dynamics.control.laws.computed_torque import REVERSAL_TIME
from robot_dynamics.control.laws.control_law import (
    ControlLaw,
    LawInput,
    LawOutput,
    LawParameter,
    LawTopic,
)
from robot_dynamics.control.laws.error_feedback import ErrorFeedback
from robot_dynamics.control.laws.force_feedback import ForceFeedback
from robot_dynamics.control.options import LawOptions
from robot_dynamics.control.safety.faults import STATE_TIMEOUT
from robot_dynamics.joints.friction import JointFriction
from robot_dynamics.references.motion_limits import FRACTION
from robot_dynamics.validation import check_named, LARGEST_VALUE

LARGEST_SHARE, FRICTION_SHARE = 0.7, 0.6
"""λ, below 1 of friction that is given 1.4 times too large, and α."""
FEEDBACK_GAIN = 0.3
"""Share of the effort of a follower that a person feels."""
USUAL_SPEED, USUAL_TURN = 0.25, 1.0
"""Largest default speed limit of prismatic joints [m/s], the reduced speed of ISO 10218-1, and of
others [rad/s]."""
ROTOR = 200.0
"""Effort limit by the usual rotor [rad/s²] or [m/s²]: 145 at a Panda, 330 at a UR10."""
DEVIATIONS = 2.0
"""Standard deviations by which the force of a follower is reduced: they may be none."""
INERTIA = 0.6
"""σ: M' by the true one, at least. A hand that slows the arm feels at most M' q̈ (1/σ − 1)."""
STOPPING = 0.6
"""[s] in which a released arm stops; with the least true friction, its tank is empty after it."""
FULL_SPEED = 0.05
"""v_d [rad/s] or [m/s], above which the compensation is complete."""
MASS_ERROR, LEAST_SHARE = 0.07, LARGEST_SHARE * FRICTION_SHARE
"""Of gravity, in an unknown mass; and of known friction, from which α of the least true one."""
PLAY, FAR = LEFT, LEFT + 0.01
"""Ways [rad] or [m] after which the compensation up to LEAST_SHARE begins and is complete."""
FORGETTING = 1.0
"""Time constant [s] of the way."""
DAMPING = 1.0
"""[1/s] of joints without known dry friction: they come to rest too."""
WALL_PUSH, LARGEST_WALL = 10.0, 0.1
"""A push at this acceleration of the joint [rad/s²] is held within a position limit, if the effort
begins less than this distance [rad] before it."""
LEAST_FREE = 0.1
"""Share of the effort limit with which a joint is braked although gravity needs its limit."""
LONGEST_STEP = 0.1
"""[s] between two states after which the motion between them is unknown."""


class HandGuiding(ControlLaw):
    """The law τ = g + α τ_f + M K_d (q̇_a − q̇) + f, without a reference."""

    follows = False
    PARAMETERS = (
        LawParameter('hand_guiding.speed', (), (
            'Speed [rad/s] or [m/s] above which hand_guiding brakes a joint; one value for all '
            'joints or one per joint. If empty, half of the velocity limit, at most 1 rad/s or '
            '0.25 m/s.'), maximum=1e8),
    )

    def __init__(self, feedback: ErrorFeedback, options: LawOptions) -> None:
        speed, = options.parameters.values()
        arm, limits = options.arm, options.arm.limits
        self._names, self._gains = arm.joint_names, feedback.gains
        self.friction_share = FRICTION_SHARE
        """α, at most λ."""
        largest = [USUAL_SPEED if kind == 'prismatic' else USUAL_TURN for kind in arm.joint_kinds]
        self._speed = np.minimum(FRACTION * limits.velocity, largest) if speed is None else speed
        self._lower, self._upper = np.clip(
            (limits.lower, limits.upper), -LARGEST_VALUE, LARGEST_VALUE)
        is_limited = np.isfinite(limits.effort)
        self._rotors = np.where(
            is_limited & (arm.reflected_inertia == 0.0), limits.effort / ROTOR, 0.0)
        self._feedback = ForceFeedback(FEEDBACK_GAIN, limits.effort)
        self._last: tuple[int, FloatArray] | None = None
        self._zero = np.zeros(arm.joint_count)
        self._reversible = 0.5 * REVERSAL_TIME * np.asarray(options.effort_rate)
        self._z = self._way = self._added = self._zero
        self._external = self._deviation = self._zero
        self._energy = self._tank = self._allowed_speed = self._slowing = 0.0
        self._felt_until_ns = 0

    def feel(self, external: FloatArray) -> None:
        """Let a person feel this effort (n,) of a follower for STATE_TIMEOUT seconds."""
        if self._last is not None:
            self._external = external
            self._felt_until_ns = self._last[0] + round(1e9 * STATE_TIMEOUT)

    def take_force(self, message: Any) -> None:
        """Let a person feel the effort of a message JointState; raise InvalidInputError."""
        effort = self._efforts(message)
        least = DEVIATIONS * self._deviation
        self.feel(np.sign(effort) * np.maximum(np.abs(effort) - least, 0.0))

    def take_deviation(self, message: Any) -> None:
        """Reduce the next forces by those of a message JointState; raise InvalidInputError."""
        self._deviation = np.abs(self._efforts(message))

    def _efforts(self, message: Any) -> FloatArray:
        return check_named('effort', message.effort, message.name, self._names)

    TOPICS = (
        LawTopic('~/force_feedback', 'sensor_msgs/msg/JointState', take_force),
        LawTopic('~/force_feedback_deviation', 'sensor_msgs/msg/JointState', take_deviation))

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort; at a first state, g(q)."""
        moved, dt = self._moved(state)
        dynamics, friction, remaining = state.dynamics, self._zero, self._zero
        if dt == 0.0:
            gravity = state.gravity
            return LawOutput(gravity, friction, gravity=gravity)
        mean = moved / dt  # a wrong sign of v would drive the joint
        v = np.clip(state.v, np.minimum(mean, 0.0), np.maximum(mean, 0.0))
        state = state._replace(q=state.q + 0.5 * (dt + LOOP_DELAY) * v)
        gravity, allowed = state.gravity, self._allowed(state.q)
        if not dynamics.is_frictionless:
            friction, remaining = self._friction(
                dynamics.friction, v, gravity, moved, dt, *allowed)
        M = dynamics.rigid_body.mass_matrix(state.q)
        energy = 0.5 * float(v @ M @ v + self._rotors @ v**2)
        excess = self._excess(v, energy, dynamics.friction, dt)
        friction = (1.0 - excess) * friction
        damping = excess * np.min(self.scale * self._gains.kd)
        brake = M @ (self._braking(dynamics.friction, v, *allowed) - damping * v)
        effort = gravity + friction
        if brake.any():
            effort = effort + brake * self._share(brake, effort, dynamics.arm.limits.effort)
        if state.stamp_ns > self._felt_until_ns:
            self._feedback.restart()
        else:
            effort = effort + self._feedback.effort(
                self._external, moved, state.v, dt, remaining)
        self._added = effort - gravity
        return LawOutput(effort, friction, gravity=gravity)

    def _moved(self, state: LawInput) -> tuple[FloatArray, float]:
        """Return how far the joints have moved since the last state (n,), and in which time."""
        last, self._last = self._last, (state.stamp_ns, state.q)
        dt = 0.0 if last is None else 1e-9 * (state.stamp_ns - last[0])
        if last is None or not 0.0 < dt <= LONGEST_STEP:
            self._z = self._way = self._added = self._zero
            self._energy = self._tank = 0.0
            self._feedback.restart()
            return self._zero, 0.0
        return state.feedback.position_error(state.q, last[1]), dt

    def _friction(
        self, friction: JointFriction, v: FloatArray, gravity: FloatArray, moved: FloatArray,
        dt: float, least: FloatArray, most: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the compensation of friction (n,), and the dry friction that remains (n,)."""
        alpha, w = self.friction_share, friction.tracking_width
        low = np.clip(least / FULL_SPEED, -1.0, 0.0)
        high = np.clip(most / FULL_SPEED, 0.0, 1.0)
        self._z = np.clip(
            self._z + moved / w - np.minimum(FULL_SPEED * dt / w, 1.0) * self._z, low, high)
        self._way = np.clip((1.0 - dt / FORGETTING) * self._way + moved, -FAR, FAR)
        beyond = (self._way - np.clip(self._way, -PLAY, PLAY)) / (FAR - PLAY)
        dry = np.maximum(friction.at_rest.static, 1e-9)
        spare = np.clip(1.0 - MASS_ERROR * np.abs(gravity) / dry, 0.0, alpha)
        more = np.clip(LEAST_SHARE - spare, 0.0, alpha - spare)
        direction = (spare * self._z + more * np.clip(beyond, low, high)) / alpha
        compensation = alpha * friction.directed_effort(v, direction, direction, gravity)
        return compensation, (1.0 - spare - more) * dry

    def _excess(
        self, v: FloatArray, energy: float, friction: JointFriction, dt: float,
    ) -> float:
        """Return δ, by how much an arm exceeds the speed for which a person supplies energy."""
        speed = np.abs(v)
        known = float((friction.at_rest.static + friction.viscous * speed) @ speed)
        last, self._energy = self._energy, energy
        if not known:
            return 0.0
        supplied = energy - last + INERTIA * dt * (
            LARGEST_SHARE * known - float(self._added @ v))
        self._tank = min(max(self._tank + supplied / (0.05 * STOPPING * known), 0.0), 1.0)
        x = math.sqrt(2.0 * energy)
        if self._tank == 1.0:
            self._allowed_speed, self._slowing = x, x / STOPPING
        self._allowed_speed = max(self._allowed_speed - self._slowing * dt, 0.0)
        return (1.0 - self._tank) * max(1.0 - self._allowed_speed / x, 0.0)

    def _braking(
        self, friction: JointFriction, v: FloatArray, least: FloatArray, most: FloatArray,
    ) -> FloatArray:
        """Return the acceleration (n,) of joints that are too fast, or have no friction."""
        allowed = np.minimum(np.maximum(v, least), most)
        damping = np.where(friction.at_rest.static > 0.0, 0.0, DAMPING)
        return np.asarray(self.scale * self._gains.kd * (allowed - v) - damping * v)

    def _share(self, brake: FloatArray, effort: FloatArray, limit: FloatArray) -> float:
        """
        Return the share of the effort `brake` (n,) that limits and rates permit at all joints.

        A part of it at each joint would accelerate others. As in `computed_torque`, the rate
        limit can reverse the effort in REVERSAL_TIME. LEAST_FREE is used beyond a limit.
        """
        free = np.maximum(limit - np.where(brake > 0.0, effort, -effort), LEAST_FREE * limit)
        with np.errstate(divide='ignore', invalid='ignore'):
            return float(np.min(
                np.minimum(free, self._reversible) / np.abs(brake), initial=1.0))

    def _allowed(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least and the largest allowed velocity (n,) at q."""
        s = self.scale
        with np.errstate(divide='ignore'):
            wall = np.minimum(WALL_PUSH / (s * s * self._gains.kp), LARGEST_WALL)
        beta = s * self._gains.ratio
        return np.maximum(-self._speed, beta * (self._lower + wall - q)), np.minimum(
            self._speed, beta * (self._upper - wall - q))
