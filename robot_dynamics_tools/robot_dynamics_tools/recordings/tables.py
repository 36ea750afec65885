# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Joint states in tables: CSV files with a header, and data sets of LeRobot (v2.1 and v3).

A column of a CSV file is the time, or a quantity of a joint: its header has the name of the joint
and a word for the quantity, in any order, such as `joint1.position [rad]`, `q_joint1` or
`joint1_torque`. A data set of LeRobot has arrays for all joints, of which `meta/info.json` has the
names; the command (`action`) is another topic.
"""

from contextlib import AbstractContextManager
import csv
import json
from pathlib import Path
import re
from typing import NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray, NANOSECONDS_PER_SECOND
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError
from robot_dynamics_tools.recordings.bag_files import INFO
from robot_dynamics_tools.recordings.joint_series import RecordedJointStates
from robot_dynamics_tools.recordings.messages import FIELDS, RecordedState

WORDS = {
    'time': ('time', 't', 'timestamp', 'stamp'),
    'position': ('position', 'positions', 'pos', 'q', 'angle'),
    'velocity': ('velocity', 'velocities', 'vel', 'qd', 'dq', 'qvel', 'speed'),
    'effort': ('effort', 'efforts', 'torque', 'torques', 'tau', 'current', 'load'),
    'command': ('command', 'cmd', 'action', 'goal', 'target')}
"""Words of a header by quantity; a command is a position."""
ARRAYS = {'position': ('observation.state',), 'command': ('action',), **{
    name: tuple(f'observation.{word}' for word in WORDS[name]) for name in ('velocity', 'effort')}}
"""Names of the arrays of LeRobot by quantity."""
UNITS_OF_TIME = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9}
PERIODS = 2e-4, 0.5
"""Plausible periods [s] of joint states."""
BETWEEN_EPISODES = 10.0
"""[s] between two episodes, which are separate stretches."""
_IN_DEGREES = re.compile(r'deg|°')


class Table(NamedTuple):
    """Times (m,) [s], values (m,) of each quantity and joint, and notes on units."""

    times: FloatArray
    values: dict[tuple[str, str], FloatArray]
    notes: tuple[str, ...]


class TableRecording(AbstractContextManager['TableRecording']):
    """The joint states of a table, with the methods of `Recording` that reading them needs."""

    def __init__(self, path: Path, columns: tuple[tuple[str, str], ...] = ()) -> None:
        """
        Read a CSV file or a data set.

        `columns` are pairs of `time` or JOINT.QUANTITY and the header of a column, which replace
        the detection. Raises RecordingError if there are no times and positions.
        """
        self.path = path
        table = read_dataset(path) if path.is_dir() else read_csv(path, columns)
        self.notes, self._table = list(table.notes), table

    def __exit__(self, *_: object) -> None:
        pass

    def joint_state_topic(self, wanted: str | None = None) -> str:
        """Return the name of the source in messages."""
        return wanted or self.path.name

    def description(self) -> None:
        """Return no URDF, which tables do not contain."""

    def joint_states(self, topic: str) -> RecordedJointStates:
        """
        Return all rows; a joint without a quantity has NaN there.

        The topics named by a word for commands have the commands as positions.
        """
        table, joints = self._table, tuple(dict.fromkeys(name for _, name in self._table.values))
        values = table.values if topic not in WORDS['command'] else {
            ('position', name): column for (quantity, name), column in table.values.items()
            if quantity == 'command'}
        nothing = np.full(len(table.times), np.nan)
        arrays = {field: np.column_stack([values.get((field, name), nothing) for name in joints])
                  for field in FIELDS if any(found == field for found, _ in values)}
        stamps = np.round(NANOSECONDS_PER_SECOND * table.times).astype(np.int64)
        return RecordedJointStates(f'table {str(self.path)!r}', tuple(
            RecordedState(stamp, joints, stamp, {name: each[row] for name, each in arrays.items()})
            for row, stamp in enumerate(stamps.tolist())), 0)


def read_csv(path: Path, columns: tuple[tuple[str, str], ...] = ()) -> Table:
    """Return the table of a CSV file with a header; raise RecordingError."""
    with path.open(newline='', encoding='utf-8-sig') as file:
        text = file.readline()
        head = next(csv.reader([text], delimiter=_delimiter(text)))
    names = [name.strip() for name in head]
    meant = {name: _meaning(name) for name in names}
    for what, name in columns:
        if name not in names:
            raise RecordingError(f'--columns names the column {name!r}, expected one of {names}')
        joint, _, quantity = what.rpartition('.')
        meant = {key: value for key, value in meant.items() if value != (quantity, joint)}
        meant[name] = quantity, joint
    time = next((name for name, (what, _) in meant.items() if what == 'time'), None)
    values = {(what, joint): names.index(name) for name, (what, joint) in meant.items()
              if what != 'time' and joint}
    if time is None or not any(what == 'position' for what, _ in values):
        raise RecordingError(
            f'{str(path)!r} has the columns {names}, expected a time and positions, with headers '
            'such as time, joint1.position and joint1.effort, or --columns time=NAME '
            'JOINT.position=NAME')
    data = np.genfromtxt(path, delimiter=_delimiter(text), skip_header=1, encoding='utf-8-sig')
    data = data.reshape(-1, len(names))
    data = data[np.isfinite(data[:, names.index(time)])]
    times, note = _seconds(data[:, names.index(time)], time)
    degrees = [(what, joint) for (what, joint), k in values.items()
               if what != 'effort' and _IN_DEGREES.search(names[k].lower())]
    notes = (note, *(['degrees by the headers: converted to radians'] if degrees else []))
    return Table(times, {key: np.radians(data[:, k]) if key in degrees else data[:, k]
                         for key, k in values.items()}, notes)


def _delimiter(text: str) -> str:
    return max(',;\t', key=text.count)


def _meaning(name: str) -> tuple[str, str]:
    """Return the quantity and the joint of a header, both '' if it has no such word."""
    bare = re.sub(r'[\[(].*', '', name).strip()
    bare = re.sub(r'_(rad|deg|nm|s|ms|us|ns|amps?|ma)$', '', bare, flags=re.IGNORECASE)
    for quantity, words in WORDS.items():
        for word in words:
            for pattern in (rf'(.*)[._ /]{word}', rf'{word}[._ /](.*)', f'{word}()'):
                found = re.fullmatch(pattern, bare, re.IGNORECASE)
                if found and (quantity != 'time' or not found[1] or '.' not in found[1]):
                    return quantity, found[1]
    return '', ''


def _seconds(values: FloatArray, name: str) -> tuple[FloatArray, str]:
    """Return times [s] of a column, and how its unit was found."""
    stated = re.search(r'(?:_|\[|\()(ms|us|ns|s)(?:\]|\)|$)', name)
    period = float(np.median(np.diff(values))) if len(values) > 1 else 0.0
    unit = stated[1] if stated else next(
        (unit for unit, size in UNITS_OF_TIME.items() if PERIODS[0] <= period * size <= (
            PERIODS[1])), None)
    if unit is None:
        raise RecordingError(
            f'the column {name!r} advances by {period:.4g}, expected a time in s, ms, us or ns, '
            f'of samples {PERIODS[0]:g} to {PERIODS[1]:g} s apart')
    return (values - values[0]) * UNITS_OF_TIME[unit], (
        f'time in {unit}, {"by its header" if stated else f"by its period of {period:.4g}"}')


def read_dataset(path: Path) -> Table:
    """Return the table of a data set of LeRobot; raise RecordingError, MissingDependencyError."""
    parquet = optional('pyarrow.parquet', 'a data set of LeRobot')
    try:
        info = json.loads((path / INFO).read_text(encoding='utf-8'))
        features, rate = info['features'], float(info['fps'])
        table = parquet.read_table(path / 'data')

        def column(name: str) -> FloatArray:
            return np.array(table[name].to_pylist(), dtype=np.float64)

        arrays = {(quantity, name): column(name) for quantity, words in ARRAYS.items()
                  for name in words if name in features and name in table.column_names}
        episode, frame = column('episode_index'), column('frame_index')
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise RecordingError(
            f'data set {str(path)!r} cannot be read: {error}, expected {INFO} with fps and '
            'features, and data/chunk-…/….parquet with episode_index and frame_index') from error
    values = {(quantity, joint): values for (quantity, name), array in arrays.items()
              for joint, values in zip(
                  _joint_names(features[name].get('names'), array.shape[1]), array.T)}
    times = frame / rate
    first = np.flatnonzero(np.diff(episode, prepend=-1))
    ends = np.cumsum([times[last - 1] + BETWEEN_EPISODES for last in first[1:]])
    starts = np.repeat([0.0, *ends], np.diff([*first, len(times)]))
    return Table(times + starts, values, (
        f'data set of LeRobot {info.get("codebase_version", "")}: {len(first)} episodes at '
        f'{rate:g} Hz',))


def _joint_names(names: object, count: int) -> list[str]:
    """Return the names of joints, of a list or of a dictionary with one list."""
    listed = next(iter(names.values()), None) if isinstance(names, dict) else names
    if not isinstance(listed, list) or len(listed) != count:
        return [f'joint{i + 1}' for i in range(count)]
    return [re.sub(r'\.(pos|position|vel|effort)$', '', str(name)) for name in listed]
