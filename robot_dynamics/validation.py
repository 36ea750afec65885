# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks of input from outside.

Each `check_*` takes the name of the field first, and returns the checked value as float64.
It rejects an invalid value with an `InvalidInputError` that names the field, the given value and
the expected values.
A number is a real number of Python or numpy; a string, None or a bool is not converted to one.
"""

from array import array as typed_array
from collections.abc import Sequence
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError

LARGEST_VALUE = 1e9
"""
Largest magnitude of a number of an arm or its motion, in SI units.

Products of a few larger numbers overflow, and no arm has such values.
"""
SMALLEST_DIVISOR = 1e-12
"""Smallest magnitude of a divisor, in SI units."""
_ROUNDING = 1e-8
"""Largest negative eigenvalue of a covariance, scaled to unit variances, that is rounding."""


def holds_numbers(value: object) -> bool:
    """Return whether `value` is a number, an array of numbers, or a list or tuple of such."""
    if type(value) in (float, int):
        return True
    if isinstance(value, (list, tuple)):
        return all(map(holds_numbers, value))
    if isinstance(value, typed_array):
        return value.typecode not in 'uw'  # type codes of characters
    dtype = getattr(value, 'dtype', None)
    return isinstance(dtype, np.dtype) and dtype.kind in 'iuf'


def _numbers(field: str, value: object) -> tuple[FloatArray, npt.NDArray[Any]]:
    """
    Return `value` as float64, with NaN for non-numeric entries, and the entries as given.

    Both arrays have one shape. Raises InvalidInputError if the entries form no array, or `value`
    is neither a number nor a sequence.
    """
    try:
        if holds_numbers(value):
            converted = np.asarray(value, dtype=np.float64)
            return converted, converted
    except (ValueError, OverflowError):  # rows of different lengths, an integer too large
        pass
    try:
        entries = np.array(value, dtype=object)
        floats = [_as_float(entry) for entry in entries.flat]
    except (TypeError, ValueError):
        raise InvalidInputError(f'{field} is {value!r}, expected numbers') from None
    is_ragged = any(isinstance(entry, (list, tuple, np.ndarray)) for entry in entries.flat)
    if is_ragged or (entries.ndim == 0 and floats == [None]):
        raise InvalidInputError(f'{field} is {value!r}, expected numbers')
    return np.array(floats, dtype=np.float64).reshape(entries.shape), entries


def _as_float(entry: object) -> float | None:
    """Return a real number as a float, and None for anything else or a number too large."""
    if isinstance(entry, bool) or not isinstance(entry, Real):
        return None
    try:
        return float(entry)
    except OverflowError:
        return None


def _label(field: str, index: tuple[int, ...], names: Sequence[str] | None) -> str:
    place = ''.join(f'[{i}]' for i in index)
    if names is not None and index and index[-1] < len(names):
        return f'{field}{place} ({names[index[-1]]})'
    return f'{field}{place}'


def _check_size(
    field: str, array: FloatArray, entries: npt.NDArray[Any], names: Sequence[str] | None,
    largest: float,
) -> FloatArray:
    """
    Return the array; raise InvalidInputError if an entry is not finite, or beyond `largest`.

    `entries` are the entries as given, for the message.
    """
    good = np.isfinite(array) if np.isinf(largest) else np.abs(array) <= largest  # False for NaN
    if good.all():
        return array
    index = tuple(int(i) for i in np.argwhere(~good)[0])
    value, given = array[index], entries[index]
    if np.isfinite(value):
        in_words = f'is {value:g}, expected {_range_in_words(-largest, largest, False)}'
    else:
        shown = repr(given) if _as_float(given) is None else value
        in_words = f'is {shown}, expected a finite number'
    raise InvalidInputError(f'{_label(field, index, names)} {in_words}')


def check_vector(
    field: str, value: npt.ArrayLike, length: int, names: Sequence[str] | None = None,
    largest: float = np.inf,
) -> FloatArray:
    """
    Return `value` as a float64 vector, shape (length,), all finite and at most `largest` in size.

    `names` are the names of its entries, for the message: usually the joints.
    Raises InvalidInputError for another shape, or a value that is not finite or beyond `largest`.
    """
    array, entries = _numbers(field, value)
    if array.shape != (length,):
        given = f'{array.size} values' if array.ndim == 1 else f'an array of shape {array.shape}'
        wanted = f'{length}, one for each of {list(names)}' if names is not None else f'{length}'
        raise InvalidInputError(f'{field} has {given}, expected {wanted}')
    return _check_size(field, array, entries, names, largest)


def check_per_joint(
    field: str, value: npt.ArrayLike, joint_names: Sequence[str], largest: float = np.inf,
) -> FloatArray:
    """
    Return a parameter of the joints as one value per joint, shape (n,).

    `value` is one number for all joints, or an array of one value or of n values. Raises
    InvalidInputError like `check_vector`.
    """
    array, entries = _numbers(field, value)
    if array.shape in ((), (1,)):
        return np.full(len(joint_names), _check_size(field, array, entries, None, largest))
    return check_vector(field, value, len(joint_names), joint_names, largest).copy()


def check_named(
    field: str, values: Sequence[float], names: Sequence[str], joint_names: Sequence[str],
) -> FloatArray:
    """
    Return the values (n,) of these joints, from a message that has `values` by `names`.

    Other names are ignored. Raises InvalidInputError.
    """
    if len(values) != len(names):
        raise InvalidInputError(
            f'{field} has {len(values)} values, expected {len(names)} as name has')
    missing = [name for name in joint_names if name not in names]
    if missing:
        raise InvalidInputError(
            f'name leaves out {missing}, expected every joint of {list(joint_names)}')
    return check_vector(
        field, [values[names.index(name)] for name in joint_names], len(joint_names), joint_names,
        LARGEST_VALUE)


def check_samples(
    field: str, value: npt.ArrayLike, columns: int, names: Sequence[str] | None = None,
    largest: float = np.inf,
) -> FloatArray:
    """
    Return `value` as a float64 matrix, shape (samples, columns), entries as in `check_vector`.

    A flat sequence is read row by row. Raises InvalidInputError if it does not divide into rows of
    `columns` values, or contains a value that is not finite or beyond `largest`.
    """
    array, entries = _numbers(field, value)
    if array.ndim == 1 and (array.size % columns if columns else array.size) == 0:
        shape = (-1, columns) if columns else (0, 0)
        array, entries = array.reshape(shape), entries.reshape(shape)
    if array.ndim != 2 or array.shape[1] != columns:
        given = f'{array.size} values' if array.ndim == 1 else f'an array of shape {array.shape}'
        of = f' ({list(names)})' if names is not None else ''
        raise InvalidInputError(
            f'{field} has {given}, expected samples × {columns} joints{of}, row by row')
    return _check_size(field, array, entries, names, largest)


def check_tensor(field: str, value: npt.ArrayLike, largest: float = np.inf) -> FloatArray:
    """
    Return `value` as a float64 tensor, shape (3, 3), all finite and at most `largest` in size.

    Raises InvalidInputError.
    """
    array, entries = _numbers(field, value)
    if array.shape != (3, 3) or not np.isfinite(array).all():
        raise InvalidInputError(
            f'{field} is {entries.tolist()}, expected a finite 3 × 3 tensor')
    return _check_size(field, array, entries, None, largest)


def covariance_root(field: str, value: Sequence[float], names: Sequence[str]) -> FloatArray:
    """
    Return B (k, k) with the covariance B Bᵀ of k named quantities.

    `value` is the lower triangle of the covariance, row by row. Raises InvalidInputError for
    another number of values, a value that is not finite, a variance below 0, or a matrix that is
    not positive semidefinite.
    """
    k = len(names)
    count = k * (k + 1) // 2
    if len(value) != count:
        raise InvalidInputError(
            f'{field} has {len(value)} values, expected {count}: the lower triangle for the '
            f'{k} parameters {list(names)}')
    C = np.zeros((k, k))
    C[np.tril_indices(k)] = check_vector(field, value, count)
    C = C + np.tril(C, -1).T
    variances = np.diag(C)
    for name, variance in zip(names, variances.tolist()):
        check_scalar(f'{field} of {name!r} with itself', variance, 0.0)
    scale = np.where(variances > 0.0, np.sqrt(variances), 1.0)
    sizes, vectors = np.linalg.eigh(C / np.outer(scale, scale))
    if sizes.min(initial=0.0) < -_ROUNDING * max(k, 1):
        raise InvalidInputError(
            f'{field} has the eigenvalue {sizes.min(initial=0.0):.3g} after scaling to unit '
            'variances, expected a positive semidefinite matrix, given by its lower triangle')
    return np.asarray(scale[:, np.newaxis] * vectors * np.sqrt(np.maximum(sizes, 0.0)))


def lower_triangle(covariance: FloatArray) -> list[float]:
    """Return the lower triangle of a matrix (k, k), row by row, as `covariance_root` takes it."""
    return [float(value) for value in covariance[np.tril_indices(len(covariance))]]


def is_empty(value: object) -> bool:
    """Return whether `value` is a sequence without entries, which means "not given"."""
    try:
        return len(value) == 0  # type: ignore[arg-type]
    except TypeError:  # a number, or an array of numpy without dimensions
        return False


def check_scalar(
    field: str,
    value: object,
    minimum: float = -np.inf,
    maximum: float = np.inf,
    exclusive_minimum: bool = False,
) -> float:
    """
    Return `value` as a finite float within [minimum, maximum].

    With `exclusive_minimum`, `minimum` itself is rejected as well. Raises InvalidInputError.
    """
    entry = np.array(value, dtype=object)
    if entry.shape != ():
        raise InvalidInputError(f'{field} is {value!r}, expected one number')
    number = _as_float(entry[()])
    expected = _range_in_words(minimum, maximum, exclusive_minimum)
    if number is None:
        raise InvalidInputError(f'{field} is {entry[()]!r}, expected {expected}')
    too_low = number < minimum or (exclusive_minimum and number == minimum)
    if not np.isfinite(number) or too_low or number > maximum:
        raise InvalidInputError(f'{field} is {number:g}, expected {expected}')
    return number


def _range_in_words(minimum: float, maximum: float, exclusive_minimum: bool) -> str:
    if np.isfinite(minimum) and np.isfinite(maximum):
        opening = '(' if exclusive_minimum else '['
        return f'a number in {opening}{minimum:g}, {maximum:g}]'
    if np.isfinite(minimum):
        return f'a number {">" if exclusive_minimum else ">="} {minimum:g}'
    if np.isfinite(maximum):
        return f'a number <= {maximum:g}'
    return 'a finite number'


def check_choice(field: str, value: str, choices: Sequence[str]) -> str:
    """Return `value` if it is one of `choices`; raise InvalidInputError otherwise."""
    if value not in choices:
        raise InvalidInputError(f'{field} is {value!r}, expected one of {list(choices)}')
    return value


def check_unique(field: str, names: Sequence[str]) -> None:
    """Raise InvalidInputError if `names` has a name twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InvalidInputError(f'{field} has {name!r} twice, expected each name once')
        seen.add(name)
