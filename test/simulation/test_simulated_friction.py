# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The simulated arm with friction of joints and gears: exact solutions, convergence, energy, creep.

The motion of a block on a rail with dry friction is known in closed form.
"""

from typing import Any

from controller_bench import ARM, NAMES
import numpy as np
from optional_library import library
import pytest
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robot_dynamics.simulation.plant import InnerController
from robots import robot_urdf
from simulated_arms import block, released

# --- convergence and stiff friction --------------------------------------------------------------

def test_dry_friction_does_not_cost_the_method_its_order():
    """The sliding direction changes several times; steps are split only at these changes."""
    arm = load_arm(planar_arm_urdf(
        [5.0, 3.0], [1.0, 0.8], [0.5, 0.4], [0.1, 0.05], coulomb_friction=[2.0, 1.0]))

    def end(step: float) -> np.ndarray:
        simulation = released(arm, (2.5, 0.8), (0.5, -1.0), max_step=step)
        return np.concatenate(simulation.step(np.zeros(2), 1.2))

    exact = end(0.0005)
    errors = [np.abs(end(step) - exact).max() for step in (0.02, 0.01, 0.005)]
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 4.0).all(), errors


def test_stuck_joints_with_stiff_friction_act_as_fixed_joints():
    """Dry friction holds the wrists of the UR10; viscous friction would relax them fast."""
    urdf, viscous, steps = robot_urdf('ur10'), 0.3, (8e-3, 4e-3, 2e-3)
    arm = load_arm(urdf)
    arm = arm.with_friction(make_friction(arm.joint_names, [viscous], [0.0] * 3 + [100.0] * 3))
    fixed = load_arm(urdf, arm.joint_names[:3])
    fixed = fixed.with_friction(make_friction(fixed.joint_names, [viscous]))
    M = ArmDynamics(arm).rigid_body.mass_matrix(np.zeros(6))
    assert viscous * np.linalg.inv(M)[5, 5] * steps[-1] > 1.0  # friction at wrist 3 is stiff
    q0, v0 = np.array([0.2, -1.0, 0.8]), np.array([1.0, 0.6, -0.4])
    exact = released(fixed, q0, v0, 2.5e-4).step(np.zeros(3), 0.3).position
    assert np.abs(exact - q0).min() > 0.1
    errors = []
    for step in steps:
        simulation = released(arm, [*q0, 0.0, 0.0, 0.0], [*v0, 0.0, 0.0, 0.0], step)
        q, v = simulation.step(np.zeros(6), 0.3)
        assert q[3:].tolist() == v[3:].tolist() == [0.0] * 3
        errors.append(np.abs(q[:3] - exact).max())
    assert errors[-1] < 1e-9, errors
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) >= 4.0).all(), errors


@pytest.mark.parametrize(('v0', 'tau'), [
    (0.0, 0.08),  # breaks away, and continues while friction decreases with speed
    (1.0, 0.05),  # decelerates to a speed with higher friction
])
def test_falling_friction_is_followed_where_viscous_friction_is_stiff(v0, tau):
    """J v̇ = τ − F_v v − [F_c + (F_s − F_c) exp(−(v/v_s)²)], with 23 time constants in 2 ms."""
    J, F_v, F_c, F_s, v_s, duration = 3.5e-5, 0.4, 0.02, 0.04, 0.05, 0.02
    arm = load_arm(planar_arm_urdf([0.01], [0.1], [0.05], [1e-5]), gravity=(0.0, 0.0, 0.0))
    arm = arm.with_friction(make_friction(arm.joint_names, [F_v], [F_c], [F_s], [v_s]))

    def slope(_: float, y: np.ndarray) -> np.ndarray:
        dry = F_c + (F_s - F_c) * np.exp(-(y[1] / v_s)**2)
        return np.array([y[1], (tau - F_v * y[1] - dry) / J])

    def speed(_: float, y: np.ndarray) -> float:
        return float(y[1])

    speed.terminal, speed.direction = True, -1.0  # type: ignore[attr-defined]
    exact = library('scipy.integrate').solve_ivp(
        slope, (0.0, duration), [0.0, v0], 'Radau', events=speed, rtol=1e-11, atol=1e-13).y[:, -1]
    for step in (4e-3, 1e-3):
        simulation = released(arm, (0.0,), (v0,), step)
        before = sum(simulation.energy)
        q, v = simulation.step(np.array([tau]), duration)
        assert q == pytest.approx(exact[:1], abs=2e-8)
        assert v == pytest.approx(exact[1:], abs=1e-7 / np.sqrt(J))  # tolerance of a sub-step
        gain = sum(simulation.energy) - before
        assert simulation.work - simulation.heat == pytest.approx(gain, abs=1e-8)


MASS, GRAVITY = 2.0, 9.81


def lift(sigmoid: float, width: float, load_fraction: float) -> ArmModel:
    """Return a mass on a vertical rail: its gears bear the same load everywhere."""
    return block(
        MASS, (0.0, 0.0, 1.0), sigmoid=sigmoid, sigmoid_velocity=width,
        load_coefficient=load_fraction)


def geared(**changes: Any) -> ArmModel:
    """Return the arm of two links with every kind of friction."""
    return ARM.with_friction(make_friction(
        NAMES, [0.5, 0.2], [1.0, 0.5], [1.5, 0.5], [0.05], [0.3, -0.1], **{
        'sigmoid': [2.0, 0.5], 'sigmoid_velocity': [0.05, 0.1], 'load_coefficient': [0.1, 0.2],
        'presliding_distance': [0.01, 0.0], **changes}))


@pytest.mark.parametrize('width', [0.1, 1e-5])
def test_under_a_load_below_its_friction_a_joint_creeps(width):
    """With up to 500 time constants per step: v_a artanh of the fraction of the load."""
    arm = lift(5.0, width, 0.1)
    simulation = released(arm, [0.0])
    for _ in range(300):
        state = simulation.step(np.array([MASS * GRAVITY + 2.0]), 0.002)
    expected = width * np.arctanh(2.0 / (5.0 + 0.1 * MASS * GRAVITY))
    assert state.velocity[0] == pytest.approx(expected, rel=1e-6)
    assert simulation.work - simulation.heat == pytest.approx(
        sum(simulation.energy) - sum(released(arm, [0.0]).energy), abs=1e-7)


@pytest.mark.parametrize(('width', 'backlash', 'load', 'allowed'), [
    ([0.05, 0.1], 2e-3, [0.0], 1e-6), ([0.002, 0.001], None, [0.1, 0.2], 1e-6),
    ([0.05, 0.1], 2e-3, [0.1, 0.2], 1e-4)])
def test_the_energy_balance_closes(width, backlash, load, allowed):
    """Load-dependent friction acts where teeth touch."""
    arm = geared(sigmoid_velocity=width, load_coefficient=load)
    if backlash is not None:
        arm = arm.with_actuators(make_actuators(
            NAMES, [0.1], [100.0], rotor_inertia=[2e-5], backlash=[backlash]))
    simulation = released(arm, [0.4, -0.3], [1.0, -2.0])
    at_start, largest, turns, before = sum(simulation.energy), 1.0, 0, simulation.v.copy()
    for k in range(300):
        effort = np.array([60.0, 20.0]) * np.sin(0.03 * k + np.array([0.0, 1.0]))
        v = simulation.step(effort, 0.002).velocity
        turns, before = turns + int((v * before < 0.0).sum()), v
        change = sum(simulation.energy) - at_start
        largest = max(largest, simulation.work, simulation.heat)
        assert simulation.work - simulation.heat == pytest.approx(change, abs=allowed * largest)
    assert turns >= 3
    assert simulation.heat > 5.0


@pytest.mark.parametrize('v', [[0.0, 0.4], [-0.02, 0.0]])
def test_the_first_acceleration_is_that_of_forward_dynamics(v):
    arm, effort = geared(presliding_distance=[0.0]), np.array([90.0, 5.0])
    q, h = [0.4, -0.3], 1e-6
    simulation = released(arm, q, v, h)
    a = (simulation.step(effort, h).velocity - v) / h
    expected = ArmDynamics(arm).forward_dynamics(np.array(q), np.array(v), effort)
    assert a == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert np.abs(expected).max() > 1.0


def test_forward_dynamics_inverts_inverse_dynamics_with_a_joint_at_rest():
    """Joint 2 sticks, joint 1 slides: the load of joint 2 is its effort less dry friction."""
    arm = geared(load_coefficient=[0.5, 0.5])
    q, v, a = np.array([0.4, -0.3]), np.array([0.2, 0.0]), np.array([3.0, 0.0])
    dynamics = ArmDynamics(arm)
    tau = dynamics.inverse_dynamics(q, v, a)
    assert dynamics.forward_dynamics(q, v, tau) == pytest.approx(a, abs=1e-9)


def test_a_robot_that_compensates_friction_compensates_that_of_its_gears():
    arm = geared()
    robot = InnerController(arm, EffortConvention(robot_compensates=('friction',)))
    q, v, effort = np.array([0.4, -0.3]), np.array([0.2, -0.1]), np.array([30.0, 4.0])
    added = robot.with_own_compensation(effort, q, v) - effort
    assert added == pytest.approx(
        arm.friction.smooth_effort(v, effort), rel=1e-12)


def test_teeth_that_do_not_touch_bear_no_load():
    """While the motor is inside the gap, only gravity and unloaded friction act on the lift."""
    motors = make_actuators(['hinge'], [0.1], [100.0], rotor_inertia=[2e-5], backlash=[0.5])
    arm = lift(2.0, 0.01, 0.5).with_actuators(motors)
    simulation = released(arm, [0.0], [1.0])
    simulation.step(np.array([-10.0]), 1e-3)
    assert simulation.v[0] == pytest.approx(1.0 - 1e-3 * (GRAVITY + 2.0 / MASS), rel=1e-6)


BLOCK_MASS, DRY = 3.0, 6.0
EXACT = 1e-12


def moving(velocity: float = 0.0, slope: float = 0.0, **friction: float) -> ArmSimulation:
    """Return a block on a rail that descends by `slope` [rad] along its axis."""
    axis = float(np.cos(slope)), 0.0, -float(np.sin(slope))
    return released(block(BLOCK_MASS, axis, **friction), [0.0], [velocity])


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_push_a_slide_and_a_stop(sign):
    """A push F gives (F − F_c)/m; then the block slides v²/(2 F_c/m) in v/(F_c/m) and sticks."""
    force, pushed = 15.0, 0.4
    simulation = moving(coulomb=DRY)
    q, v = simulation.step(np.array([sign * force]), pushed)
    gain, loss = (force - DRY) / BLOCK_MASS, DRY / BLOCK_MASS
    assert v == pytest.approx([sign * gain * pushed], rel=EXACT)
    assert q == pytest.approx([sign * gain * pushed**2 / 2.0], rel=EXACT)

    speed, way = gain * pushed, gain * pushed**2 / 2.0
    until = speed / loss
    q, v = simulation.step(np.zeros(1), 0.5 * until)
    assert v == pytest.approx([sign * 0.5 * speed], rel=EXACT)
    q, v = simulation.step(np.zeros(1), 0.5 * until + 0.01)
    assert v.tolist() == [0.0]
    assert q == pytest.approx([sign * (way + speed**2 / (2.0 * loss))], rel=EXACT)
    assert simulation.heat == pytest.approx(DRY * abs(q[0]), rel=1e-11)
    assert simulation.work == pytest.approx(force * way, rel=1e-11)
    assert simulation.step(np.array([sign * 0.999 * DRY]), 60.0).position.tolist() == q.tolist()


@pytest.mark.parametrize('fraction', [0.99, 1.01])
def test_on_a_slope_it_slides_from_the_angle_of_friction_on(fraction):
    """
    It sticks for m g sin(slope) ≤ F_s, and otherwise slides with g sin(slope) − F_c/m.

    The decrease from F_s to F_c lasts about 1e-5 s here.
    """
    static = 1.2 * DRY
    slope = float(np.arcsin(fraction * static / (BLOCK_MASS * 9.81)))
    simulation = moving(slope=slope, coulomb=DRY, static=static, stribeck_velocity=1e-6)
    q, v = simulation.step(np.zeros(1), 0.5)
    if fraction < 1.0:
        assert (q.tolist(), v.tolist()) == ([0.0], [0.0])
    else:
        assert v == pytest.approx([0.5 * (9.81 * np.sin(slope) - DRY / BLOCK_MASS)], rel=1e-4)
