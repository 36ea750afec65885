# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Contact levels: the promised rate of false alarms, also from a recording without contact."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from arm_motions import moves_with_pauses
import numpy as np
import pytest
from recordings import encoded, START_NS, write_recording
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.joints.friction_terms import smooth_sign
from robot_dynamics.joints.presliding import presliding_state
from robot_dynamics.model import ArmDynamics, ArmModel, load_arm, RigidBody
from robot_dynamics.model.arm_parameters import read_parameter_file
from robot_dynamics.monitoring.contact_levels import ContactLevels
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.analysis.contact_learning import learn_contact_levels
from robot_dynamics_tools.commands.learn_contact_levels import main
from robot_dynamics_tools.monitoring.contact_detector import ContactDetector
from scipy import stats
from scipy.signal import lfilter
from wrong_arms import model_arm, true_arm

# --- hours without contact, fast -----------------------------------------------------------------

# The effort of the arm differs from that of the model by masses, friction with presliding, and
# noise. The observer passes this difference through its filter of first order
# (`test_external_effort.py`); that of the rigid bodies, which is smooth, is interpolated.

RATE = 100.0
BANDWIDTH = 10.0
COARSE = 4
"""Samples between two at which the rigid bodies are computed."""
PRESLIDING = 0.002
"""[rad]"""


class Motion(NamedTuple):
    """Minimum-jerk moves with pauses, each (m, n), and the measured effort."""

    q: FloatArray
    v: FloatArray
    a: FloatArray


def random_moves(arm: ArmModel, seconds: float, rng: np.random.Generator) -> Motion:
    """Return moves between random positions, at up to the velocity limits, with pauses."""
    n = arm.joint_count
    lower, upper = (np.clip(each, -2.5, 2.5) for each in (arm.limits.lower, arm.limits.upper))
    speed = np.where(
        np.isfinite(arm.limits.velocity) & (arm.limits.velocity > 0.0), arm.limits.velocity, 2.0)
    pieces, count, at = [], 0, 0.5 * (lower + upper)
    while count < seconds * RATE:
        goal = rng.uniform(0.75 * lower + 0.25 * upper, 0.25 * lower + 0.75 * upper, n)
        moves = rng.uniform(size=n) < 0.7
        d = np.where(moves, goal - at, 0.0)
        T = max(0.5, float((1.875 * np.abs(d) / speed).max()) / rng.uniform(0.2, 0.9))
        s = np.arange(0.0, 1.0, 1.0 / (T * RATE))[:, None]
        piece = [at + d * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
                 d / T * 30.0 * s**2 * (1.0 - s)**2,
                 d / T**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)]
        at = at + d
        rest = np.zeros((int(rng.uniform(0.0, 1.0) * RATE), n))
        pieces.append([np.concatenate(each) for each in zip(piece, (rest + at, rest, rest))])
        count += len(pieces[-1][0])
    return Motion(*(np.concatenate(each)[:round(seconds * RATE)] for each in zip(*pieces)))


def difference(
    model: ArmModel, true: ArmModel, motion: Motion, rng: np.random.Generator,
) -> FloatArray:
    """Return measured effort − effort of the model (m, n), with noise."""
    coarse = [each[::COARSE] for each in motion]
    bodies = [RigidBody(arm).inverse_dynamics_batch(*coarse) for arm in (true, model)]
    k, places = np.arange(len(motion.q)), np.arange(0, len(motion.q), COARSE)
    rigid = np.stack([np.interp(k, places, each) for each in (bodies[0] - bodies[1]).T], axis=1)
    z = presliding_state(motion.q, motion.v, np.full(model.joint_count, PRESLIDING))
    smooth = smooth_sign(motion.v, 0.01)
    friction = true.friction.viscous * motion.v + true.friction.coulomb * z - (
        model.friction.viscous * motion.v + model.friction.coulomb * smooth)
    noise = model.uncertainty.noise(0.5 * RATE, 1.0 / RATE) * rng.normal(size=rigid.shape)
    return np.asarray(rigid + friction + noise)


def filtered(effort: FloatArray) -> FloatArray:
    """Return the estimate of the observer (m, n) of an external effort of −`effort`."""
    fraction = -np.expm1(-2.0 * np.pi * BANDWIDTH / RATE)
    return np.asarray(lfilter([fraction], [1.0, fraction - 1.0], -effort, axis=0))


def alarms(levels: ContactLevels, v: FloatArray, r: FloatArray) -> int:
    """Return the number of contacts, which 0.5 s below the levels end, fast."""
    rows = np.flatnonzero((np.abs(r) > levels.at(v)).any(axis=1))
    return int(np.sum(np.diff(rows) >= 0.5 * RATE - 0.5)) + bool(len(rows))


ARMS = 'default', 'ur10', 'panda'
UNSEEN_ARMS = 'panda', 'kinova', 'ur3', 'ur5', 'talos_left_arm', 'so100'
"""Arms by which the law of the levels was not chosen."""
TEN_MINUTES, HOUR = 600.0, 3600.0
SPREAD = 3.0
"""Largest allowed factor between the false alarms and the promise."""


class Unseen(NamedTuple):
    """Velocity and external effort (m, n) of an arm without contact."""

    v: np.ndarray
    r: np.ndarray


def motion_of(model: ArmModel, arm: ArmModel, seconds: float, seed: int) -> Unseen:
    rng = np.random.default_rng(seed)
    motion = random_moves(model, seconds, rng)
    return Unseen(motion.v, filtered(difference(model, arm, motion, rng)))


def learned(model: ArmModel, seen: Unseen, per_hour: float) -> ContactLevels:
    return learn_contact_levels(
        np.arange(len(seen.v)) / RATE, seen.v, seen.r, model.joint_names, per_hour).levels


class Promise(NamedTuple):
    """A recording's length [s] and the promised rate."""

    seconds: float
    per_hour: float


def alarm_rates(name: str, seed: int, hours: int, promises: Sequence[Promise]) -> np.ndarray:
    """Return false alarms per hour by the promise, in other motion than the recordings."""
    model = model_arm(name)
    arm = true_arm(model, np.random.default_rng(seed))
    recordings = {seconds: motion_of(model, arm, seconds, 10 * seed + 1)
                  for seconds in {promise.seconds for promise in promises}}
    found = [learned(model, recordings[seconds], per_hour) for seconds, per_hour in promises]
    count = np.zeros(len(found))
    for hour in range(hours):
        unseen = motion_of(model, arm, HOUR, 1000 * seed + hour)
        count += [alarms(levels, *unseen) for levels in found]
    return count / hours / [promise.per_hour for promise in promises]


# ------------------------------------------------------------------------------ false alarms

def test_false_alarms_on_unseen_motion_keep_the_promise():
    """Twenty per hour, so that an hour of another motion is enough to count them."""
    rates = [alarm_rates(name, 5, 1, [Promise(TEN_MINUTES, 20.0)])[0] for name in ARMS]
    assert max(rates) <= SPREAD
    assert np.median(rates) >= 1.0 / SPREAD


@pytest.mark.soak
def test_false_alarms_of_arms_by_which_the_law_was_not_chosen():
    """
    The promise is an upper bound; five per hour are shown by an hour, and kept.

    An hour has about one alarm of those that it promises: at 2 of 18 arms it promises too few.
    """
    promises = [Promise(TEN_MINUTES, 1.0), Promise(TEN_MINUTES, 20.0), Promise(HOUR, 1.0),
                Promise(HOUR, 5.0)]
    rates = np.array([
        alarm_rates(name, seed, 6, promises) for name in UNSEEN_ARMS for seed in (20, 21, 22)])
    for promise, column in zip(promises, rates.T):
        print(f'{promise.seconds / 60:.0f} min, {promise.per_hour:g} per hour: '
              f'median {np.median(column):.2f}, {column.min():.2f} to {column.max():.2f} of the '
              f'promise; at most 3: {np.sum(column <= SPREAD)}, within a factor of 3: '
              f'{np.sum((column <= SPREAD) & (column >= 1.0 / SPREAD))} of {len(column)}')
        assert np.mean(column <= SPREAD) >= 0.85
    assert np.mean(rates[:, -1] >= 1.0 / SPREAD) >= 0.9


@pytest.mark.parametrize(('law', 'above'), [
    (stats.halfnorm(), 1), (stats.beta(1.0, 4.0), 0), (stats.expon(), 4)])
def test_the_promise_is_an_upper_bound_for_known_tails(law, above):
    """Of Gaussian noise and bounded errors in nearly all recordings, at slightly high levels."""
    rng, n, rates, levels = np.random.default_rng(0), 7, [], []
    exact = law.isf(1.0 / 7200.0 / n)
    names = [f'j{i}' for i in range(n)]
    for _ in range(9):
        v = np.abs(rng.normal(size=(1200, n)))
        r = (1.0 + 0.5 * v) * law.rvs(size=v.shape, random_state=rng)
        found = learn_contact_levels(0.5 * np.arange(1200), v, r, names, 1.0).levels
        assert np.median(found.per_velocity / found.effort) == pytest.approx(0.5, abs=0.3)
        levels.append(np.median(found.at(np.ones(n))) / 1.5 / exact)
        # independent samples, 7200 per hour
        v = np.abs(rng.normal(size=(20000, n)))
        rates.append(7200.0 * law.sf(found.at(v) / (1.0 + 0.5 * v)).sum(axis=1).mean())
    assert np.count_nonzero(np.array(rates) > SPREAD) <= above
    assert 0.9 < np.median(levels) < 1.15


def test_the_count_of_the_test_is_that_of_the_detector():
    rng = np.random.default_rng(1)
    levels = ContactLevels(np.array([2.0, 0.0]), np.array([0.5, 0.0]))
    v, r = rng.normal(size=(2, 5000, 2))
    detector = ContactDetector(levels, ('a', 'b'))
    found = [detector.update(1.0 / RATE, *state) for state in zip(v, r)]
    contacts = [contact for contact in found if contact is not None]
    assert len(contacts) == alarms(levels, v, r) > 5
    assert {contact.joint for contact in contacts} == {'a'}  # b has no level
    assert all(abs(contact.effort) > contact.level > 2.0 for contact in contacts)
    for cause in ('payload', 'limit stop', 'stiction'):
        assert cause in str(contacts[0])


# ------------------------------------------------------------------------------ files, bad input


def test_bad_motions_are_rejected():
    t, v = np.arange(0.0, 100.0, 0.1), np.zeros((1000, 2))
    with pytest.raises(InvalidInputError, match=r'lasts 59\.9 s, expected at least 60 s'):
        learn_contact_levels(t[:599], v[:599], v[:599] + 1.0, ('a', 'b'))
    with pytest.raises(InvalidInputError, match="external effort at 'a' is 0 throughout"):
        learn_contact_levels(t, v, v, ('a', 'b'))


def test_a_minute_is_enough_and_one_false_alarm_per_hour_is_the_promise():
    v = np.random.default_rng(0).normal(size=(601, 1))
    given = 0.1 * np.arange(601), np.abs(v), v, ('a',)
    levels = [learn_contact_levels(*given, *rate).levels.effort for rate in ((), (1.0,), (2.0,))]
    assert levels[0] == levels[1] > levels[2]


def record_free_motion(folder: Path) -> None:
    """Write the recording `bag` of 70 s without contact, with noise, and `arm.urdf`."""
    arm = load_arm(default_arm_urdf())
    states = moves_with_pauses(arm, 100.0, 70.0)
    effort = ArmDynamics(arm).inverse_dynamics_batch(states.q, states.v, states.a)
    effort += np.random.default_rng(0).normal(size=effort.shape)
    stamps = START_NS + np.round(1e9 * states.times).astype(np.int64)
    write_recording(folder / 'bag', encoded(stamps, arm.joint_names, states.q, states.v, effort))
    (folder / 'arm.urdf').write_text(default_arm_urdf())


def run(folder: Path, *words: str) -> int:
    """Run the tool on this recording; return its exit status."""
    return main([str(folder / 'bag'), '--urdf', str(folder / 'arm.urdf'), *words])


def test_the_tool_writes_a_parameter_file(tmp_path, capsys):
    record_free_motion(tmp_path)
    path = tmp_path / 'levels.yaml'
    assert run(tmp_path, '-o', str(path)) == 0
    printed = capsys.readouterr().out
    assert 'extrapolated from 70 s' in printed
    assert '1 per hour is an upper bound, with slightly higher levels: record 3 h' in printed
    assert 'extrapolated' in path.read_text(encoding='utf-8')
    parameters = read_parameter_file(path)
    assert parameters['joints'] == ['joint1', 'joint2']
    assert 1.0 < min(parameters['contact.effort']) < max(parameters['contact.effort']) < 10.0
    assert run(tmp_path, '-o', str(path)) == 2  # the file exists
    assert run(tmp_path, '--alarms-per-hour', '0') == 2
    assert 'alarms_per_hour is 0, expected a number > 0' in capsys.readouterr().err
