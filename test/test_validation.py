# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of input: accepted values, and the messages of rejections."""

import array

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.exceptions import InvalidInputError, RobotDynamicsError
from robot_dynamics.validation import (
    check_choice,
    check_samples,
    check_scalar,
    check_tensor,
    check_unique,
    check_vector,
    is_empty,
)

JOINTS = ('shoulder', 'elbow')

reals = st.floats(allow_nan=False, allow_infinity=False)


def refusal(check, *arguments, **more):
    """Return the message of a check that rejects; fail if it accepts."""
    with pytest.raises(InvalidInputError) as caught:
        check(*arguments, **more)
    assert isinstance(caught.value, ValueError)
    assert isinstance(caught.value, RobotDynamicsError)
    return str(caught.value)


# --- vectors -------------------------------------------------------------------------------------

@given(values=st.lists(reals, max_size=6))
def test_every_finite_vector_is_returned_as_it_is(values):
    for form in (values, tuple(values), np.array(values), array.array('d', values)):
        checked = check_vector('position', form, len(values))
        assert checked.dtype == np.float64
        assert checked.tolist() == values
    assert check_vector('position', np.array([1, 2], dtype=np.int32), 2).dtype == np.float64


@given(values=st.lists(st.floats(), min_size=1, max_size=6), wanted=st.integers(0, 8))
def test_a_vector_is_refused_exactly_where_length_or_a_value_is_wrong(values, wanted):
    if len(values) == wanted and np.isfinite(values).all():
        assert check_vector('position', values, wanted).tolist() == values
    else:
        refusal(check_vector, 'position', values, wanted)


# --- samples -------------------------------------------------------------------------------------

@given(rows=st.integers(0, 5), columns=st.integers(1, 4), seed=st.integers(0, 99))
def test_flat_samples_are_read_row_by_row(rows, columns, seed):
    matrix = np.random.default_rng(seed).normal(size=(rows, columns))
    npt.assert_array_equal(check_samples('position', matrix, columns), matrix)
    npt.assert_array_equal(check_samples('position', matrix.ravel().tolist(), columns), matrix)
    assert check_samples('position', [], 0).shape == (0, 0)


# --- scalars -------------------------------------------------------------------------------------

@given(value=st.floats(), low=st.floats(-5, 0), width=st.floats(0, 5), exclusive=st.booleans())
def test_a_scalar_is_refused_exactly_outside_its_range(value, low, width, exclusive):
    high = low + width
    if (low < value or (value == low and not exclusive)) and value <= high:
        checked = check_scalar('rate', np.array(value), low, high, exclusive)
        assert checked == value
        assert type(checked) is float
    else:
        refusal(check_scalar, 'rate', value, low, high, exclusive)


# --- messages ------------------------------------------------------------------------------------

NAMED = "expected 2, one for each of ['shoulder', 'elbow']"
ROWS = "expected samples × 2 joints (['shoulder', 'elbow']), row by row"


@pytest.mark.parametrize(('check', 'value', 'message'), [
    (check_vector, [[1.0, 2.0]], f'position has an array of shape (1, 2), {NAMED}'),
    (check_vector, 3.0, f'position has an array of shape (), {NAMED}'),
    (check_vector, [-np.inf, np.nan], 'position[0] (shoulder) is -inf, expected a finite number'),
    (check_vector, np.array([False, True]),
     'position[0] (shoulder) is False, expected a finite number'),
    (check_vector, np.array(['0', '']), "position[0] (shoulder) is '0', expected a finite number"),
    (check_vector, [0.0, 10**400], f'position[1] (elbow) is {10**400}, expected a finite number'),
    (check_vector, None, f'position is {None}, expected numbers'),
    (check_samples, [1.0, 2.0, 3.0], f'position has 3 values, {ROWS}'),
    (check_samples, np.zeros((1, 2, 2)), f'position has an array of shape (1, 2, 2), {ROWS}'),
])
def test_message_on_numbers_of_joints(check, value, message):
    assert refusal(check, 'position', value, 2, JOINTS) == message


def test_message_without_names():
    assert refusal(check_vector, 'gravity', [1, 2], 3) == 'gravity has 2 values, expected 3'
    assert refusal(check_vector, 'gravity', [1, np.inf, 2], 3) == (
        'gravity[1] is inf, expected a finite number')
    assert refusal(check_samples, 'position', [1.0], 0) == (
        'position has 1 values, expected samples × 0 joints, row by row')


def test_tensors():
    rows = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    npt.assert_array_equal(check_tensor('inertia', rows), rows)
    for value in ([[1.0, 0.0], [0.0, 1.0]], 4.0, [[1.0, 0.0, 0.0], [0.0, 2.0, np.inf], [0.0] * 3],
                  [['1', 0, 0], [0, True, 0], [0, 0, 3]]):
        assert refusal(check_tensor, 'inertia', value) == (
            f'inertia is {value}, expected a finite 3 × 3 tensor')
    for value in ('round', [[1.0], [2.0, 3.0]]):
        assert refusal(check_tensor, 'inertia', value) == f'inertia is {value!r}, expected numbers'


@pytest.mark.parametrize(('value', 'more', 'message'), [
    (-1, {'minimum': 0.0}, 'rate is -1, expected a number >= 0'),
    (0, {'minimum': 0.0, 'exclusive_minimum': True}, 'rate is 0, expected a number > 0'),
    (2, {'minimum': 0.0, 'maximum': 1.0}, 'rate is 2, expected a number in [0, 1]'),
    (0, {'minimum': 0.0, 'maximum': 1.0, 'exclusive_minimum': True},
     'rate is 0, expected a number in (0, 1]'),
    (2, {'maximum': 1.0}, 'rate is 2, expected a number <= 1'),
    (np.nan, {}, 'rate is nan, expected a finite number'),
    ('1.0', {'minimum': 0.0}, "rate is '1.0', expected a number >= 0"),
    (None, {}, f'rate is {None}, expected a finite number'),
    (True, {'maximum': 1.0}, 'rate is True, expected a number <= 1'),
    ([1.0], {}, 'rate is [1.0], expected one number'),
])
def test_message_on_a_scalar(value, more, message):
    assert refusal(check_scalar, 'rate', value, **more) == message


# --- names ---------------------------------------------------------------------------------------

def test_choices():
    assert check_choice('command', 'none', ('none', 'all')) == 'none'
    assert refusal(check_choice, 'command', 'some', ('none', 'all')) == (
        "command is 'some', expected one of ['none', 'all']")


def test_unique_names():
    check_unique('joints', ())
    check_unique('joints', ('a', 'b'))
    assert refusal(check_unique, 'joints', ('a', 'b', 'c', 'b')) == (
        "joints has 'b' twice, expected each name once")


@pytest.mark.parametrize(('value', 'expected'), [
    ([], True), ((), True), (np.zeros(0), True), (np.zeros((0, 3)), True),
    (array.array('d'), True), ([0.0], False), (np.zeros(1), False), (np.array(1.0), False),
    (0.0, False), (None, False),
])
def test_empty_is_a_sequence_without_entries(value, expected):
    assert is_empty(value) is expected
