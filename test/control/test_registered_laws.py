# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Every registered control law is stable in closed loop, without friction and with a delay.

The laws are those of this package, those of the entry points that are installed, and the spring of
docs/examples/spring.py. All run with the default parameters of
`dynamics`, except that references are not conditioned: a set-point is then a disturbance.
"""

from collections.abc import Mapping

from lock_step_loop import LockStep, Trace
from loop_motions import arm_named
import numpy as np
from page_law import page_law
import pytest
from robot_dynamics.control.laws.control_law import ControlLaw
from robot_dynamics.control.laws.law_table import all_laws, LAWS

REGISTERED: Mapping[str, type[ControlLaw]] = {**all_laws(), 'spring': page_law()}
AT_REST = 1e-3
"""[rad/s]"""
DISTURBANCE = 0.02
"""[rad]"""

grid = pytest.mark.parametrize(('arm_name', 'rate'), [
    ('panda', 100.0), pytest.param('ur5', 500.0, marks=pytest.mark.soak),
    pytest.param('panda', 1000.0, marks=pytest.mark.soak)])


def disturbed(one: LockStep, size: float, seconds: float) -> Trace:
    """Start at rest; then move the reference of all joints by `size` [rad] in one step."""
    rng = np.random.default_rng(0)
    one.sensor = lambda q, v: tuple(x + rng.normal(0.0, 1e-7, len(x)) for x in (q, v))
    trace = one.run(0.5)
    assert trace.speed.max() < AT_REST
    if one.loop.controller.laws.follows:
        one.follow(one.q + size * np.where(np.arange(len(one.q)) % 2, 1.0, -1.0))
    return one.run(seconds)


def run(arm_name: str, rate: float, size: float, seconds: float, **options: object) -> Trace:
    """Return the motion with a delay of one period and more, in ms."""
    one = LockStep(
        arm_named(arm_name), rate=rate, delay=round(1e3 / rate),
        conditions_references=False, **options)
    trace = disturbed(one, size, seconds)
    assert one.loop.supervisor.fault is None
    return trace


@grid
@pytest.mark.parametrize('name', REGISTERED)
def test_a_registered_law_comes_to_rest(arm_name, rate, name, monkeypatch):
    """The spring is far too stiff for the wrists, which creep to their reference."""
    size = DISTURBANCE if name in LAWS else 1e-3
    monkeypatch.setitem(LAWS, name, REGISTERED[name])
    assert run(arm_name, rate, size, 3.0, command=name).last(0.5).speed.max() < AT_REST


@pytest.mark.parametrize('scales', [True, False])
def test_the_scale_of_the_gains_makes_the_difference(scales, monkeypatch):
    """Without it the spring shakes a UR5 that starts at rest."""
    monkeypatch.setitem(LAWS, 'spring', page_law())
    one = LockStep(
        arm_named('ur5'), rate=100.0, delay=10, scales_gains=scales, command='spring',
        parameters={'spring.stiffness': 400.0, 'spring.damping': 40.0})
    one.v = np.full(6, 1e-4)
    speed = one.run(3.0).speed.max()
    assert (speed < AT_REST) if scales else (speed > 1.0)
