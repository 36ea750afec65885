# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Conversion from the joint order of a request to the arm's order and back."""


from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.model.joint_order import JointOrder

laws = settings(deadline=None, derandomize=True, max_examples=30)


def joint(name, parent, child, mimic=''):
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 0 1"/><limit lower="-3" upper="3"/>{mimic}</joint>')


ARM = load_arm(
    '<robot name="arm">' + ''.join(f'<link name="l{i}"/>' for i in range(7))
    + joint('hip', 'l0', 'l1') + joint('knee', 'l1', 'l2') + joint('ankle', 'l2', 'l3')
    + joint('brake', 'l3', 'l4')
    + joint('double', 'l4', 'l5', '<mimic joint="knee" multiplier="-2" offset="0.5"/>')
    + joint('braked', 'l5', 'l6', '<mimic joint="brake" offset="0.1"/>') + '</robot>',
    ['hip', 'knee', 'ankle'])
JOINTS = ('hip', 'knee', 'ankle')
MIXED, WITH_MIMIC = ('ankle', 'hip', 'knee'), (*JOINTS, 'double')
Q = {'hip': 0.1, 'knee': 0.2, 'ankle': 0.3, 'double': 0.1}
V = {'hip': 1.0, 'knee': 2.0, 'ankle': 3.0, 'double': -4.0}
TAU = {'hip': 10.0, 'knee': 20.0, 'ankle': 30.0, 'double': 7.0}

orders = st.one_of(st.permutations(JOINTS), st.permutations(WITH_MIMIC)).map(tuple)


def values(table, names):
    return [table[name] for name in names]


def refusal(call):
    with pytest.raises(InvalidInputError) as caught:
        call()
    return str(caught.value)


# --- into the arm's order ------------------------------------------------------------------------

@laws
@given(names=orders)
def test_any_order_is_sorted_into_that_of_the_arm(names):
    order = JointOrder(ARM, names)
    npt.assert_array_equal(order.position(values(Q, names)), values(Q, JOINTS))
    npt.assert_array_equal(order.rate(values(V, names), 'velocity'), values(V, JOINTS))
    assert order.names == tuple(name for name in names if name != 'double')


@laws
@given(names=orders)
def test_an_effort_at_a_mimic_joint_counts_at_its_leader(names):
    given_effort = np.array(values(TAU, names))
    kept = given_effort.copy()
    ours = JointOrder(ARM, names).effort(given_effort)
    # The leader moves the mimic joint by −2: power is the same on both sides.
    felt = 20.0 - 2 * 7.0 if 'double' in names else 20.0
    npt.assert_array_equal(ours, [10.0, felt, 30.0])
    npt.assert_array_equal(given_effort, kept)


def test_samples_with_a_mimic_joint():
    order = JointOrder(ARM, ('double', 'ankle', 'knee', 'hip'))
    knee = np.array([0.0, 0.3, -0.4])
    rows = np.column_stack([0.5 - 2 * knee, [7, 8, 9], knee, [4, 5, 6]])
    expected = np.column_stack([[4, 5, 6], knee, [7, 8, 9]])
    npt.assert_array_equal(order.positions(rows), expected)
    npt.assert_array_equal(order.positions(rows.ravel()), expected)
    rates = np.arange(12.0).reshape(4, 3)
    npt.assert_array_equal(
        JointOrder(ARM, MIXED).rates(rates.ravel(), 4, 'velocity'),
        rates[:, [1, 2, 0]])


def test_no_rates_mean_rest():
    for names in ((), WITH_MIMIC):
        order = JointOrder(ARM, names)
        npt.assert_array_equal(order.rate([], 'velocity'), np.zeros(3))
        npt.assert_array_equal(order.rates([], 4, 'velocity'), np.zeros((4, 3)))
        assert order.positions([]).shape == (0, 3)
    assert order.rates([], 0, 'velocity').shape == (0, 3)


# --- back ----------------------------------------------------------------------------------------

@laws
@given(names=orders)
def test_an_answer_is_in_the_order_of_its_names(names):
    order = JointOrder(ARM, names)
    by_name = dict(zip(order.names, order.answer(np.array([10.0, 20.0, 30.0]))))
    assert by_name == {'hip': 10.0, 'knee': 20.0, 'ankle': 30.0}
    rows = np.arange(6.0).reshape(2, 3)
    npt.assert_array_equal(order.answer(rows), [order.answer(row) for row in rows])


@laws
@given(names=orders)
def test_forms_have_every_axis_in_the_order_of_the_names(names):
    order = JointOrder(ARM, names)
    M, c = np.arange(9.0).reshape(3, 3), np.arange(27.0).reshape(3, 3, 3)
    i = [JOINTS.index(name) for name in order.names]
    npt.assert_array_equal(order.answer_form(M), M[np.ix_(i, i)])
    npt.assert_array_equal(order.answer_form(c), c[np.ix_(i, i, i)])


# --- mimic joints --------------------------------------------------------------------------------

def test_a_mimic_joint_may_be_off_by_its_tolerance_and_no_more():
    order = JointOrder(ARM, WITH_MIMIC)
    for sign in (-1, 1):
        near, far = sign * 0.99e-3, sign * 1.01e-3
        npt.assert_array_equal(order.position([0.1, 0.2, 0.3, 0.1 + near]), [0.1, 0.2, 0.3])
        npt.assert_array_equal(order.rate([1, 2, 3, -4 + near], 'velocity'), [1, 2, 3])
        with pytest.raises(InvalidInputError):
            order.position([0.1, 0.2, 0.3, 0.1 + far])
        with pytest.raises(InvalidInputError):
            order.rate([1, 2, 3, -4 + far], 'velocity')


@pytest.mark.parametrize(('names', 'call', 'message'), [
    (WITH_MIMIC, lambda order: order.position([0.1, 0.2, 0.3, 0.4]),
     "position of mimic joint 'double' is 0.4, but it follows 'knee' "
     '(-2 × knee + 0.5 = 0.1), expected that value, or the joint left out'),
    # a rate has no offset
    (WITH_MIMIC, lambda order: order.rate([1, 2, 3, 4], 'acceleration'),
     "acceleration of mimic joint 'double' is 4, but it follows 'knee' "
     '(-2 × knee = -4), expected that value, or the joint left out'),
    # the worst of the samples
    (WITH_MIMIC,
     lambda order: order.positions([[0, 0, 0, 0.5], [0, 0.5, 0, 0.75], [0, 1, 0, -1.4]]),
     "position of mimic joint 'double' is 0.75, but it follows 'knee' "
     '(-2 × knee + 0.5 = -0.5), expected that value, or the joint left out'),
    (MIXED, lambda order: order.position([1, np.nan, 3], 'start'),
     'start[1] (hip) is nan, expected a finite number'),
    (MIXED, lambda order: order.effort([1, 2, np.inf]),
     'effort[2] (knee) is inf, expected a finite number'),
    (MIXED, lambda order: order.positions([1, 2, 3, 4, np.nan, 6]),
     'position[1][1] (hip) is nan, expected a finite number'),
    (MIXED, lambda order: order.rates([1, 2, 3], 2, 'acceleration'),
     'acceleration has 1 samples, expected 2 as position has, or none'),
])
def test_message_on_values(names, call, message):
    order = JointOrder(ARM, names)
    assert refusal(lambda: call(order)) == message


# --- rejections ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('names', 'message'), [
    (('hip', 'ankle'), "joint_names leaves out ['knee'], expected every joint of "
                       "['hip', 'knee', 'ankle'] in any order, or no names at all for this order"),

    (('hip', 'knee', 'toe'), "joint_names has 'toe', expected ['hip', 'knee', 'ankle'] and, "
                             "if wanted, the mimic joints ['double']"),
    (('hip', 'knee', 'hip'), "joint_names has 'hip' twice, expected each name once"),

    ((*JOINTS, 'brake'), "joint_names has 'brake', which is locked at 0 (parameter joints), "
                         "expected ['hip', 'knee', 'ankle']"),
    ((*JOINTS, 'braked'), "joint_names has 'braked', expected ['hip', 'knee', 'ankle'] and, if "
                          "wanted, the mimic joints ['double']"),
])
def test_message_on_names(names, message):
    assert refusal(lambda: JointOrder(ARM, names)) == message
