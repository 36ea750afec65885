# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0
"""Gravity that changes at run time: the control path, planning, robots with their own gravity."""

from collections.abc import Sequence
import math

from controller_bench import update
import numpy as np
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws.error_feedback import make_gains
from robot_dynamics.control.loaded_arm import LoadedArm
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.effort_convention import make_effort_convention
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.references.motion_limits import WorkspaceInertia
from robots import robot_urdf
from simulated_arms import released, two_link

STEP_NS = 2_000_000
UR10 = load_arm(robot_urdf('ur10'))
Q = np.array([0.3, -1.2, 0.9, 0.4, -0.7, 0.2])
WALL, CEILING, FLOOR = (9.81, 0.0, 0.0), (0.0, 0.0, 9.81), (0.0, 0.0, -9.81)
LOAD = make_payload('tool0', 3.0, (0.0, 0.05, 0.1))


def controller(**semantics: Sequence[float]) -> Controller:
    convention = make_effort_convention('joint_torque', ['gravity'], False, **semantics) if (
        semantics) else make_effort_convention('joint_torque', [], False)
    return Controller(UR10, ControllerOptions(
        make_gains(UR10.joint_names), effort_convention=convention))


def gravity_torque(gravity: Sequence[float], loads: Sequence[object] = ()) -> np.ndarray:
    arm = load_arm(robot_urdf('ur10'), gravity=gravity).with_payloads(loads)
    return ArmDynamics(arm).gravity(Q)


@pytest.mark.parametrize('gravity', [WALL, CEILING, (1.0, -2.0, -1.62)])
def test_an_arm_with_another_gravity_is_that_of_the_urdf(gravity):
    changed = UR10.with_payloads([LOAD]).with_gravity(gravity)
    assert changed.gravity.tolist() == list(gravity)
    assert ArmDynamics(changed).gravity(Q) == pytest.approx(
        gravity_torque(gravity, [LOAD]), abs=1e-12)
    assert ArmDynamics(changed.with_payloads([])).gravity(Q) == pytest.approx(
        gravity_torque(gravity), abs=1e-12)
    assert UR10.gravity.tolist() == list(FLOOR)


@pytest.mark.parametrize('loads', [[], [LOAD]])
def test_gravity_changes_at_most_with_its_rate(loads):
    rate, one = 20.0, controller()
    one.set_payloads(loads, 0.0, lambda _: None)
    zero, stamp = np.zeros(6), 0
    update(one, stamp, Q, zero)
    one.set_gravity(np.array(CEILING), rate)
    assert one.load.planning.gravity(Q) == pytest.approx(gravity_torque(CEILING, loads))
    torques = []
    for _ in range(500):  # 19.62 m/s² at 20 m/s³ take 0.981 s
        stamp += STEP_NS
        torques.append(update(one, stamp, Q, zero).gravity_compensation)
    start, end = gravity_torque(FLOOR, loads), gravity_torque(CEILING, loads)
    for k in (0, 100, 400):
        share = min(k * 2e-3 * rate / 19.62, 1.0)  # the first state begins it
        assert torques[k] == pytest.approx(start + share * (end - start), abs=1e-9)
    assert torques[-1] == pytest.approx(end, abs=1e-12)
    assert torques[489] != pytest.approx(end, abs=1e-3)


def test_a_stream_that_is_faster_than_the_states_makes_progress():
    one = controller()
    update(one, 0, Q, np.zeros(6))
    for k in range(1, 22):
        for _ in range(2):
            one.set_gravity(np.array(WALL), 40.0)
        output = update(one, k * 10 * STEP_NS, Q, np.zeros(6))
    assert output.gravity_compensation == pytest.approx(gravity_torque(WALL), abs=1e-12)


def test_a_pause_of_the_states_causes_no_step():
    one = controller()
    before = update(one, 0, Q, np.zeros(6)).gravity_compensation
    one.set_gravity(np.array(CEILING), 20.0)
    assert update(one, STEP_NS, Q, np.zeros(6)).gravity_compensation.tolist() == before.tolist()
    after = update(one, 60 * 10**9, Q, np.zeros(6)).gravity_compensation
    share = 20.0 * 0.1 / 19.62
    assert after == pytest.approx(before + share * (gravity_torque(CEILING) - before), abs=1e-9)


def test_inertia_and_gravity_are_not_underestimated_during_a_change():
    loaded = LoadedArm(UR10)
    for target in (WALL, CEILING, FLOOR):  # the second one interrupts the first
        loaded.begin_gravity_change(loaded.prepare(gravity=np.array(target)), 10.0)
        for k in range(400):
            loaded.advance(k * 4 * STEP_NS)
            if k % 40 == 0:
                actual = WorkspaceInertia(ArmDynamics(loaded.dynamics.arm))
                assert (actual.gravity <= loaded.workspace.gravity + 1e-9).all()
            if target is WALL and k == 30:
                break


def test_a_robot_that_compensates_along_its_own_gravity():
    """The command and the effort of the robot add up to the gravity torque."""
    one = controller(robot_gravity=FLOOR)
    update(one, 0, Q, np.zeros(6))
    one.set_gravity(np.array(WALL), math.inf)
    output = update(one, STEP_NS, Q, np.zeros(6))
    assert output.gravity_compensation == pytest.approx(gravity_torque(WALL), abs=1e-12)
    assert output.robot_gravity == pytest.approx(gravity_torque(FLOOR), abs=1e-12)
    assert output.command + output.robot_gravity == pytest.approx(gravity_torque(WALL), abs=1e-12)
    true = controller(robot_gravity=())
    true.set_gravity(np.array(WALL), math.inf)
    assert update(true, 0, Q, np.zeros(6)).command == pytest.approx(0.0, abs=1e-12)


def test_energy_of_a_change_of_gravity_counts_as_work():
    simulation = released(two_link(), (1.0, 0.5))
    start = sum(simulation.energy)
    for gravity in ((3.0, 0.0, -9.0), (0.0, 0.0, 9.81)):
        simulation.step(np.zeros(2), 0.3)
        simulation.set_gravity(np.array(gravity))
    simulation.step(np.zeros(2), 0.3)
    assert abs(simulation.work) > 1.0
    assert sum(simulation.energy) - start == pytest.approx(simulation.work, abs=1e-5)
