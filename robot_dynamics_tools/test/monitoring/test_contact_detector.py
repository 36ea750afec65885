# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The detector of contacts: their end, and the delay until one is found."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from robot_dynamics.model import ArmDynamics
from robot_dynamics.monitoring.contact_levels import ContactLevels
from robot_dynamics.monitoring.external_effort import ExternalEffort
from robot_dynamics_tools.monitoring.contact_detector import ContactDetector
from robots import arm_without_gripper

ARMS = {name: arm_without_gripper(name) for name in ('default', 'ur10', 'panda')}


def test_a_contact_ends_after_half_a_second_below_its_level():
    detector = ContactDetector(ContactLevels(np.ones(1), np.zeros(1)), ('a',))
    contacts = [detector.update(0.01, np.zeros(1), np.array([2.0 * (k in (5, 54, 103, 154))]))
                for k in range(160)]
    assert [k for k, contact in enumerate(contacts) if contact] == [5, 154]


# ------------------------------------------------------------------------------ the delay

def detection_delay(level: float, effort: float, bandwidth: float) -> float:
    """Return the delay [s] until a constant effort is found: −ln(1 − θ / τ) / (2π bandwidth)."""
    ratio = level / abs(effort)
    return -math.log1p(-ratio) / (2.0 * math.pi * bandwidth) if ratio < 1.0 else math.inf


@settings(max_examples=25)
@given(st.sampled_from([*ARMS]), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.0, 0.1, 0.5]),
       st.booleans(), st.floats(50.0, 1000.0), st.floats(1.0, 50.0), st.floats(1.02, 50.0))
def test_a_constant_effort_is_found_within_the_delay(
    name, seed, noise, moves, rate, bandwidth, ratio,
):
    """
    For any motion and noise, with the largest error e against the effort: θ + e instead of θ.

    An exact model at rest without noise has no error, and the delay is that of the formula.
    """
    model, rng, dt = ARMS[name], np.random.default_rng(seed), 1.0 / rate
    n, dynamics = model.joint_count, ArmDynamics(model)
    q0, amplitude, omega = rng.normal(size=(3, n))
    j, theta = int(rng.integers(n)), float(rng.uniform(0.1, 20.0))
    tau = np.zeros(n)
    tau[j] = rng.choice([-1.0, 1.0]) * ratio * theta
    a, b = np.zeros((2, n))
    a[j] = theta
    detector = ContactDetector(ContactLevels(a, b), model.joint_names)
    observers = ExternalEffort(dynamics, bandwidth), ExternalEffort(dynamics, bandwidth)
    worst = 0.0
    for k in range(-20, 10_000):
        phase = omega * k * dt
        q = q0 + moves * amplitude * np.sin(phase)
        v = moves * amplitude * omega * np.cos(phase)
        measured = dynamics.inverse_dynamics(q, v, -moves * amplitude * omega**2 * np.sin(phase))
        measured += noise * theta * rng.normal(size=n)
        free, r = (observer.update(dt, q, v, measured - (k > 0) * effort)
                   for observer, effort in zip(observers, (np.zeros(n), tau)))
        if k <= 0:
            continue
        worst = max(worst, -np.sign(tau[j]) * free[j])
        if detector.update(dt, v, r) is not None:
            break
        if worst > abs(tau[j]) - theta:
            return  # the error hides the effort
    else:
        raise AssertionError('not found')
    delay = detection_delay(theta + worst, tau[j], bandwidth)
    assert k * dt <= delay + dt + 1e-9
    if not moves and not noise:
        assert worst < 1e-9
        assert k * dt >= delay - 1e-9
