# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Friction that yields before it slides: the arm comes to rest, and the command does not vibrate.

The plant is `BristledArm`. `ArmSimulation` with the same presliding distance is compared with it.
A UR10 with flexible gearboxes comes to rest as well. Its plant has a rotor and a link per joint,
with a spring of little damping between them (M. W. Spong, "Modeling and Control of Elastic Joint
Robots", ASME J. Dynamic Systems, Measurement, and Control 109(4), 1987). The loop knows the
rotors, and measures on their side.
"""

from typing import Any, NamedTuple

from bristled_arm import BristledArm, Case, COULOMB
from lock_step_loop import directions, LockStep, smooth_arm, STEP
import numpy as np
import pytest
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.joints.friction import make_friction

WAY = 0.35
"""[rad] of the motion."""
FASTEST = 500.0
"""[rad/s²]: effort limit / largest random rotor."""


class End(NamedTuple):
    """
    The last second: largest speed, change of effort by F_c, error [rad] or [m].

    `farthest` is the largest distance from the reference in the whole motion [rad] or [m].
    """

    speed: float
    change: float
    error: float
    farthest: float


def end_of_motion(case: Case, seconds: float = 3.2) -> End:
    one, distances = BristledArm(smooth_arm(case.arm), case), [0.0]

    def sensor(q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        if one.loop.reference is not None:
            distances.append(float(np.abs(q - one.loop.reference.position).max()))
        return q, v

    one.sensor = sensor
    goal = move(one)
    speed, change = calm(one, seconds - 0.2)
    assert one.loop.supervisor.fault_count == 0
    assert str(one.loop.controller.laws.oscillation) == ''
    return End(speed, change, float(np.abs(one.q - goal).max()), max(distances))


def move(one: BristledArm) -> FloatArray:
    """Let an arm that was held for a while begin a motion; return its goal."""
    one.run(0.2)
    goal = one.q + WAY * directions(len(one.q))
    one.follow(goal)
    return goal


def calm(one: BristledArm, seconds: float) -> tuple[float, float]:
    """Continue, and return the largest speed and change of effort by F_c of the last second."""
    last = one.run(seconds).last(1.0)
    change = np.nanmax(last.effort, axis=0) - np.nanmin(last.effort, axis=0)
    return float(last.speed.max()), float((change / one.coulomb).max())


@pytest.mark.parametrize('case', [
    Case('z1', 125, 0, 4e-3), Case('default', 100, 8, 5e-3, 1.4),
    pytest.param(Case('panda', 125, 8, 1e-3), marks=pytest.mark.soak),
    pytest.param(Case('ur10', 125, 8, 4e-3, has_rotors=True), marks=pytest.mark.soak)],
    ids=lambda case: f'{case.arm} {case.rate} Hz')
def test_a_joint_that_yields_before_it_slides_comes_to_rest(case, seen):
    end = end_of_motion(case)
    seen(f'{end.speed:.2g} rad/s, {end.change:.2g} F_c, error {end.error:.4f} rad')
    assert end.speed < 1e-3
    assert end.change < 0.05
    assert end.error < (0.008 if case.given == 1.0 and not case.has_rotors else 0.03)


@pytest.mark.soak
@pytest.mark.parametrize('seed', range(40))
def test_random_gearboxes_come_to_rest(seed, seen):
    """
    Rotors are unknown, friction is given 0.6 to 1.4 times, delays are up to two periods.

    Joints whose rotors are not known can run away or lag in the motion: a fault then stops them.
    """
    rng = np.random.default_rng(seed)
    name = str(rng.choice([
        'default', 'ur3', 'ur5', 'ur10', 'panda', 'xarm7', 'kinova', 'z1', 'talos_left_arm']))
    arm, rate = smooth_arm(name), int(rng.choice([100, 125, 250, 500, 1000]))
    limit = np.where(np.isfinite(arm.limits.effort), arm.limits.effort, 10.0)
    case = Case(
        name, rate, int(rng.integers(0, max(8, 2000 // rate) + 1)),
        float(np.exp(rng.uniform(*np.log([1e-4, 5e-3])))), float(rng.uniform(0.6, 1.4)))
    coulomb = np.array(COULOMB.get(name, 0.025 * limit))
    rotors = rng.integers(2) * rng.uniform(0.1, 1.0, arm.joint_count) * limit / FASTEST
    one = BristledArm(arm, case, coulomb, rotors)
    move(one)
    while not one.loop.controller.has_stopped:
        one.run(0.5)
    speed, change = calm(one, 3.0)  # gains that an oscillation has lowered grow again for 2 s
    seen(f'{case}: {speed:.2g} rad/s, {change:.2g} F_c, {one.loop.supervisor.fault_count} faults')
    assert speed < 1e-3
    assert change < 0.05


def test_friction_that_is_given_too_large_does_not_drive_a_joint_away(seen):
    """The feedback of a light joint, or of one with an unknown rotor, could not hold it."""
    end = end_of_motion(Case('panda', 500, 4, 1e-3, 1.4, True), seconds=2.0)
    seen(f'{end.farthest:.4f} rad')
    assert end.farthest < 0.1


@pytest.mark.parametrize(('distance', 'width'), [
    (0.0, 0.025), (1e-4, 0.005), (2e-3, 0.01), (0.01, 0.05)])
def test_the_width_covers_the_presliding_distance(distance, width):
    friction = make_friction(['joint'], coulomb=[2.0], presliding_distance=[distance])
    assert friction.tracking_width == pytest.approx([width])
    for share, expected in ((0.5, 1.0), (-0.5, -1.0), (2.0, 2.0)):
        assert friction.tracking_effort(np.zeros(1), np.array([share * width])) == (
            pytest.approx([expected]))
    for v in (-0.1, 0.1):
        sign = np.copysign(1.0, v)
        for share, expected in (  # behind the reference, and ahead of it
                (0.7, 1.0), (3.0, 1.0), (-0.25, 0.75), (-1.0, 0.0), (-3.0, -1.0)):
            effort = friction.tracking_effort(np.array([v]), np.array([sign * share * width]))
            assert effort == pytest.approx([2.0 * sign * expected], abs=1e-6)


ROTORS = np.array([1.0, 1.0, 0.6, 0.1, 0.1, 0.1])
"""[kg·m²] at the joints."""
RIGID = 1e6
"""[N·m/rad]"""
DAMPING_RATIO = 0.02
SUBSTEPS = 20


class FlexibleArm(LockStep):
    """Rotors (q, v) and links (q_l, v_l) with springs of stiffness K [N·m/rad] between them."""

    def __init__(self, stiffness: FloatArray, rate: float, delay: int) -> None:
        bare = smooth_arm('ur10')
        super().__init__(
            bare.with_reflected_inertia(ROTORS), true_arm=bare, rate=rate, delay=delay)
        self._K, self.q_l, self.v_l = stiffness, self.q, self.v
        self.q = self.q + self._body.gravity(self.q) / stiffness
        inertia = np.minimum(np.diag(self._body.mass_matrix(self.q_l)), ROTORS)
        self._D = 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)
        self.speeds: list[float] = []

    def _move(self, effort: FloatArray) -> None:
        M = self._body.mass_matrix(self.q_l)
        h = self._body.nonlinear(self.q_l, self.v_l)
        n, dt = len(h), STEP / SUBSTEPS
        coupling = np.diag(dt * (self._D + dt * self._K))
        A = np.block([[M + coupling, -coupling], [-coupling, np.diag(ROTORS) + coupling]])
        K, R = dt * np.diag(self._K), np.diag(ROTORS)
        inverse = np.linalg.inv(A)  # implicit in the velocities
        change = inverse @ np.block([[-K, K, M, np.zeros((n, n))], [K, -K, np.zeros((n, n)), R]])
        constant = dt * inverse @ np.concatenate((-h, effort))
        x = np.concatenate((self.q_l, self.q, self.v_l, self.v))
        for _ in range(SUBSTEPS):
            u = change @ x + constant
            x = np.concatenate((x[:2 * n] + dt * u, u))
        self.q_l, self.q, self.v_l, self.v = np.split(x, 4)
        self.speeds.append(float(np.abs(u).max()))


@pytest.mark.parametrize(('rate', 'delay', 'stiffness'), [(125, 8, 5e3), (500, 4, 14e3)])
def test_wrists_with_flexible_gearboxes_come_to_rest(stiffness, rate, delay, seen):
    loop = check_rest([RIGID] * 3 + [stiffness] * 3, rate, delay, seen)
    assert rate < 500 or str(loop.controller.laws.oscillation) == ''


def test_gearboxes_of_the_shoulder_make_it_lower_its_gains(seen):
    """The rotor is a ninth of the inertia: fast motions see nine times the gain."""
    loop = check_rest([40e3] * 6, 500, 4, seen, 0.01, 13.0)
    assert str(loop.controller.laws.oscillation).startswith("'shoulder_")
    loop.controller.set_options(loop.controller.options)
    assert str(loop.controller.laws.oscillation) == ''


def test_lowered_gains_do_not_let_an_unknown_load_fall(seen):
    """30 N·m act on the shoulder from 1.5 s on."""
    one = FlexibleArm(np.full(6, 60e3), 500, 4)
    goal = one.q + 0.35 * directions(6)
    one.push = lambda t: -30.0 * np.eye(6)[1] * (t > 1.5)
    one.run(0.2)
    one.follow(goal)
    farthest = float(np.abs(one.run(5.8).last(4.0).q - goal).max())
    seen(f'{farthest:.3f} rad')
    assert one.loop.supervisor.fault_count == 0
    assert farthest < 0.5


def check_rest(
    stiffness: list[float], rate: int, delay: int, seen: Any, error: float = 1e-3,
    seconds: float = 4.0,
) -> ControlLoop:
    one = FlexibleArm(np.array(stiffness), rate, delay)
    goal = one.q + 0.35 * directions(6)
    one.run(0.2)
    one.follow(goal)
    one.run(seconds - 0.2)
    speed = max(one.speeds[-1000:])
    seen(f'{speed:.2g} rad/s, error {np.abs(one.q - goal).max():.2g} rad')
    assert one.loop.supervisor.fault_count == 0
    assert speed < 1e-3
    assert np.abs(one.q - goal).max() < error
    return one.loop
