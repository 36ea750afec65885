# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The files of a recording: those in metadata.yaml, those of a folder without it, or a single file.

rosbag2 splits long recordings into files NAME_0, NAME_1, … and may compress each as a whole
(`.zstd`). A recorder that was killed leaves no metadata.yaml, or one that is inconsistent with the
files.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath
import re
from typing import Any, NamedTuple

from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import RecordingError

METADATA = 'metadata.yaml'
KINDS = ('a file .mcap or .db3, a directory of rosbag2, or a folder of these; or a file .csv, or '
         'a data set of LeRobot')
INFO = 'meta/info.json'
"""File of a data set of LeRobot."""
_STORAGE = re.compile(r'\.(mcap|db3)(\.zstd)?$')
_NUMBERED = re.compile(r'^(?P<stem>.*?)_(?P<number>\d+)$')


class RecordingFiles(NamedTuple):
    """
    The files of a recording in the order of their times, and the contents of metadata.yaml.

    `stated` are the numbers of messages per topic, empty if they are unknown. `notes` describe
    anomalies, such as missing files.
    """

    paths: tuple[Path, ...]
    stated: dict[str, int]
    notes: tuple[str, ...]


def is_storage(path: Path) -> bool:
    """Return whether a file belongs to a recording, judged by its name."""
    return bool(_STORAGE.search(path.name)) and path.is_file()


def is_table(path: Path) -> bool:
    """Return whether a path is a CSV file or a data set of LeRobot."""
    return path.is_file() and path.suffix.lower() in ('.csv', '.tsv') or (path / INFO).is_file()


def storage_groups(directory: Path) -> list[tuple[Path, ...]]:
    """
    Return the files of recordings in a folder, with the files of one split recording together.

    Numbered files belong to one recording if they are named after the folder, as rosbag2 does, or
    if their numbers begin at 0.
    """
    by_stem: dict[str, list[Path]] = {}
    for path in sorted(directory.iterdir()):
        if is_storage(path):
            by_stem.setdefault(_stem_and_number(path)[0], []).append(path)
    groups: list[tuple[Path, ...]] = []
    for stem, paths in by_stem.items():
        numbered = sorted(paths, key=lambda path: (_stem_and_number(path)[1], path.name))
        is_split = stem == directory.resolve().name or _stem_and_number(numbered[0])[1] == 0
        groups += [tuple(numbered)] if is_split else [(path,) for path in numbered]
    return groups


def find_recordings(paths: Iterable[Path], outputs: Path | None = None) -> list[Path]:
    """
    Return the recordings of paths, sorted: the path itself, or all recordings below a folder.

    Recordings in the directory `outputs`, which a tool wrote before, are skipped in folders.
    The files of a split recording without metadata.yaml, in a folder with other recordings, are
    returned one by one. Raises RecordingError if a path has no recording.
    """
    found: dict[Path, None] = {}
    for path in paths:
        below = [bag for bag in _recordings_below(path)
                 if outputs is None or bag == path
                 or outputs.resolve() not in bag.resolve().parents]
        if not below:
            raise RecordingError(
                f'{str(path)!r} {"has no recording" if path.exists() else "does not exist"}, '
                f'expected {KINDS}')
        found |= dict.fromkeys(below)
    return list(found)


def _recordings_below(path: Path) -> list[Path]:
    if path.suffix == '.bag':
        raise RecordingError(
            f'{str(path)!r} is a bag of ROS 1, expected one of ROS 2: convert it with '
            f'rosbags-convert --src {path} --dst {path.with_suffix("")}')
    if path.is_file():
        if not is_storage(path) and not is_table(path):
            raise RecordingError(
                f'{str(path)!r} is a file {path.suffix or "without a suffix"}, expected {KINDS}')
        return [path]
    if not path.is_dir():
        return []
    if is_table(path) or (path / METADATA).is_file():
        return [path]
    below = {entry: _recordings_below(entry) for entry in sorted(path.iterdir())
             if entry.is_dir() or is_storage(entry)}
    is_one = len(storage_groups(path)) == 1 and all(entry.is_file() for entry in below)
    return [path] if is_one else [found for each in below.values() for found in each]


def recording_files(path: Path) -> RecordingFiles:
    """Return the files of a recording; raise RecordingError if the path has no recording."""
    if not path.exists():
        raise RecordingError(f'recording {str(path)!r} does not exist')
    if path.is_file():
        return RecordingFiles((path,), {}, ())
    metadata = path / METADATA
    if not metadata.is_file():
        return _without_metadata(path, f'without {METADATA}')
    yaml = optional('yaml', METADATA)
    try:
        stated = yaml.safe_load(metadata.read_text(encoding='utf-8'))
        return _with_metadata(path, stated['rosbag2_bagfile_information'])
    except (OSError, KeyError, TypeError, ValueError, AttributeError, yaml.YAMLError):
        return _without_metadata(path, f'with a {METADATA} that cannot be read')


def _without_metadata(path: Path, how: str) -> RecordingFiles:
    groups = storage_groups(path)
    if len(groups) != 1:
        has = f'{len(groups)} recordings: name one of {[group[0].name for group in groups]}' if (
            groups) else 'no file .mcap or .db3'
        raise RecordingError(
            f'recording {str(path)!r} is a directory {how}, expected a directory of rosbag2, or '
            f'a file .mcap or .db3; it contains {has}')
    return RecordingFiles(groups[0], {}, (
        f'{path.name} is a directory {how}: its files are read in the order of their numbers, '
        'and the number of recorded messages is unknown',))


def _with_metadata(path: Path, stated: Any) -> RecordingFiles:
    listed = [path / PurePath(str(name)).name for name in stated['relative_file_paths']]
    counts: dict[str, int] = {}
    for topic in stated.get('topics_with_message_count') or []:
        name = str(topic['topic_metadata']['name'])
        counts[name] = counts.get(name, 0) + int(topic['message_count'])
    present = [file for file in listed if file.is_file()]
    notes = [f'{file.name}: listed in {METADATA} and missing'
             for file in listed if file not in present]
    others = [file for group in storage_groups(path) for file in group if file not in listed]
    if not present and not others:
        raise RecordingError(
            f'recording {str(path)!r} cannot be read: none of the files in its {METADATA} exists, '
            f'expected {[file.name for file in listed]}')
    if others:
        notes.append(f'{METADATA} does not list {[file.name for file in others]}, which are read '
                     'after the listed files')
    return RecordingFiles((*present, *others), counts, tuple(notes))


def _stem_and_number(path: Path) -> tuple[str, int]:
    name = _STORAGE.sub('', path.name)
    numbered = _NUMBERED.match(name)
    return (name, -1) if numbered is None else (numbered['stem'], int(numbered['number']))


def relative_names(paths: Sequence[Path]) -> list[str]:
    """Return short names that distinguish paths: the last parts of each."""
    for depth in range(1, 1 + max((len(path.parts) for path in paths), default=1)):
        names = ['/'.join(path.parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [str(path) for path in paths]
