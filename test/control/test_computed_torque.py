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

"""Computed torque along several segments, for many joints, and without friction of the robot."""

import numpy as np
import pytest
from robot_dynamics.control import computed_torque
from robot_dynamics.control.computed_torque import ComputedTorque
from robot_dynamics.control.control_law import ErrorFeedback, make_gains
from robot_dynamics.control.control_output import ControlOutput
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws import LawInput
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, UncheckedArmDynamics
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.follower import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.trajectories.joint_trajectory import make_trajectory

ARM = load_arm(default_arm_urdf())
NAMES = ARM.joint_names
GAINS = make_gains(NAMES)
MS = 1_000_000
START = 1_790_000_000_000 * MS
POINTS = [[0.05, -0.03], [-0.02, 0.06], [0.1, 0.05]]
VELOCITIES = [[0.2, -0.1], [0.1, 0.3], [0.0, 0.0]]


def along_a_path(arm: ArmModel = ARM, **options: object) -> list[ControlOutput]:
    """Return the answers at rest to a trajectory of three segments, at 200 Hz."""
    one = Controller(arm, ControllerOptions(GAINS, **options))  # type: ignore[arg-type]
    zero = np.zeros(2)
    for k in range(1, 21):  # then the rate of the states is known
        one.update(START + 5 * (k - 20) * MS, zero, zero)
    one.follow(make_trajectory(NAMES, (0.3, 0.6, 0.9), POINTS, VELOCITIES, (), NAMES), START)
    return [one.update(START + 5 * k * MS, zero, zero) for k in range(1, 200)]


def test_each_segment_of_a_path_is_followed() -> None:
    dynamics, zero = ArmDynamics(ARM), np.zeros(2)
    for output in along_a_path():
        reference = output.reference
        assert reference is not None
        a = reference.acceleration + GAINS.kd * reference.velocity + GAINS.kp * reference.position
        assert output.computed_torque == pytest.approx(dynamics.inverse_dynamics(zero, zero, a))


def test_the_computation_with_arrays_gives_the_same_commands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Arms of many joints are computed with arrays; gains are softened at the same errors."""
    options = {'softens_gains': True, 'effort_rate': 3000.0}
    few = along_a_path(**options)
    monkeypatch.setattr(computed_torque, 'FEW', 0)
    many = along_a_path(**options)
    for one, other in zip(few, many):
        assert one.command == pytest.approx(other.command, rel=1e-9)
        assert one.gain_scale == pytest.approx(other.gain_scale)
    softened = [output.gain_scale < 1.0 for output in many]
    assert 40 < sum(softened) < 180


@pytest.mark.parametrize('compensates', [(), ('friction',)])
def test_friction_that_the_robot_compensates_is_not_commanded(
    compensates: tuple[str, ...],
) -> None:
    rubbing = ARM.with_friction(make_friction(NAMES, viscous=[3.0], coulomb=[2.0]))
    commands = along_a_path(rubbing, semantics=EffortConvention(robot_compensates=compensates))
    bare = along_a_path(ARM)
    differences = [
        np.abs(np.subtract(one.command, other.command)).max()  # type: ignore[arg-type]
        for one, other in zip(commands, bare)]
    assert max(differences) < 1e-9 if compensates else max(differences) > 4.0


@pytest.mark.parametrize(('period', 'is_slow'), [(0.05, True), (0.002, False)])
def test_at_slow_rates_bandwidth_and_position_are_those_of_the_delay(
    period: float, is_slow: bool,
) -> None:
    """M, C and g are those of the position half a period ahead, but not at fast rates."""
    one = Controller(ARM, ControllerOptions(GAINS, softens_gains=True))
    q, v = np.array([0.8, 0.5]), np.array([0.4, -0.3])
    for k in range(20):
        one.update(START + round(1e9 * period) * k, q, v)
    one.follow(make_trajectory(NAMES, (0.0,), [[1.0, 0.4]], (), (), NAMES), 0)
    output = one.update(START + round(1e9 * period) * 20, q, v)
    s = one.bandwidth_scale
    assert output.gain_scale == s
    assert (s < 0.5) if is_slow else (s == 1.0)
    a = s * GAINS.kd * -v + s**2 * GAINS.kp * ([1.0, 0.4] - q)
    q_ahead = q + 0.5 * period * v if is_slow else q
    assert output.computed_torque == pytest.approx(
        ArmDynamics(ARM).inverse_dynamics(q_ahead, v, a))


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_gains_near_zero_are_never_softened() -> None:
    gains = make_gains(NAMES, kp=[0.0, 0.0], kd=[5e-324, 1e-310])
    law = ComputedTorque(ErrorFeedback(gains, ARM.joint_kinds), ControllerOptions(gains))
    law.limit_rate(np.array([1e3, 1e9]), np.array([1.0, 1e-13]))
    assert np.isinf(law._prompt_feedback)


def test_the_law_itself_needs_a_reference_and_a_velocity() -> None:
    law = ComputedTorque(ErrorFeedback(GAINS, ARM.joint_kinds), ControllerOptions(GAINS))
    zero = np.zeros(2)
    active = ActiveTrajectory(
        make_trajectory(NAMES, (0.3,), POINTS[:1], (), (), NAMES), START, START,
        Reference(zero, zero, zero))
    dynamics = UncheckedArmDynamics(ARM)
    for v, reference in ((None, active), (zero, None)):
        with pytest.raises(ValueError, match='needs a reference and a velocity'):
            law(LawInput(dynamics, START, zero, v, zero, zero, reference))
    output = law(LawInput(dynamics, START, zero, zero, zero, zero, active))
    with pytest.raises(ValueError, match='read-only'):
        output.friction[0] = 1.0  # the next outputs share it
