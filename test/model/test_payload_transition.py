# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A payload that replaces another one: properties of the transition."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.loaded_arm import LoadedArm
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics, RigidBody
from robot_dynamics.model.payload import make_payload, merged, Payload
from robot_dynamics.model.payload_transition import PayloadTransition
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.references.motion_limits import WorkspaceInertia

SECOND = 1_000_000_000
laws = settings(max_examples=30)
OLD = make_payload('tool0', 3.0, (0.1, 0.0, 0.0), np.diag((0.02, 0.03, 0.04)))
NEW = make_payload('link2', 1.5, (0.0, 0.0, 0.3), np.diag((0.01, 0.01, 0.01)))


def test_it_starts_with_the_old_load_and_ends_with_exactly_the_target():
    way = PayloadTransition([OLD], [NEW], 2.0)
    assert not way.done
    old, new = way.payloads(5 * SECOND)
    assert old.mass == OLD.mass
    assert new.mass == 0.0
    assert not way.done
    old, new = way.payloads(1 * SECOND)  # stamps that go backwards stay at the start
    assert (old.mass, new.mass) == (OLD.mass, 0.0)
    assert not way.done
    for end in (7, 9):
        assert way.payloads(end * SECOND) == [NEW]
        assert way.done


@laws
@given(st.floats(0.0, 1.0))
def test_mass_and_inertia_go_in_a_straight_line(fraction):
    way = PayloadTransition([OLD], [NEW], 2.0)
    way.payloads(0)
    loads = way.payloads(round(fraction * 2 * SECOND))
    s = round(fraction * 2 * SECOND) / (2 * SECOND)
    assert sum(load.mass for load in loads) == pytest.approx((1 - s) * OLD.mass + s * NEW.mass)
    for load in loads:
        whole = OLD if load.link == OLD.link else NEW
        assert load.com.tolist() == whole.com.tolist()
        # the same shape with less density, which is physically possible
        assert load.inertia == pytest.approx(whole.inertia * (load.mass / whole.mass))


def test_a_load_that_stays_does_not_change_meanwhile():
    way = PayloadTransition([OLD], [OLD, NEW], 2.0)
    way.payloads(0)
    on_the_way = {load.link: load for load in merged(way.payloads(SECOND // 2))}
    assert on_the_way['tool0'].mass == pytest.approx(OLD.mass)
    assert on_the_way['tool0'].com == pytest.approx(OLD.com)
    assert on_the_way['tool0'].inertia == pytest.approx(OLD.inertia)
    assert on_the_way['link2'].mass == pytest.approx(0.25 * NEW.mass)
    assert way.payloads(2 * SECOND) == [OLD, NEW]


def test_stamps_of_today_keep_their_nanoseconds():
    now = 1_790_000_000 * SECOND
    way = PayloadTransition([], [NEW], 1e-6)
    way.payloads(now)
    assert way.payloads(now + 250)[0].mass == pytest.approx(0.25 * NEW.mass)


def test_transitions_that_cut_each_other_short_do_not_pile_up_loads():
    loads = [OLD]
    for i in range(20):
        way = PayloadTransition(loads, [(OLD, NEW)[i % 2]], 2.0)
        way.payloads(0)
        loads = way.payloads(SECOND // 10)
    # one per link for the earlier payloads, and the newest target
    assert len(loads) == 3
    assert all(load.mass > 0.0 for load in loads)


@laws
@given(st.integers(0, 10**6))
def test_merged_loads_take_the_same_efforts(seed):
    arm = load_arm(default_arm_urdf())
    rng = np.random.default_rng(seed)
    loads = [
        make_payload(link, rng.uniform(0.1, 5.0), rng.uniform(-0.5, 0.5, 3),
                     rng.uniform(0.0, 0.1) * np.eye(3))
        for link in ('tool0', 'link1', 'tool0', 'tool0')]
    together = merged(loads)
    assert [load.link for load in together] == ['tool0', 'link1']
    q, v, a = rng.normal(size=(3, 2))
    assert RigidBody(arm.with_payloads(together)).inverse_dynamics(q, v, a) == pytest.approx(
        RigidBody(arm.with_payloads(loads)).inverse_dynamics(q, v, a), rel=1e-9, abs=1e-9)


# --- the loads of an arm -------------------------------------------------------------------------

def loaded_with(loads: list[Payload]) -> LoadedArm:
    """Return the default arm with active loads."""
    loaded = LoadedArm(load_arm(default_arm_urdf()))
    loaded.begin_transition(loaded.prepare(loads), 0.0, lambda _: None)
    return loaded


@pytest.mark.parametrize(('old', 'target'), [
    ([OLD], []), ([], [OLD]), ([OLD], [NEW]), ([NEW], [OLD])])
def test_inertia_and_gravity_are_not_underestimated_during_a_transition(old, target):
    """Limits of motion and gains are computed from them, for each load on the way."""
    loaded = loaded_with(old)
    loaded.begin_transition(loaded.prepare(target), 2.0, lambda _: None)
    assumed = loaded.workspace
    for tenths in range(0, 21, 5):
        loaded.advance(tenths * SECOND // 10)
        arm = loaded.arm.with_payloads(loaded.dynamics.arm.payloads)
        actual = WorkspaceInertia(ArmDynamics(arm))
        assert (actual.mass <= assumed.mass + 1e-9).all()
        assert (actual.gravity <= assumed.gravity + 1e-9).all()
    ends = [WorkspaceInertia(ArmDynamics(loaded.arm.with_payloads(loads)))
            for loads in (old, target)]
    assert assumed.mass.max(axis=0) == pytest.approx(
        np.maximum(ends[0].mass.max(axis=0), ends[1].mass.max(axis=0)))


def test_a_transition_to_no_load_ends_with_the_unloaded_arm():
    loaded, done = loaded_with([OLD]), []
    loaded.begin_transition(loaded.prepare([]), 1.0, done.append)
    loaded.advance(0)
    assert loaded.dynamics is not loaded.unloaded
    loaded.advance(SECOND)
    assert loaded.dynamics is loaded.unloaded
    assert done == [()]


def test_an_exchange_at_once_ends_a_transition():
    loaded, done = loaded_with([]), []
    loaded.begin_transition(loaded.prepare([OLD]), 1.0, done.append)
    loaded.begin_transition(loaded.prepare([NEW]), 0.0, lambda _: None)
    loaded.advance(5 * SECOND)
    loaded.advance(9 * SECOND)
    assert loaded.dynamics.arm.payloads == (NEW,)
    assert loaded.planning.arm.payloads == (NEW,)
    assert loaded.workspace.mass.max(axis=0) == pytest.approx(
        WorkspaceInertia(ArmDynamics(loaded.arm.with_payloads([NEW]))).mass.max(axis=0))
    assert done == []


def test_a_transition_that_is_interrupted_twice_counts_with_the_load_that_remains():
    loaded = loaded_with([])
    for k, target in enumerate(([OLD], [], [])):
        loaded.begin_transition(loaded.prepare(target), 1.0, lambda _: None)
        loaded.advance(k * SECOND)
        loaded.advance(k * SECOND + SECOND * 8 // 10)
    assert sum(load.mass for load in loaded.dynamics.arm.payloads) > 0.0
    actual = WorkspaceInertia(ArmDynamics(loaded.dynamics.arm))
    assert (actual.mass <= loaded.workspace.mass + 1e-9).all()
    assert (actual.gravity <= loaded.workspace.gravity + 1e-9).all()


@pytest.mark.parametrize('changes_gravity', [False, True])
def test_after_a_transition_the_load_before_it_no_longer_counts(changes_gravity):
    loaded = loaded_with([OLD])
    loaded.begin_transition(loaded.prepare([]), 1.0, lambda _: None)
    loaded.advance(0)
    loaded.advance(SECOND)
    if changes_gravity:
        loaded.begin_gravity_change(loaded.prepare(gravity=loaded.arm.gravity), 1.0)
    else:
        loaded.begin_transition(loaded.prepare([]), 1.0, lambda _: None)
    bare = WorkspaceInertia(ArmDynamics(loaded.arm))
    assert loaded.workspace.mass.max(axis=0) == pytest.approx(bare.mass.max(axis=0))
    assert loaded.workspace.gravity == pytest.approx(bare.gravity)
