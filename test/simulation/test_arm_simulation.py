# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated arm: energy, convergence, brakes, payloads, wrenches."""

import numpy as np
from optional_library import library
import pytest
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.model.payload import make_payload
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation
from robots import robot_urdf
from simulated_arms import COM, INERTIA, LENGTH, MASS, released, rubbing, two_link


def exact_motion(
    arm: ArmModel, q: np.ndarray, v: np.ndarray, duration: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the state after a free motion, from another integrator with a tight tolerance."""
    dynamics, n = ArmDynamics(arm), arm.joint_count

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate((x[n:], dynamics.forward_dynamics(x[:n], x[n:], np.zeros(n))))

    solution = library('scipy.integrate').solve_ivp(
        slope, (0.0, duration), np.concatenate((q, v)), method='DOP853', rtol=1e-12, atol=1e-13)
    return solution.y[:n, -1], solution.y[n:, -1]


# --- free motion ---------------------------------------------------------------------------------

@pytest.mark.parametrize('seconds', [6, pytest.param(60, marks=pytest.mark.soak)])
def test_a_free_arm_keeps_its_energy(seconds):
    """It falls from near upright past the lowest pose; the drift is below 1e-6 of the energy."""
    arm = two_link()
    simulation = released(arm, (0.3, 0.5))
    at_start = sum(simulation.energy)
    lowest = released(arm, (np.pi, 0.0)).energy[1]
    worst = 0.0
    for _ in range(10 * seconds):
        simulation.step(np.zeros(2), 0.1)
        worst = max(worst, abs(sum(simulation.energy) - at_start))
    assert worst < 1e-6 * min(abs(at_start), at_start - lowest)


def test_the_integration_is_of_fifth_order():
    arm, q0, v0 = two_link(), np.array([1.0, 0.5]), np.array([0.5, -1.0])
    exact = np.concatenate(exact_motion(arm, q0, v0, 1.0))
    errors = []
    for step in (0.02, 0.01, 0.005):
        simulation = released(arm, q0, v0, max_step=step)
        simulation.step(np.zeros(2), 1.0)
        errors.append(np.abs(np.concatenate(simulation.state) - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders >= 4.5).all(), orders


def test_how_a_motion_is_cut_into_calls_does_not_matter():
    arm, tau = two_link(), np.array([3.0, -1.0])
    whole, parts = released(arm, (1.0, 0.5)), released(arm, (1.0, 0.5))
    whole.step(tau, 0.4)
    for _ in range(8):
        parts.step(tau, 0.05)
    assert parts.q == pytest.approx(whole.q, abs=1e-12)


# --- brakes, reset, payload, wrench --------------------------------------------------------------

def test_brakes_hold_until_they_are_released():
    simulation = ArmSimulation(two_link(), (1.0, 0.5))
    for engage in (simulation.reset, simulation.brake, lambda: simulation.wait(1.0)):
        engage()
        with pytest.raises(InvalidInputError, match=r'brakes hold the simulated arm.*release\(\)'):
            simulation.step(np.array([100.0, 50.0]), 1.0)
        assert simulation.q.tolist() == [1.0, 0.5]
        assert simulation.v.tolist() == [0.0, 0.0]
    simulation.state.position[:] = 9.0  # a copy
    simulation.release()
    assert simulation.step(np.zeros(2), 0.1).velocity[0] != 0.0
    simulation.reset()
    assert simulation.braked
    assert simulation.q.tolist() == [1.0, 0.5]


def test_the_home_pose_is_within_the_limits():
    arm = load_arm(robot_urdf('panda'))
    q, v = ArmSimulation(arm).state
    assert not v.any()
    assert (q >= arm.limits.lower).all()
    assert (q <= arm.limits.upper).all()
    outside = (arm.limits.lower > 0.0) | (arm.limits.upper < 0.0)
    assert outside.any()  # 0 is outside the limits of this arm
    assert not q[~outside].any()


def test_a_load_comes_and_goes_linearly_within_its_transition_time():
    """The arm holds under the effort for the part of the load that acts; energy is balanced."""
    arm, q0 = two_link(), np.array([1.0, 0.5])
    payload = make_payload('tool0', 2.0, (0.1, 0.0, 0.05))
    simulation = released(arm, q0)
    empty, full = (ArmDynamics(arm.with_payloads(loads)).rigid_body.gravity(q0)
                   for loads in ([], [payload]))
    for target, begin, end in (([payload], empty, full), ([], full, empty)):
        at_start = sum(simulation.energy) - simulation.work
        simulation.set_payloads(target, 0.4)
        assert simulation.payloads == tuple(target)
        for i in range(1, 11):
            simulation.step(begin + min(i / 8, 1.0) * (end - begin), 0.05)
            assert simulation.q == pytest.approx(q0, abs=1e-9)
        assert simulation.arm.payloads == tuple(target)
        assert sum(simulation.energy) - simulation.work == pytest.approx(at_start, abs=1e-9)


@pytest.mark.parametrize('brakes', [False, True])
def test_a_change_of_payload_is_booked_as_work(brakes):
    """A point mass at the tool adds ½ m |ẋ|² + m g z; its removal subtracts the same."""
    m, lengths = 2.0, np.array([0.7, 0.4])
    arm = load_arm(planar_arm_urdf([3.0, 2.0], lengths, [0.3, 0.2], [0.1, 0.05]))
    payload = make_payload('tool0', m)
    simulation = released(arm, (1.0, 0.5), (2.0, -1.0))
    at_start, changes = sum(simulation.energy), []
    for load in (payload, None, payload, payload, None):
        simulation.step(np.zeros(2), 0.05)
        if brakes:
            simulation.brake()
        angles, rates = np.cumsum(simulation.q), np.cumsum(simulation.v)
        z = lengths @ np.cos(angles)
        dx, dz = (lengths * rates) @ np.cos(angles), (lengths * rates) @ np.sin(angles)
        carried = bool(simulation.arm.payloads)
        work = simulation.work
        simulation.set_payloads([] if load is None else [load])
        changes.append(simulation.work - work)
        expected = 0.5 * m * (dx**2 + dz**2) + m * 9.81 * z
        assert changes[-1] == pytest.approx(expected * (bool(load) - carried), rel=1e-9, abs=1e-12)
        assert sum(simulation.energy) == pytest.approx(
            at_start + simulation.work - simulation.heat, abs=1e-6)
        simulation.release()
    assert np.abs(changes).max() > 5.0


def test_a_payload_that_is_rejected_leaves_the_energy_balance():
    simulation = released(two_link(), (1.0, 0.5))
    with pytest.raises(InvalidInputError, match='no_link'):
        simulation.set_payloads([make_payload('no_link', 1.0)])
    assert simulation.work == 0.0
    assert simulation.arm.payloads == ()


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('arguments', 'words'), [
    ({'position': (1.0,)}, 'initial_position has 1 values, expected 2'),
    ({'velocity': (1.0, float('nan'))}, r'initial_velocity\[1\] \(joint2\) is nan'),
    ({'max_step': 0.0}, 'max_step is 0, expected a number > 0'),
])
def test_bad_arguments_are_refused_by_name(arguments, words):
    with pytest.raises(InvalidInputError, match=words):
        ArmSimulation(two_link(), **arguments)  # type: ignore[arg-type]


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_a_diverged_arm_is_reported():
    simulation = released(two_link(), (1.0, 0.5))
    with pytest.raises(InvalidInputError, match='no finite solution'):
        simulation.step(np.array([1e200, -1e200]), 1.0)


# Two joints about one axis without a mass in between: each moves the bob, but M is singular.
JOINT = """
<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
TWO_FOR_ONE_MOTION = f"""
<robot name="r"><link name="base"/><link name="nothing"/>
<link name="bob"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
{JOINT.format('one', 'base', 'nothing')}{JOINT.format('other', 'nothing', 'bob')}</robot>"""


@pytest.mark.parametrize('friction', [{}, {'viscous': 1.0, 'coulomb': 1.0}])
def test_a_motion_without_inertia_is_refused_with_any_friction(friction):
    arm = load_arm(TWO_FOR_ONE_MOTION)
    simulation = released(arm.with_friction(make_friction(arm.joint_names, **friction)))
    with pytest.raises(InvalidInputError, match='no finite solution'):
        simulation.step(np.array([5.0, -5.0]), 0.002)
    assert simulation.q.tolist() == [0.0, 0.0]


def test_a_joint_that_moves_no_mass_is_named():
    # the bob is a point on its axis
    urdf = TWO_FOR_ONE_MOTION.replace('="1" ixy', '="0" ixy')
    ArmSimulation(load_arm(urdf)).check_inertia()  # the inertia about that axis remains
    with pytest.raises(ModelError, match=r"joints \['one', 'other'\] of robot 'r' move no mass"):
        ArmSimulation(load_arm(urdf.replace('izz="1"', 'izz="0"'))).check_inertia()


@pytest.mark.parametrize('viscous', [1.0, 5000.0])
def test_a_wrench_does_work_that_is_no_heat(viscous):
    # a push at the tip that both the stiff and the non-stiff integration have to include
    arm = load_arm(
        planar_arm_urdf([MASS], [LENGTH], [COM], [INERTIA], [viscous], [0.0]),
        gravity=(0.0, 0.0, 0.0))
    simulation = released(arm)
    push = ExternalWrench('tool0', np.array([50.0, 0.0, 0.0]), np.zeros(3))
    for _ in range(400):
        simulation.step(np.zeros(1), 0.005, [push])
    # The push stays normal to the link: its moment is constant during the motion.
    work = 50.0 * LENGTH * float(simulation.q[0])
    kinetic, _ = simulation.energy
    assert work > 0.1
    assert simulation.heat == pytest.approx(work - kinetic, rel=1e-6)


# --- brakes --------------------------------------------------------------------------------------

START = (0.8, 0.5)
REFLECTED_INERTIA = 0.2
"""Of each motor on its joint [kg·m²]."""


RUBBING = rubbing(two_link(), viscous=[1.0, 0.4], coulomb=[2.0, 0.8], static=[3.0, 1.2],
                  stribeck_velocity=[0.05])


def driven(**changes: list[float]) -> ArmModel:
    """Return an arm whose motors have inductance: their current is a state variable."""
    return RUBBING.with_actuators(make_actuators(RUBBING.joint_names, **{
        'torque_constant': [0.05], 'gear_ratio': [100.0], 'resistance': [0.8],
        'inductance': [4e-4], 'rotor_inertia': [REFLECTED_INERTIA / 1e4], **changes}))


WITH_BACKLASH = driven(backlash=[0.3], restitution=[0.5])


def moving(arm: ArmModel) -> ArmSimulation:
    """Return an arm that moves down after a fall and a push."""
    simulation = released(arm, START)
    simulation.step(np.array([20.0, -8.0]), 0.1)
    assert np.abs(simulation.v).min() > 0.1
    return simulation


def test_every_joint_and_motor_stops_in_place():
    simulation = moving(WITH_BACKLASH)
    # a motor within its gap moves on its own
    assert np.abs(simulation.motor_state.velocity - simulation.v).max() > 0.1
    q, theta = simulation.state.position, simulation.motor_state.position
    simulation.brake()
    for _ in range(3):
        assert simulation.braked
        for state, position in ((simulation.state, q), (simulation.motor_state, theta)):
            assert state.position.tolist() == position.tolist()
            assert state.velocity.tolist() == [0.0, 0.0]
        assert simulation.effort.tolist() == [0.0, 0.0]
        simulation.wait(0.1, [ExternalWrench('tool0', np.array([50.0, 0.0, 0.0]), np.zeros(3))])


@pytest.mark.parametrize('arm', [RUBBING, WITH_BACKLASH], ids=['links', 'links and rotors'])
def test_the_motion_of_links_and_rotors_becomes_heat(arm):
    simulation = moving(arm)
    v, omega = simulation.v, simulation.motor_state.velocity
    rotors = REFLECTED_INERTIA if simulation.arm.actuators is not None else 0.0
    links = ArmDynamics(two_link()).rigid_body.mass_matrix(simulation.q)
    expected = 0.5 * float(v @ links @ v + rotors * omega @ omega)
    (kinetic, potential), heat, work = simulation.energy, simulation.heat, simulation.work
    simulation.brake()
    assert simulation.heat - heat == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(kinetic, rel=1e-12)
    assert simulation.energy == (0.0, potential)
    assert simulation.work == work


def test_it_continues_like_an_arm_that_starts_there():
    """At rest, with its motors without current and with initial friction states."""
    simulation = moving(driven())
    simulation.brake()
    twin = ArmSimulation(driven(), simulation.q)
    for arm in (simulation, twin):
        arm.release()
        arm.step(np.array([5.0, -2.0]), 0.05)
    assert simulation.q.tolist() == twin.q.tolist()
    assert simulation.v.tolist() == twin.v.tolist()
    assert simulation.effort.tolist() == twin.effort.tolist()


def test_brakes_that_are_closed_already_change_nothing():
    simulation = ArmSimulation(two_link(), START, (0.3, -0.2))  # to be released in motion
    simulation.brake()
    assert simulation.heat == 0.0
    assert simulation.v.tolist() == [0.3, -0.2]
    simulation.release()
    simulation.brake()
    heat = simulation.heat
    simulation.brake()
    assert simulation.heat == heat > 0.0
