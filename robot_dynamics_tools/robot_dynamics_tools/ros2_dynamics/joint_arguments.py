# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Joint values on a command line: `0.1 0.2` in the node's order, or `joint1=0.1 joint2=0.2`."""

from collections.abc import Mapping, Sequence
import math

from robot_dynamics.exceptions import InvalidInputError


def joint_values(
    field: str, texts: Sequence[str], names: Sequence[str],
    rest: float | Mapping[str, float] | None = None,
) -> list[float]:
    """
    Return a value for each of `names` from the arguments.

    Numbers alone are in the order of `names`, one each; NAME=NUMBER in any order, where `rest` is
    the value of joints left out, one for all or by name (None: none may be). Raises
    InvalidInputError with the names.
    """
    named = [text for text in texts if '=' in text]
    if not named:
        values = [_number(field, text) for text in texts]
        if len(values) != len(names):
            raise InvalidInputError(
                f'{field} has {len(values)} value{"" if len(values) == 1 else "s"}, expected '
                f'{len(names)}: {", ".join(names)}')
        return values
    if len(named) < len(texts):
        plain = next(text for text in texts if '=' not in text)
        raise InvalidInputError(
            f'{field} has {plain!r} and {named[0]!r}, expected only numbers, or NAME=NUMBER '
            f'for each joint: {", ".join(names)}')
    given: dict[str, float] = {}
    for text in named:
        name, _, number = text.partition('=')
        if name not in names:
            raise InvalidInputError(
                f'{field} has joint {name!r}, expected one of: {", ".join(names)}')
        if name in given:
            raise InvalidInputError(f'{field} has joint {name!r} twice, expected it once')
        given[name] = _number(f'{field} of {name}', number)
    missing = [name for name in names if name not in given]
    if missing and rest is None:
        raise InvalidInputError(
            f'{field} leaves out {", ".join(missing)}, expected every joint: {", ".join(names)}')
    others = rest if isinstance(rest, Mapping) else dict.fromkeys(names, rest or 0.0)
    return [given[name] if name in given else others[name] for name in names]


def _number(field: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidInputError(f'{field} is {text!r}, expected a number')
    return value
