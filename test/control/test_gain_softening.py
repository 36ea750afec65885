# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Gains are scaled down for large errors, so that no arm diverges under the rate limit."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.control_law import Gains, make_gains
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.effort_limiter import EffortLimiter, EffortLimits
from robot_dynamics.control.gain_softening import crossover_frequency, gain_scale
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
PERIOD = 0.002
SECOND = 1_000_000_000
RATE = 1000.0
EFFORTS = st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3)


@settings(deadline=None, derandomize=True)
@given(proportional=EFFORTS, damping=EFFORTS, rate=st.floats(1e-3, 1e5))
def test_the_scale_is_the_largest_within_the_rate_limit(
    proportional: list[float], damping: list[float], rate: float,
) -> None:
    P, D = np.array(proportional), np.array(damping)
    s = gain_scale(P, D, rate)

    def change(scale: float) -> float:
        return float(scale * np.abs(scale * scale * P + scale * D).max())

    assert 0.0 <= s <= 1.0
    assert change(s) <= rate * (1.0 + 1e-9)
    assert s == 1.0 or change(s + 1e-8) > rate * (1.0 - 1e-3) - 1e-6


def test_the_crossover_is_a_bound_of_that_of_each_joint() -> None:
    for kp, kd in ((400.0, 40.0), (100.0, 3.0), (0.0, 5.0), (25.0, 0.0)):
        omega = crossover_frequency(Gains(np.array([kp]), np.array([kd])))
        assert abs(complex(kp, kd * omega)) / omega**2 <= 1.0
    assert crossover_frequency(make_gains(['a'], kp=[0.0], kd=[0.0])) == 0.0


def final_error(
    goal: list[float], duration: float, rate: float = RATE, gains_know_of_it: bool = True,
    frequency: float = 20.0, seconds: float = 4.0,
) -> float:
    """Return the final distance [rad] of the arm from its goal; infinite if the arm diverged."""
    plant = ArmDynamics(ARM)
    controller = Controller(ARM, ControllerOptions(
        make_gains(NAMES, [frequency]), effort_rate=rate, softens_gains=gains_know_of_it))
    free = np.full(2, np.inf)
    guard = EffortLimiter(EffortLimits(-free, free, free, 0.0, rate))
    q, v, now = np.zeros(2), np.zeros(2), 1000 * SECOND
    controller.update(now, q, v)
    controller.follow(make_trajectory(NAMES, (duration,), [goal], (), (), NAMES), 0)
    acts = controller.update(now, q, v).hold
    for _ in range(round(seconds / PERIOD)):
        now += round(1e9 * PERIOD)
        output = controller.update(now, q, v)
        assert output.command is not None
        effort = guard.apply(output.command, output.hold, q, v, PERIOD).effort
        for _ in range(2):  # the effort for the previous state acts
            v = v + 0.5 * PERIOD * plant.forward_dynamics(q, v, acts)
            q = q + 0.5 * PERIOD * v
        acts = effort
        if np.abs(q).max() > 20.0:
            return math.inf
    return float(np.abs(q - goal).max())


@pytest.mark.parametrize(('goal', 'duration', 'options'), [
    ([1.0, 0.5], 2.0, {}),
    ([1.0, 0.5], 0.01, {}),
    ([3.0, -2.0], 0.01, {}),
    ([1.0, 0.5], 2.0, {'rate': 300.0}),
    ([2.0, 1.0], 0.5, {'frequency': 60.0}),
])
def test_an_arm_arrives_at_any_set_point(
    goal: list[float], duration: float, options: dict[str, float],
) -> None:
    """One point without velocities: the reference is a line, and its velocity has a step."""
    assert final_error(goal, duration, **options) < 1e-3  # type: ignore[arg-type]


def test_gains_that_do_not_know_of_the_rate_let_it_diverge() -> None:
    assert final_error([1.0, 0.5], 0.01, gains_know_of_it=False) > 1.0


def test_small_errors_are_fed_back_in_full_and_computed_torque_is_always_the_formula() -> None:
    gains = make_gains(NAMES)
    limited = Controller(ARM, ControllerOptions(gains, effort_rate=RATE, softens_gains=True))
    free = Controller(ARM, ControllerOptions(gains))
    for error, softer in ((1e-3, False), (0.5, True)):
        outputs = []
        for one in (limited, free):
            one.forget_reference()
            for k in range(20):  # then the rate of the states is known
                one.update(SECOND + 2_000_000 * k, np.zeros(2), np.zeros(2))
            one.follow(make_trajectory(
                NAMES, (0.001,), [[error, error]], [[0.0, 0.0]], [[0.0, 0.0]], NAMES), 0)
            outputs.append(one.update(SECOND + 40_000_000, np.zeros(2), np.zeros(2)))
        ours, theirs = outputs
        assert ours.computed_torque is not None
        assert theirs.computed_torque is not None
        assert ours.computed_torque.tolist() == theirs.computed_torque.tolist()
        assert (ours.gain_scale < 1.0) == softer
        assert (ours.command.tolist() != theirs.command.tolist()) == softer  # type: ignore
        limited, free = (
            Controller(ARM, ControllerOptions(gains, effort_rate=RATE, softens_gains=softens))
            for softens in (True, False))


@pytest.mark.filterwarnings('error')
def test_without_gains_nothing_is_softened() -> None:
    gains = make_gains(NAMES, kp=[0.0], kd=[0.0])
    one = Controller(ARM, ControllerOptions(gains, effort_rate=RATE, softens_gains=True))
    one.update(SECOND, np.zeros(2), np.zeros(2))
    one.follow(make_trajectory(
        NAMES, (0.001,), [[2.0, 2.0]], [[0.0, 0.0]], [[0.0, 0.0]], NAMES), 0)
    output = one.update(SECOND + 2_000_000, np.zeros(2), np.zeros(2))
    assert output.gain_scale == 1.0
    assert output.command is not None
    assert output.computed_torque is not None
    assert output.command.tolist() == output.computed_torque.tolist()


def test_slow_gains_are_softened_for_large_errors_too() -> None:
    """A crossover below 1 rad/s."""
    gains = make_gains(NAMES, [0.2])
    assert crossover_frequency(gains) < 1.0
    one = Controller(ARM, ControllerOptions(gains, effort_rate=0.1, softens_gains=True))
    for k in range(20):
        one.update(SECOND + 2_000_000 * k, np.zeros(2), np.zeros(2))
    one.follow(make_trajectory(
        NAMES, (0.001,), [[2.0, 2.0]], [[0.0, 0.0]], [[0.0, 0.0]], NAMES), 0)
    output = one.update(SECOND + 40_000_000, np.zeros(2), np.zeros(2))
    assert output.gain_scale < one.bandwidth_scale
