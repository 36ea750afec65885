# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Tolerances of an action goal are given, kept, erased or refused by name."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from robot_dynamics.exceptions import InvalidInputError, JointNamesError
from robot_dynamics.ros.dynamics.goals.tolerances import with_given

NAMES = ('a', 'b', 'c')
VALUES = st.floats(allow_nan=True, allow_infinity=True)


@given(st.dictionaries(st.sampled_from((*NAMES, 'd')), VALUES))
def test_tolerances_are_given_kept_erased_or_refused_by_name(given):
    defaults = np.array([0.1, np.inf, 0.3])
    is_legal = all(value == -1.0 or 0.0 <= value < np.inf for value in given.values())
    if 'd' not in given and is_legal:
        found = with_given('path_tolerance.position', given, defaults, NAMES)
        for name, value, default in zip(NAMES, found, defaults):
            meaning = {0.0: default, -1.0: np.inf}
            assert value == meaning.get(given.get(name, 0.0), given.get(name, 0.0))
        return
    with pytest.raises(InvalidInputError) as error:
        with_given('path_tolerance.position', given, defaults, NAMES)
    assert 'path_tolerance.position' in str(error.value)
    wrong = [name for name, value in given.items()
             if name == 'd' or not (value == -1.0 or 0.0 <= value < np.inf)]
    assert any(repr(name) in str(error.value) for name in wrong)
    assert isinstance(error.value, JointNamesError) == ("tolerance for 'd'" in str(error.value))
