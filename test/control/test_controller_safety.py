# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The gravity torque as hold, discarded references, and non-finite efforts."""


from controller_bench import LIMIT, make_controller, NOW, Q, set_point, update, ZERO
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.control.control_output import NonFiniteEffortError
from robot_dynamics.joints.effort_convention import EffortConvention
from robot_dynamics.model.payload import make_payload

LOAD = make_payload('tool0', 5.0, (0.05, 0.0, 0.1), np.diag((0.01, 0.02, 0.02)))
COMPENSATES_GRAVITY = EffortConvention(robot_compensates=('gravity',))

few = settings(max_examples=50)
angles = st.lists(st.floats(-np.pi, np.pi), min_size=2, max_size=2).map(np.array)


# --- the hold ------------------------------------------------------------------------------------

@few
@given(angles, st.floats(0.0, 1.0), st.sampled_from(['computed_torque', 'gravity_compensation']),
       st.sampled_from([EffortConvention(), COMPENSATES_GRAVITY]))
def test_without_a_reference_the_command_is_the_hold(q, scale, mode, semantics):
    one = make_controller(command=mode, effort_limit_fraction=scale, effort_convention=semantics)
    output = update(one, NOW, q, ZERO)
    assert output.command.tolist() == output.holding_effort().tolist()


@few
@given(angles, angles, st.floats(0.0, 1.0), st.sampled_from([None, LOAD]), st.booleans())
def test_command_and_hold_are_within_the_limits_with_what_the_robot_adds(
    q, goal, scale, load, robot_holds,
):
    one = make_controller(
        effort_limit_fraction=scale,
        effort_convention=COMPENSATES_GRAVITY if robot_holds else EffortConvention())
    one.set_payloads([] if load is None else [load], 0.0, lambda _: None)
    update(one, NOW, q, ZERO)
    one.follow(set_point(goal), 0)
    output = update(one, NOW, q, ZERO)
    holding = output.holding_effort()
    assert (np.abs(output.command) <= np.maximum(scale * LIMIT, np.abs(holding))).all()
    for effort in (output.command, holding):
        assert (np.abs(effort) <= LIMIT).all()
        if robot_holds:
            assert (np.abs(effort + output.robot_gravity) <= np.maximum(
                LIMIT, np.abs(output.robot_gravity)) + 1e-9).all()


# --- non-finite numbers --------------------------------------------------------------------------

@pytest.mark.parametrize('size', [1e155, 1e200, 1e300])
def test_a_non_finite_effort_is_rejected_without_side_effects(size):
    one = make_controller()
    before = update(one, NOW, Q, ZERO)
    one.follow(set_point(Q), 0)
    with np.errstate(all='ignore'), pytest.raises(NonFiniteEffortError) as caught:
        update(one, NOW, Q, np.full(2, size))
    assert 'position [0.8, 0.5] are not finite' in str(caught.value)
    one.followed.end()
    after = update(one, NOW, Q, ZERO)
    assert after.command.tolist() == before.holding_effort().tolist()
