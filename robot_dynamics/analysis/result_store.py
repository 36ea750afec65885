# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Results on disk: arrays and what JSON can write, each under a key.

A result is written beside its place and then moved there, so that one that is there is whole.
"""

from collections.abc import Mapping
import json
import os
from pathlib import Path
from typing import Any
import zipfile

import numpy as np

Result = dict[str, Any]
"""Names with arrays, or with whatever JSON can write."""
_REST = 'json'
"""The entry for all that is no array."""


def save_result(directory: Path, key: str, result: Mapping[str, Any]) -> None:
    """Keep a result; raise OSError, or TypeError for what JSON cannot write."""
    rest = {name: value for name, value in result.items() if not isinstance(value, np.ndarray)}
    arrays: dict[str, Any] = {
        f'array_{name}': value for name, value in result.items() if name not in rest}
    arrays[_REST] = np.frombuffer(json.dumps(rest).encode(), np.uint8)
    directory.mkdir(parents=True, exist_ok=True)
    unfinished = directory / f'{key}.{os.getpid()}.part'
    with unfinished.open('wb') as file:
        np.savez(file, **arrays)
    unfinished.replace(_place(directory, key))


def load_result(directory: Path, key: str) -> Result | None:
    """Return what was kept under a key; None where there is nothing, or nothing whole."""
    try:
        with np.load(_place(directory, key), allow_pickle=False) as kept:
            result: Result = json.loads(kept[_REST].tobytes())
            for name in kept.files:
                if name != _REST:
                    result[name.removeprefix('array_')] = kept[name]
            return result
    except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile):
        return None


def _place(directory: Path, key: str) -> Path:
    return directory / f'{key}.npz'
