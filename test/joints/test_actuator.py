# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Motors and gearboxes: conversions and their inverses, power, limits, and the driven arm."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from optional_library import library
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.actuator import Actuators, make_actuators
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from simulated_arms import ABOUT_JOINT, one_link, released

laws = settings(deadline=None, derandomize=True, max_examples=50)
numbers = st.floats(-10.0, 10.0)

NAMES = ('joint1',)


def motor(**changes: list[float]) -> Actuators:
    return make_actuators(NAMES, **{
        'torque_constant': [0.05], 'gear_ratio': [100.0], 'resistance': [0.8],
        'inductance': [4e-4], 'rotor_inertia': [2e-5], 'efficiency': [0.7], **changes})


# --- conversions ---------------------------------------------------------------------------------

@laws
@given(numbers, numbers, numbers)
def test_from_effort_to_motor_and_back(tau, v, a):
    actuators = motor()
    effort, v_, a_ = np.array([tau]), np.array([v]), np.array([a])
    there = actuators.motor_torque(effort, v_, a_)
    assert actuators.effort(there, v_, a_) == pytest.approx(effort, abs=1e-12)


@laws
@given(numbers, numbers)
def test_the_gearbox_loses_power_whichever_side_drives(tau, v):
    actuators = motor(rotor_inertia=[0.0])
    effort, v_, zero = np.array([tau]), np.array([v]), np.zeros(1)
    motor_power = (actuators.motor_torque(effort, v_, zero) * 100.0 * v_)[0]
    joint_power = tau * v
    assert motor_power >= joint_power - 1e-12
    if joint_power > 0.0:  # the motor drives the joint
        assert joint_power == pytest.approx(0.7 * motor_power)
    if joint_power < 0.0:  # the joint drives the motor
        assert motor_power == pytest.approx(0.7 * joint_power)


def test_current_and_voltage_by_hand():
    load = motor(current_limit=[10.0], voltage_limit=[24.0]).load(
        np.array([14.0]), np.array([2.0]), np.zeros(1))
    current = 14.0 / (100.0 * 0.7) / 0.05
    assert load.current == pytest.approx([current])
    assert load.voltage == pytest.approx([0.8 * current + 0.05 * 100.0 * 2.0])
    assert load.current_ratio == pytest.approx([current / 10.0])
    assert load.voltage_ratio == pytest.approx([(0.8 * current + 10.0) / 24.0])


def test_the_rotor_does_not_pass_the_gearbox():
    actuators = motor()
    a = np.array([3.0])
    only_rotor = actuators.reflected_inertia * a
    assert actuators.motor_torque(only_rotor, np.ones(1), a) == pytest.approx(2e-5 * 100.0 * a)


def test_the_envelope_falls_from_stall_to_no_load():
    actuators = motor(voltage_limit=[24.0], current_limit=[20.0], efficiency=[1.0])
    _, stall = actuators.effort_range(np.zeros(1))
    assert stall == pytest.approx([20.0 * 0.05 * 100.0])  # the current limit
    no_load_speed = 24.0 / (0.05 * 100.0)
    _, none = actuators.effort_range(np.array([no_load_speed]))
    assert none == pytest.approx([0.0], abs=1e-12)
    _, half = actuators.effort_range(np.array([0.9 * no_load_speed]))
    assert half == pytest.approx([0.1 * 24.0 / 0.8 * 0.05 * 100.0])
    reversing = motor(
        gear_ratio=[-100.0], voltage_limit=[24.0], current_limit=[20.0], efficiency=[1.0])
    assert np.ravel(reversing.effort_range(np.array([2.0]))) == pytest.approx(
        np.ravel(actuators.effort_range(np.array([2.0]))))


@laws
@given(numbers, st.floats(0.5, 40.0))
def test_steady_currents_are_within_the_voltage_at_every_speed(v, limit):
    """
    The current is within the current limit, too, if any current is within both limits.

    Otherwise the motor brakes at full voltage, against the surplus of the back-EMF.
    """
    actuators = motor(voltage_limit=[24.0], current_limit=[limit])
    speed = np.array([v])
    low, high = actuators.current_range(speed)
    for current in (low, high):
        assert np.abs(actuators.voltage(current, speed)) <= 24.0 * (1.0 + 1e-12)
    assert low <= high
    exists = 5.0 * abs(v) <= 24.0 + 0.8 * limit
    for current in np.linspace(-limit, limit, 41):
        inside = abs(0.8 * current + 5.0 * v) <= 24.0
        assert exists or not inside
        if abs(abs(0.8 * current + 5.0 * v) - 24.0) > 1e-9:
            assert inside == (exists and bool(low <= current <= high))
    if exists:
        assert np.abs([low, high]).max() <= limit
    else:
        assert [low, high] == pytest.approx(2 * [np.sign(v) * (24.0 - 5.0 * abs(v)) / 0.8])


@pytest.mark.parametrize(('field', 'value', 'words'), [
    ('gear_ratio', [0.0], "actuator.gear_ratio of 'joint1' is 0, expected a number other than 0"),
    ('efficiency', [0.0], r"actuator.efficiency of 'joint1' is 0, expected a number in \(0, 1\]"),
    ('torque_constant', [], 'actuator.torque_constant is empty, expected one value'),
    ('inductance', [-1.0], "actuator.inductance of 'joint1' is -1, expected a number >= 0"),
    ('rotor_inertia', [1.0, 2.0], r'actuator.rotor_inertia has 2 values, expected 1'),
    ('reflected_inertia', [0.2], "actuator.rotor_inertia of 'joint1' is 2e-05 and "
     'actuator.reflected_inertia is 0.2, expected one of them'),
    ('reflected_inertia', [-0.2],
     "actuator.reflected_inertia of 'joint1' is -0.2, expected a number >= 0"),
])
def test_invalid_values_are_rejected_by_name(field, value, words):
    with pytest.raises(InvalidInputError, match=words):
        motor(**{field: value})


# --- the arm -------------------------------------------------------------------------------------


positive = st.floats(0.0, 5.0)


@laws
@given(st.lists(positive, min_size=2, max_size=2), st.lists(
    st.floats(1.0, 200.0), min_size=2, max_size=2), st.lists(numbers, min_size=6, max_size=6))
def test_a_reflected_inertia_needs_no_motor(J, N, state):
    """M grows by diag(J), as with the motors of this inertia, and dynamics stay consistent."""
    bare = load_arm(planar_arm_urdf([2.0, 1.0], [1.0, 0.8], [0.5, 0.3], [0.1, 0.05]))
    arm = bare.with_reflected_inertia(J)
    q, v, a = np.array(state).reshape(3, 2)
    dynamics = ArmDynamics(arm)
    assert arm.actuators is None
    assert arm.reflected_inertia.tolist() == J
    assert dynamics.rigid_body.mass_matrix(q) - ArmDynamics(bare).rigid_body.mass_matrix(q) == (
        pytest.approx(np.diag(J), abs=1e-12))
    tau = dynamics.inverse_dynamics(q, v, a)
    assert dynamics.forward_dynamics(q, v, tau) == pytest.approx(a, abs=1e-9)
    at_motor = [inertia / ratio**2 for inertia, ratio in zip(J, N)]
    for inertias in ({'rotor_inertia': at_motor}, {'reflected_inertia': J}):
        geared = bare.with_actuators(make_actuators(bare.joint_names, [0.1], N, **inertias))
        assert ArmDynamics(geared).inverse_dynamics(q, v, a) == pytest.approx(tau, rel=1e-12)


def test_each_joint_has_one_of_both_inertias():
    motors = make_actuators(
        ('a', 'b', 'c'), [0.1], [10.0, 20.0, 5.0], rotor_inertia=[1e-3, 0.0, 0.0],
        reflected_inertia=[0.0, 0.4, 0.0])
    assert motors.reflected_inertia == pytest.approx([0.1, 0.4, 0.0])


def test_a_motors_step_response_is_that_of_its_linear_equations():
    """L di/dt = V − R i − K_e N v and (J + N² J_r) dv/dt = N K_t i, by matrix exponential."""
    K, N, R, L, V, t = 0.05, 100.0, 0.8, 0.05, 24.0, 0.15
    J = ABOUT_JOINT + N**2 * 2e-5
    A = np.array([[0.0, N * K / J, 0.0], [-K * N / L, -R / L, V / L], [0.0, 0.0, 0.0]])
    v, i, _ = library('scipy.linalg').expm(A * t) @ np.array([0.0, 0.0, 1.0])
    actuators, errors = motor(efficiency=[1.0], voltage_limit=[V], inductance=[L]), []
    for step in (2e-3, 1e-3, 5e-4):
        simulation = released(one_link().with_actuators(actuators), max_step=step)
        simulation.step(np.array([1e6]), t)  # a high request: the voltage is at its limit
        found = np.array([simulation.v[0], simulation._drive.current[0]])
        errors.append(np.abs(found / [v, i] - 1.0).max())
    assert errors[1] < 1e-3, errors
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.9).all(), (orders, errors)


@pytest.mark.parametrize(('step', 'inductance'), [(8e-3, 4e-4), (64e-3, 0.0)])
def test_a_motor_at_its_voltage_limit_settles_at_any_step(step, inductance):
    """Back-EMF decelerates with K² N² / (R J) = 39 /s: 3 time constants in the longest step."""
    actuators = motor(
        efficiency=[1.0], voltage_limit=[24.0], inductance=[inductance], rotor_inertia=[2e-5])
    simulation = released(one_link().with_actuators(actuators), max_step=step)
    no_load = 24.0 / (0.05 * 100.0)
    speeds = [float(simulation.step(np.array([1e6]), step).velocity[0]) for _ in range(
        round(1.0 / step))]
    assert max(speeds) < 1.2 * no_load
    assert speeds[-1] == pytest.approx(no_load, rel=1e-6)


@pytest.mark.parametrize(('inductance', 'bound', 'asked'), [(0.0, 1e-6, -8.0), (4e-4, 1e-2, 8.0)])
def test_a_motor_driven_beyond_both_limits_slows_down_at_full_voltage(inductance, bound, asked):
    """J dv/dt = K N (V − K N v) / R, independent of the requested effort."""
    K, N, R, V, v0, t = 0.05, 100.0, 0.8, 24.0, 12.0, 0.05
    actuators = motor(
        efficiency=[1.0], voltage_limit=[V], current_limit=[2.0], inductance=[inductance])
    simulation = released(one_link().with_actuators(actuators), velocity=[v0], max_step=1e-4)
    no_load, rate = V / (K * N), (K * N)**2 / (R * (ABOUT_JOINT + N**2 * 2e-5))
    expected = no_load + (v0 - no_load) * np.exp(-rate * t)
    assert K * N * expected > V + R * 2.0  # still beyond both limits
    assert simulation.step(np.array([asked]), t).velocity == pytest.approx([expected], rel=bound)


@pytest.mark.parametrize(('given', 'T_c'), [([5e-4], 5e-4), ([], 2e-4)])
def test_the_current_follows_its_loop_however_long_the_step(given, T_c):
    """Within the voltage limit, the mean effort lags by exactly the time constant of the loop."""
    actuators = motor(efficiency=[1.0], current_time_constant=given, rotor_inertia=[0.0])
    simulation = released(one_link().with_actuators(actuators), max_step=0.01)
    simulation.step(np.array([1.0]), 0.01)
    lag = T_c / 0.01 * (1.0 - np.exp(-0.01 / T_c))
    assert simulation.effort == pytest.approx([1.0 - lag], rel=1e-9)


def test_no_motor_exceeds_its_current_limit_or_delivers_more_power_than_it_takes():
    actuators = motor(current_limit=[2.0], efficiency=[1.0])
    simulation = released(one_link().with_actuators(actuators))
    simulation.step(np.array([1000.0]), 0.05)
    assert simulation.effort == pytest.approx([2.0 * 0.05 * 100.0], rel=1e-6)
    actuators = motor(voltage_limit=[24.0], current_limit=[20.0])
    simulation = released(one_link().with_actuators(actuators))
    for _ in range(400):
        simulation.step(np.array([50.0]), 1e-3)
    assert simulation.v[0] < 24.0 / (0.05 * 100.0)  # the no-load speed
    assert simulation.work == pytest.approx(sum(simulation.energy), rel=1e-6)
