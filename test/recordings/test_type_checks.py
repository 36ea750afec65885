# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Message definitions of a recording are checked before code is generated from them."""

import time

import pytest
from robot_dynamics.exceptions import RecordingError
from robot_dynamics.recordings.message_types import MessageTypes
from robot_dynamics.recordings.storage import StoredTopic
from robot_dynamics.recordings.topics import TopicQos
from robot_dynamics.recordings.type_checks import (
    check_types,
    LARGEST_ARRAY,
    LARGEST_DEFINITION,
    MOST_FIELDS,
)

PART = f'\n{80 * "="}\nMSG: a/msg/'
NUMBER = (1, ('float64', 0))
DATA = b'\0\1\0\0' + bytes(16)


def learned(*definitions):
    """Return types with these definitions of a/msg/T0, a/msg/T1, …."""
    types = MessageTypes()
    types.learn([StoredTopic(f'/{i}', f'a/msg/T{i}', 1, TopicQos(), text, 'MSG')
                 for i, text in enumerate(definitions)])
    return types


def test_a_message_of_an_own_type_is_read():
    types = learned(f'int8 A=3\nstring S="x"\nC[2] class\n{PART}C\nfloat64 x\n')
    message = types.deserialize(DATA, 'a/msg/T0')
    assert [part.x for part in message.class_] == [0.0, 0.0]
    assert (message.A, message.S) == (3, 'x')


@pytest.mark.parametrize(('definitions', 'words'), [
    ([f'C[4000000000] x\n{PART}C\nstring y\n'],
     f'field x is an array of 4000000000, expected 1 to {LARGEST_ARRAY} elements'),
    ([f'float64[{LARGEST_ARRAY + 1}] x\n'], 'field x is an array of'),
    (['float64[0] x\n'], 'field x is an array of 0, expected'),
    ([f'string[{MOST_FIELDS + 1}] x\n'], f'has {MOST_FIELDS + 1} fields with those of its parts'),
    ([f'B[100] x\n{PART}B\nC[100] x\n{PART}C\nD[100] x\n{PART}D\nstring x\n'],
     'has 1000000 fields with those of its parts'),
    (['T1[1000] x\n', 'string[1000] x\n'], 'has 1000000 fields with those of its parts'),
    (['T1 x\n', 'T0 x\n'], 'is inside itself or more than 50 others'),
    (['T0[] x\n'], 'is inside itself or more than 50 others'),
    (['# ' + LARGEST_DEFINITION * 'x' + '\nfloat64 x\n'],
     'has a definition of 1000013 characters, expected at most 1000000')])
def test_definitions_that_are_too_large_are_refused_at_once(definitions, words):
    began = time.process_time()
    types = learned(*definitions)
    with pytest.raises(RecordingError, match=f"^message type 'a/msg/T[01]'.*{words}"):
        types.deserialize(DATA, 'a/msg/T0')
    assert time.process_time() - began < 2.0


def test_a_refused_definition_of_a_common_type_is_replaced_with_the_common_one():
    types = MessageTypes()
    types.learn([StoredTopic(
        '/x', 'std_msgs/msg/Float64', 1, TopicQos(), 'float64[4000000000] data\n', 'MSG')])
    assert types.deserialize(DATA[:12], 'std_msgs/msg/Float64').data == 0.0


@pytest.mark.parametrize('types', [
    {"a/msg/B'": ([], [])}, {'a/msg/B\nimport os': ([], [])}, {'B': ([], [])},
    {'a/msg/B': ([], [('x: int\nimport os', NUMBER)])}, {'a/msg/B': ([], [('__x', NUMBER)])},
    {'a/msg/B': ([], [('ä', NUMBER)])},
    {'a/msg/B': ([], [('x', (2, "a/msg/C'"))])},
    {'a/msg/B': ([], [('x', (4, ((2, 'C()'), 0)))])},
    {'a/msg/B': ([], [('x', (1, ("float64'", 0)))])},
    {'a/msg/B': ([('A;', 'int8', 3)], [])}, {'a/msg/B': ([('A', 'int8', 3 + 0j)], [])}])
def test_names_and_values_that_may_be_code_are_refused(types):
    with pytest.raises(RecordingError, match='^message type.*expected '):
        check_types(types)
