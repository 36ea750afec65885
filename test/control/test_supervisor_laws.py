# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Invariants of the supervisor under any events, in any order, at any time."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, rule, RuleBasedStateMachine
import numpy as np
from robot_dynamics.control.safety.ending import Ending
from robot_dynamics.control.safety.fault_action import SafetyOptions
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.control.safety.supervisor import CommandSupervisor, Mode
from supervised import limits, NAMES, RELEASE, RELEASE_NOW

REACH, LARGEST = 1.0, 100.0
FAULT_ACTIONS = ('hold_gravity_then_ramp', 'ramp_to_zero', 'stop_publishing')

efforts = st.lists(st.floats(-LARGEST, LARGEST), min_size=2, max_size=2).map(np.array)
positions = st.lists(
    st.floats(-0.9, 0.9) | st.sampled_from([0.995, -1.005, 1.02]), min_size=2, max_size=2,
).map(np.array)
velocities = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)
pauses = st.sampled_from([0.0, 0.001, 0.002, 0.01]) | st.floats(0.0, 0.3)
faults = st.sampled_from([
    Fault('easy', 'words'), Fault('hard', 'words', recovery=3),
    Fault('latched', 'words', latched=True)])
options = st.builds(
    SafetyOptions, state_timeout=st.sampled_from([0.01, 0.05, 1.0]),
    fault_action=st.sampled_from(FAULT_ACTIONS), hold_time=st.sampled_from([0.0, 0.1]),
    ramp_time=st.sampled_from([0.0, 0.02, 0.2]),
    end_action=st.sampled_from(['hold_then_silence', 'ramp_to_zero']))
rates = st.sampled_from([10.0, 1000.0, 1e6])


class Supervised(RuleBasedStateMachine):
    """One supervisor, and a model of the knowledge and expectations of an observer."""

    @initialize(rate=rates, chosen=options)
    def begin(self, rate: float, chosen: SafetyOptions) -> None:
        self.one = CommandSupervisor(NAMES, limits(rate, REACH, 2.0), chosen)
        self.rate = rate
        self.longest_timeout = chosen.state_timeout  # that of the last good state in a fault
        self.now = self.sent_at = 0.0
        self.standing: np.ndarray | None = None  # the last published effort
        self.must_be_reset = False
        self.brake_until = 0.0

    # ------------------------------------------------------------------ checks of the observer

    def receives(self, effort: np.ndarray | None, hold: np.ndarray | None = None) -> None:
        """Check the result of a call; `hold` is given if the call answered a state."""
        if effort is not None:
            assert np.isfinite(effort).all()
            assert (np.abs(effort) <= LARGEST).all()  # between the request and the gravity torque
            if self.standing is None:
                assert hold is not None  # an effort begins with a state
                assert effort.tolist() == hold.tolist()
            else:
                passed = min(self.now - self.sent_at, 0.05)
                assert (np.abs(effort - self.standing) <= self.rate * passed + 1e-9).all()
            self.standing, self.sent_at = effort, self.now
        if not self.one.is_commanding:
            stops = self.one.mode is Mode.FAULT and (
                self.one.options.fault_action == 'stop_publishing')
            assert stops or self.ends_silently or self.standing is None or (
                not self.standing.any())
            self.standing = None

    @property
    def ends_silently(self) -> bool:
        return self.one.mode is Mode.INACTIVE and (
            self.one.options.end_action == 'hold_then_silence')

    # ------------------------------------------------------------------ events

    @rule(pause=pauses, q=positions, v=velocities, command=efforts, hold=efforts,
          stamped=st.booleans())
    def a_good_state(
        self, pause: float, q: np.ndarray, v: np.ndarray, command: np.ndarray,
        hold: np.ndarray, stamped: bool,
    ) -> None:
        silent_before = self.one.mode in (Mode.INACTIVE, Mode.WAITING)
        since = self.now + pause - self.sent_at
        self.now += pause
        effort = self.one.answer(self.now, q, v, command, lambda: hold, since if stamped else None)
        self.receives(effort, hold)
        assert self.one.mode is not Mode.WAITING
        if silent_before and (np.abs(q) > REACH + 0.0087).any():
            assert effort is None

    @rule(pause=pauses)
    def a_tick(self, pause: float) -> None:
        self.now += pause
        waits = self.one.mode in (Mode.INACTIVE, Mode.WAITING)
        effort = self.one.tick(self.now)
        assert not waits or effort is None
        self.receives(effort)
        assert self.one.mode not in (Mode.RUNNING, Mode.BRAKING) or (
            self.now <= self.one.deadline + 1e-9)
        assert self.one.mode is not Mode.BRAKING or self.now <= self.brake_until

    @rule(pause=pauses, fault=faults)
    def a_fault(self, pause: float, fault: Fault) -> None:
        self.now += pause
        is_active = self.one.mode not in (Mode.INACTIVE, Mode.STOPPING)
        self.one.end(self.now, Ending.by(fault))
        if is_active:
            assert self.one.mode in (Mode.FAULT, Mode.BRAKING)
            self.must_be_reset = self.must_be_reset or fault.latched

    @rule()
    def a_repeated_state(self) -> None:
        effort = self.one.repeat()
        if effort is not None:
            assert self.one.mode in (Mode.RUNNING, Mode.BRAKING)
            assert effort.tolist() == self.standing.tolist()

    @rule()
    def activated(self) -> None:
        self.one.activate()
        assert self.one.mode is not Mode.INACTIVE

    @rule()
    def braked(self) -> None:
        """Begin a stop; a second request does not extend its time."""
        was_braking, is_commanding = self.one.mode is Mode.BRAKING, self.one.is_commanding
        self.one.end(self.now, RELEASE)
        is_braking = self.one.mode is Mode.BRAKING
        assert is_braking or self.one.mode in (Mode.INACTIVE, Mode.STOPPING)
        assert is_commanding or not is_braking
        if is_braking and not was_braking:
            self.brake_until = self.now + 2.5
        self.receives(None)

    @rule()
    def resumed(self) -> None:
        before = self.one.mode
        self.one.resume()
        if before is Mode.BRAKING:
            assert self.one.mode in (Mode.RUNNING, Mode.FAULT)
        else:
            assert self.one.mode is before

    @rule()
    def deactivated(self) -> None:
        self.one.end(self.now, RELEASE_NOW)
        assert self.one.mode in (Mode.INACTIVE, Mode.STOPPING)
        self.receives(None)

    @rule()
    def reset(self) -> None:
        done, message = self.one.reset()
        assert done == message.startswith('reset')
        assert self.must_be_reset or not done
        if done:
            self.must_be_reset = False

    @rule(rate=rates, chosen=options)
    def other_options(self, rate: float, chosen: SafetyOptions) -> None:
        self.one.set_options(limits(rate, REACH, 2.0), chosen)
        self.rate = rate
        self.longest_timeout = max(self.longest_timeout, chosen.state_timeout)

    @rule()
    def left_alone(self) -> None:
        """Without states every action ends, in bounded time."""
        due = self.longest_timeout + self.one.options.hold_time + (
            self.one.options.ramp_time) + 4.0 * LARGEST / self.rate
        begin, step = self.now, max(due / 100.0, 0.002)
        while self.now < begin + 1.1 * due + step:
            self.now += step
            self.receives(self.one.tick(self.now))
        if self.rate >= 1000.0:
            assert not self.one.is_commanding
            assert self.one.tick(self.now + 10.0) is None

    # ------------------------------------------------------------------ invariants

    @invariant()
    def a_latched_fault_lets_no_command_through(self) -> None:
        assert self.one.is_latched == self.must_be_reset
        assert not (self.must_be_reset and self.one.mode in (Mode.RUNNING, Mode.WAITING))

    @invariant()
    def the_observer_knows_the_published_effort(self) -> None:
        assert self.one.is_commanding == (self.standing is not None)


Supervised.TestCase.settings = settings(max_examples=60, stateful_step_count=30)
TestSupervised = Supervised.TestCase
