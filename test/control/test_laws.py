# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The terms of each control law sum to the effort, and each is stable in closed loop with a delay.

The laws are those of this package, those of the entry points that are installed, and the spring of
docs/examples/spring.py. In closed loop all run with the default parameters of `dynamics`, except
that references are not conditioned: a set-point is then a disturbance.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from controller_bench import update
from lock_step_loop import LockStep
from loop_motions import arm_named
import numpy as np
from page_law import install_page_law, page_law
import pytest
from robot_dynamics.control.controller import Controller
from robot_dynamics.control.laws import control_law, law_table
from robot_dynamics.control.laws.control_law import ControlLaw
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Gains, make_gains
from robot_dynamics.control.laws.law_table import all_laws
from robot_dynamics.control.loop import ControlLoop
from robot_dynamics.control.options import ControllerOptions
from robot_dynamics.exceptions import InvalidInputError, TrajectoryError
from robot_dynamics.joints.effort_convention import make_effort_convention
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory
from robots import robot_urdf

MS = 1_000_000
START = 1_790_000_000_000 * MS
STATES = 40


SPRING = page_law()
ALL = {**law_table.LAWS, 'spring': SPRING}
UR5 = load_arm(robot_urdf('ur5'))
N, Q = 6, np.full(6, 0.4)
FOLLOWS = {name: name not in ('gravity_compensation', 'hand_guiding') for name in ALL}


@pytest.fixture(autouse=True)
def _with_the_law_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(law_table.LAWS, 'spring', SPRING)


@pytest.fixture(scope='module', params=['ur5', 'panda'])
def arm(request: pytest.FixtureRequest) -> ArmModel:
    """Return an arm with friction and a load."""
    model = load_arm(robot_urdf(request.param))
    n = model.joint_count
    return model.with_friction(make_friction(
        model.joint_names, viscous=[1.5] * n, coulomb=[2.0] * n, static=[2.5] * n))


def make(arm: ArmModel, name: str, **options: object) -> Controller:
    gains = Gains(np.full(arm.joint_count, 300.0), np.full(arm.joint_count, 25.0))
    return Controller(arm, ControllerOptions(
        gains, command=name, **options))  # type: ignore[arg-type]


def hold(q: np.ndarray) -> JointTrajectory:
    return make_trajectory(UR5.joint_names, [0.0], [q])


def follow(one: Controller, arm: ArmModel, with_reference: bool) -> None:
    """Answer states along a noisy motion; check that the terms sum to the command."""
    rng, n = np.random.default_rng(3), arm.joint_count
    middle = 0.5 * (np.clip(arm.limits.lower, -3.0, 3.0) + np.clip(arm.limits.upper, -3.0, 3.0))
    q = middle + rng.uniform(-0.3, 0.3, n)
    update(one, START, q, np.zeros(n))
    if with_reference:
        one.follow(make_trajectory(arm.joint_names, [1.0], [q + 0.1]), 0)
    unlimited = 0
    for k in range(1, STATES):
        q = q + rng.normal(scale=1e-3, size=n)
        output = update(one, START + 5 * k * MS, q, rng.normal(scale=0.2, size=n))
        terms, command = output.terms, output.command
        parts = (terms.inertial + terms.coriolis + terms.gravity + terms.friction + terms.external)
        scale = 1e-9 * (1.0 + np.abs(parts).max())
        assert parts == pytest.approx(terms.effort, abs=scale)
        free = np.ones(n, dtype=bool) if output.clamped is None else ~output.clamped
        assert terms.effort[free] == pytest.approx(command[free], abs=scale)
        unlimited += int(free.all())
    assert unlimited > STATES // 2


@pytest.mark.parametrize('name', ALL)
@pytest.mark.parametrize(
    'robot_compensates', [(), ('gravity',), ('gravity', 'friction')], ids=str)
def test_the_terms_sum_to_the_command(arm, name, robot_compensates):
    convention = make_effort_convention('joint_torque', robot_compensates, False)
    one = make(arm, name, effort_convention=convention, scales_gains=True, effort_rate=500.0)
    load = make_payload(arm.link_names[-1], 1.0, (0.0, 0.0, 0.05))
    one.set_payloads([load], 0.0, lambda _: None)
    follow(one, arm, with_reference=FOLLOWS[name])


class Lifting(control_law.ControlLaw):
    """A law without references: g(q) and 1 N·m."""

    follows = False

    def effort(self, state: control_law.LawInput) -> np.ndarray:
        return np.asarray(state.gravity + 1.0)


def test_a_law_that_does_not_follow_acts_until_a_stop(monkeypatch):
    """Computed torque follows the stop."""
    monkeypatch.setitem(law_table.LAWS, 'lifting', Lifting)
    one, q = make(UR5, 'lifting'), Q
    output = update(one, START, q, np.full(N, 0.1))
    assert output.command == pytest.approx(output.gravity_compensation + 1.0)
    update(one, START + MS, q, np.full(N, 0.1))
    one.stop()
    output = update(one, START + 2 * MS, q, np.full(N, 0.1))
    assert np.abs(output.computed_torque - output.gravity_compensation - 1.0).min() > 0.01


def test_the_input_of_a_law_has_the_errors():
    seen = []

    class Curious(control_law.GravityCompensation):
        follows = True

        def __call__(self, state: control_law.LawInput) -> control_law.LawOutput:
            seen.append(state)
            return super().__call__(state)

    options = ControllerOptions(make_gains(UR5.joint_names), following_error=np.full(N, 0.1))
    law = Curious(ErrorFeedback(options.gains, UR5.joint_kinds), options)
    one, q, v = Controller(UR5, options, law), Q, np.full(N, 0.2)
    update(one, START, q, v)
    one.follow(hold(q), 0)
    update(one, START + MS, q + 0.05, v)
    update(one, START + 2 * MS, q + 0.15, v)
    near, _ = seen
    assert near.position_error == pytest.approx(np.full(N, -0.05))
    assert near.velocity_error == pytest.approx(-v)
    assert near.gravity.tolist() == ArmDynamics(UR5).rigid_body.gravity(q + 0.05).tolist()
    with pytest.raises(ValueError, match='a reference'):
        _ = near._replace(trajectory=None).position_error


@pytest.fixture
def _user_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Install a package with the law of the page, and two entry points that cannot be loaded."""
    install_page_law(tmp_path, (
        'broken = user_package.broken:law\nabsent = user_package.absent:law\n'
        'computed_torque = user_package.spring:Spring\n'))
    (tmp_path / 'user_package' / 'broken.py').write_text('raise RuntimeError("no gripper")')
    monkeypatch.syspath_prepend(tmp_path)
    law_table.further_laws.cache_clear()
    yield
    law_table.further_laws.cache_clear()


@pytest.mark.usefixtures('_user_package')
def test_a_law_of_another_package_is_a_command():
    assert law_table.command_modes()[-4:] == ('absent', 'broken', 'own_spring', 'none')
    one, q = make(UR5, 'own_spring'), Q
    assert one.laws.follows
    update(one, START, q, 0.0 * q)
    one.follow(hold(q + 0.02), 0)
    gravity = ArmDynamics(UR5).rigid_body.gravity(q)
    assert update(one, START + MS, q, 0.0 * q).command == pytest.approx(gravity + 200.0 * 0.02)
    names = [parameter.name for parameter in law_table.declared('PARAMETERS')]
    assert names.count('spring.stiffness') == names.count('impedance.stiffness') == 1
    assert 'broken' not in law_table.all_laws()


@pytest.mark.usefixtures('_user_package')
def test_an_entry_point_does_not_replace_a_law_of_this_package():
    assert law_table.command_modes().count('computed_torque') == 1
    one, q = make(UR5, 'computed_torque'), Q
    update(one, START, q, 0.0 * q)
    one.follow(hold(q + 1e-4), 0)
    dynamics = ArmDynamics(UR5)
    assert update(one, START + MS, q, 0.0 * q).command == pytest.approx(
        dynamics.inverse_dynamics(q, 0.0 * q, np.full(N, 300.0 * 1e-4)))


@pytest.mark.usefixtures('_user_package')
@pytest.mark.parametrize(('name', 'words'), [
    ('broken', "command is 'broken', but the control law of that entry point cannot be loaded: "
     "RuntimeError.*no gripper"),
    ('absent', 'cannot be loaded: ModuleNotFoundError.*user_package.absent'),
    ('impedanze', "command is 'impedanze', expected one of .*joint_impedance"),
])
def test_a_law_that_cannot_be_used_is_refused_and_the_last_one_continues(name, words):
    one, q = make(UR5, 'gravity_compensation'), Q
    with pytest.raises(InvalidInputError, match=words):
        one.set_options(ControllerOptions(make_gains(UR5.joint_names), command=name))
    assert one.options.command == 'gravity_compensation'
    assert update(one, START, q, 0.0 * q).command is not None
    with pytest.raises(InvalidInputError, match=words):
        make(UR5, name)


def test_a_given_law_is_used_for_any_command_but_none():
    q, options = Q, ControllerOptions(make_gains(UR5.joint_names))
    one = Controller(UR5, options, Lifting())
    assert not one.laws.follows
    output = update(one, START, q, 0.0 * q)
    assert output.command == pytest.approx(output.gravity_compensation + 1.0)
    one.set_options(ControllerOptions(options.gains, command='none'))
    assert update(one, START + MS, q, 0.0 * q).command is None


@pytest.mark.parametrize('name', [name for name, follows in FOLLOWS.items() if not follows])
def test_a_law_that_does_not_follow_refuses_references(name):
    one, q = make(UR5, name), np.zeros(N)
    update(one, START, q, q)
    with pytest.raises(
            TrajectoryError, match=f"command is {name!r}, expected '.*' or 'computed_torque' or "):
        one.follow(hold(q), 0)


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('cartesian.translation_stiffness', -1.0, ''),
    ('cartesian.translation_stiffness', [1.0, 2.0], ''),
    ('cartesian.translation_stiffness', float('nan'), ''),
    ('cartesian.rotation_stiffness', -2.0, ''), ('cartesian.force_limit', -1.0, ''),
    ('cartesian.torque_limit', float('inf'), ''), ('cartesian.frame', 'no_link', ''),
    ('impedance.stiffness', [1.0, 2.0, 3.0], ''), ('impedance.stiffness', -1.0, ''),
    ('impedance.stiffness', [float('nan')], ''),
    ('hand_guiding.speed', [1.0, 2.0, 3.0], ' has 3 values'),
    ('hand_guiding.speed', -0.1, " of 'joint1' is -0.1")])
def test_a_wrong_option_of_a_law_is_named(name, value, words):
    law = {'cartesian': 'cartesian_impedance', 'impedance': 'joint_impedance'}
    with pytest.raises(InvalidInputError, match=f'{name}{words}'):
        ControlLoop.of_arm(
            arm_named('default'), command=law.get(name.partition('.')[0], 'hand_guiding'),
            parameters={name: value})


def test_gravity_compensation_is_the_gravity_torque_alone():
    """Friction is no term of it, not even its offset."""
    arm = UR5.with_friction(make_friction(UR5.joint_names, coulomb=3.0, offset=3.0))
    gravity = ArmDynamics(arm).rigid_body.gravity(Q)
    output = update(make(arm, 'gravity_compensation'), START, Q, 0.0 * Q)
    assert output.command.tolist() == gravity.tolist()
    assert output.terms.gravity.tolist() == gravity.tolist()
    assert output.terms.friction.tolist() == [0.0] * N


REGISTERED: Mapping[str, type[ControlLaw]] = {**all_laws(), 'spring': SPRING}
AT_REST = 1e-3
"""[rad/s]"""
DISTURBANCE = 0.02
"""[rad]"""

grid = pytest.mark.parametrize(('arm_name', 'rate'), [
    ('panda', 100.0), pytest.param('ur5', 500.0, marks=pytest.mark.soak),
    pytest.param('panda', 1000.0, marks=pytest.mark.soak)])


@grid
@pytest.mark.parametrize('name', REGISTERED)
def test_a_registered_law_comes_to_rest(arm_name, rate, name, monkeypatch):
    """
    From rest, in spite of a step of the reference of all joints and a delay of one period or more.

    The spring is far too stiff for the wrists, which creep to their reference.
    """
    monkeypatch.setitem(law_table.LAWS, name, REGISTERED[name])
    one = LockStep(
        arm_named(arm_name), rate=rate, delay=round(1e3 / rate), conditions_references=False,
        command=name)
    rng = np.random.default_rng(0)
    one.sensor = lambda q, v: tuple(x + rng.normal(0.0, 1e-7, len(x)) for x in (q, v))
    assert one.run(0.5).speed.max() < AT_REST
    if one.loop.controller.laws.follows:
        size = DISTURBANCE if name in ALL and name != 'spring' else 1e-3
        one.follow(one.q + size * np.where(np.arange(len(one.q)) % 2, 1.0, -1.0))
    assert one.run(3.0).last(0.5).speed.max() < AT_REST
    assert one.loop.supervisor.fault is None


@pytest.mark.parametrize('scales', [True, False])
def test_the_scale_of_the_gains_makes_the_difference(scales):
    """Without it the spring shakes a UR5 that starts at rest."""
    one = LockStep(
        arm_named('ur5'), rate=100.0, delay=10, scales_gains=scales, command='spring',
        parameters={'spring.stiffness': 400.0, 'spring.damping': 40.0})
    one.v = np.full(6, 1e-4)
    speed = one.run(3.0).speed.max()
    assert (speed < AT_REST) if scales else (speed > 1.0)
