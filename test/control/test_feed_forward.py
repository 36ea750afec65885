# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The commands to drives: the efforts of the reference alone, in motion, at rest and in faults."""

from hypothesis import given, settings
from hypothesis import strategies as st
from lock_step_loop import FIRST_STAMP, MS, smooth_arm
import numpy as np
import pinocchio
import pytest
from robot_dynamics.control.feed_forward import DriveCommand, FeedForward
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.joints.effort_convention import make_effort_convention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

Q = np.array([0.8, 0.5])
SLIDES = 0.1
"""[rad/s] above which dry friction has its full value."""
COULOMB, VISCOUS = np.array([2.0, 1.0]), np.array([1.5, 0.5])


def rubbing() -> ArmModel:
    arm = smooth_arm('default')
    return arm.with_friction(make_friction(
        arm.joint_names, coulomb=COULOMB.tolist(), viscous=VISCOUS.tolist()))


class Bench:
    """A loop at 500 Hz whose arm is where the test says."""

    def __init__(self, arm: ArmModel, **options: object) -> None:
        self.loop = ControlLoop.of_arm(arm, **options)
        self.feed_forward, self.k = FeedForward(self.loop), 0

    def take(self, q: np.ndarray, v: np.ndarray | None = None) -> DriveCommand | None:
        """Return the command for the next state."""
        self.k += 1
        v = np.zeros_like(q) if v is None else v
        answer = self.loop.answer(FIRST_STAMP + 2 * self.k * MS, q, v)
        return self.feed_forward.command(answer)

    def track(self, states: int, noise: float = 0.0) -> list[DriveCommand]:
        """Let the arm follow its reference, with an error of this size [rad]."""
        found, rng = [], np.random.default_rng(1)
        for _ in range(states):
            stamp = FIRST_STAMP + 2 * (self.k + 1) * MS
            q, v, _ = self.loop.controller.trajectory.sample(stamp)
            command = self.take(q + rng.uniform(-noise, noise, len(q)), v)
            found.append(command)
        return found

    def move(self, goal: np.ndarray, duration: float) -> None:
        self.loop.follow(make_trajectory(
            self.loop.controller.arm.joint_names, [0.5 * duration, duration],
            [0.5 * (Q + goal), goal], [1.5 * (goal - Q) / duration, 0.0 * goal]))


def moving(arm: ArmModel, **options: object) -> Bench:
    """Return a loop that begins a motion of all joints."""
    bench = Bench(arm, **options)
    bench.take(Q)
    bench.take(Q)
    bench.move(Q + 0.6, 1.0)
    return bench


@pytest.mark.parametrize('friction', ['reference', 'none'])
def test_the_effort_is_that_of_the_reference_whatever_is_measured(friction):
    """The oracle is Pinocchio's model, with q̈_r by differences of the velocity."""
    arm = rubbing()
    found, noisy = (moving(arm, friction_compensation=friction).track(450, noise)
                    for noise in (0.0, 1e-3))
    assert all(np.array_equal(one, other) for one, other in zip(found, noisy))
    model = arm.pinocchio_model
    data = model.createData()
    for before, now, after in zip(found[50:], found[51:], found[52:]):
        q, v, effort = now
        assert (v > 0.0).all()
        a = (after.velocity - before.velocity) / 0.004
        expected = pinocchio.crba(model, data, q) @ a + pinocchio.nonLinearEffects(
            model, data, q, v)
        if friction == 'reference':
            expected = expected + VISCOUS * v + COULOMB
        is_sliding = (v > SLIDES) | (friction == 'none')
        assert effort[is_sliding] == pytest.approx(expected[is_sliding], abs=0.5)


def test_there_is_no_command_without_a_law_or_when_the_node_is_inactive():
    bench = Bench(rubbing())
    assert bench.take(Q) is not None
    bench.loop.deactivate(1e-9 * FIRST_STAMP)
    for _ in range(2000):  # it stops, holds and ramps the effort of other drives
        last = bench.take(Q)
    assert last is None
    assert Bench(rubbing(), command='none').take(Q) is None


def test_gravity_compensation_lets_the_drives_damp_only():
    """Where the arm is, its drives have no position error, and the effort of gravity."""
    bench, arm = Bench(rubbing(), command='gravity_compensation'), rubbing()
    data = arm.pinocchio_model.createData()
    for k in range(50):
        q = Q + 0.01 * k
        command = bench.take(q, np.full(2, 5.0))
        assert command.position == pytest.approx(q)
        assert not command.velocity.any()
        assert command.effort == pytest.approx(
            pinocchio.computeGeneralizedGravity(arm.pinocchio_model, data, q))


def test_a_fault_holds_the_position_at_which_it_began():
    bench = moving(rubbing())
    bench.track(200)
    bench.loop.end(bench.loop._steady, Ending.by(Fault('external_effort', 'a test', recovery=100)))
    here = bench.loop.controller.state[1] + 1e-4
    found = [bench.take(here + 1e-4 * k) for k in range(50)]
    for command in found:
        assert command.position == pytest.approx(here)
        assert not command.velocity.any()


def test_what_the_robot_compensates_is_not_commanded():
    arm = rubbing()
    convention = make_effort_convention('joint_torque', ('gravity', 'friction'), False)
    plain, other = (
        moving(arm, friction_compensation='none'), moving(arm, effort_convention=convention))
    model = arm.pinocchio_model
    data = model.createData()
    for one, less in zip(plain.track(100), other.track(100)):
        gravity = pinocchio.computeGeneralizedGravity(model, data, one.position)
        assert less.effort == pytest.approx(one.effort - gravity, abs=1e-9)


numbers = st.floats(-50.0, 50.0)


@settings(max_examples=50)
@given(st.lists(st.tuples(numbers, numbers, st.floats(0.0, 500.0)), min_size=1, max_size=7))
def test_the_offset_is_the_effort_of_the_drive_within_the_position_limits(joints):
    position, effort, stiffness = map(np.array, zip(*joints))
    upper = np.full(len(position), 2.0)
    found = DriveCommand(position, position, effort).position_offset(stiffness, -upper, upper)
    for q, k, tau, command in zip(position, stiffness, effort, found):
        if k > 0.0 and abs(command) < 2.0 and command != q:
            assert k * (command - q) == pytest.approx(tau, rel=1e-6, abs=1e-9)
        assert min(q, -2.0) <= command <= max(q, 2.0)
        assert k > 0.0 or command == q or abs(q) > 2.0
