# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a known motion of a known arm in every format, and functions that damage them."""

from pathlib import Path
import shutil

import numpy as np
import pytest
from robot_dynamics.arrays import wrap_to_pi
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics_tools.recordings.messages import joint_state_messages
from robot_dynamics_tools.recordings.topics import JOINT_STATE

RATE = 100.0
START_NS = 1_700_000_000_000_000_000
FORMATS = {
    'mcap': ('MCAP', 'NONE'), 'mcap_chunk': ('MCAP', 'STORAGE'),
    'mcap_message': ('MCAP', 'MESSAGE'), 'mcap_file': ('MCAP', 'FILE'),
    'sqlite3': ('SQLITE3', 'NONE'), 'sqlite3_message': ('SQLITE3', 'MESSAGE'),
    'sqlite3_file': ('SQLITE3', 'FILE')}
"""The formats by name: the storage and the compression of rosbags."""
ROSBAG2 = Path(__file__).parents[4] / 'shared' / 'data' / 'rosbag2'
"""Recordings that rosbag2 itself wrote, of the nodes of this package with the default arm."""
UR10 = ROSBAG2.with_name('ur10')
"""A recording of a real arm."""
NO_ROSBAG2 = 'the recordings of rosbag2 are missing: no shared/data/rosbag2 next to the project'
needs_ur10 = pytest.mark.skipif(not UR10.is_dir(), reason='the recording of a UR10 is missing')
"""Skip a test without that recording."""
MADE = {f'made_{form}': form for form in FORMATS}
"""Names of recordings that tests make, each in a format of FORMATS."""


def recordings_of(names):
    """Return recordings as values of a parameter; those of rosbag2 are skipped where missing."""
    from_rosbag2 = pytest.mark.skipif(not ROSBAG2.is_dir(), reason=NO_ROSBAG2)
    return [name if name in MADE else pytest.param(name, marks=from_rosbag2) for name in names]


def recording_path(name, directory):
    """Return the path of a recording of rosbag2, or of one that is made in this directory."""
    if name not in MADE:
        return ROSBAG2 / name
    path = directory / name
    if not path.exists():
        write_topics(path, KnownMotion(seconds=6.0).loop_topics(), MADE[name])
    return path


class KnownMotion:
    """Two sines about `rest` at each joint of an arm, with the effort of inverse dynamics."""

    def __init__(self, seconds=12.0, rate=RATE, urdf=None, rest=0.0):
        self.arm = load_arm(urdf or default_arm_urdf())
        self.names = self.arm.joint_names
        t = np.arange(0.0, seconds, 1.0 / rate)
        rng = np.random.default_rng(0)
        q, v, a = np.zeros((3, len(t), len(self.names)))
        for w in 2.0 * np.pi * np.array([0.2, 0.5]):
            amplitude, phase = rng.uniform(0.1, 0.3, len(self.names)), rng.uniform(
                0.0, 2.0 * np.pi, len(self.names))
            x = w * t[:, None] + phase
            q += amplitude * np.sin(x)
            v += amplitude * w * np.cos(x)
            a -= amplitude * w**2 * np.sin(x)
        q += rest
        self.q, self.v, self.a = q, v, a
        self.tau = ArmDynamics(self.arm).inverse_dynamics_batch(q, v, a)
        self.stamps_ns = START_NS + np.round(1e9 * t).astype(np.int64)

    def messages(self, names=None, velocity=True, effort=True, wrapped=False):
        """Return stamps and serialized joint states, `wrapped` with positions within ±π."""
        q = wrap_to_pi(self.q) if wrapped else self.q
        return encoded(self.stamps_ns, names or self.names, q, self.v if velocity else None,
                       self.tau if effort else None)

    def loop_topics(self):
        """Return the messages of a closed loop of this motion, by topic."""
        return {
            '/joint_states': self.messages(),
            '/effort_command': encoded(self.stamps_ns, self.names, effort=self.tau)}


def encoded(stamps_ns, names, position=None, velocity=None, effort=None):
    """Return (time, bytes) of joint states, as `write_recording` takes them."""
    return list(zip(stamps_ns.tolist(), joint_state_messages(
        stamps_ns, names, position, velocity, effort)))


def serialized(kind, types=None, **fields):
    """Return a serialized message; `types` is the typestore, by default that of ROS 2 Jazzy."""
    from rosbags import typesys
    types = types or typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    return bytes(types.serialize_cdr(types.types[kind](**fields), kind))


def write_recording(path, messages, form='mcap', topic='/joint_states', kind=JOINT_STATE):
    """Write (time, bytes) in a format of FORMATS; return the path."""
    return write_topics(path, {topic: messages}, form, kind)


def write_topics(path, topics, form='mcap', kind=JOINT_STATE):
    """Write (time, bytes) by topic, all of one kind, in a format of FORMATS; return the path."""
    from rosbags import rosbag2, typesys
    storage, compression = FORMATS[form]
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage])
    writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    with writer:
        types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
        connections = {topic: writer.add_connection(topic, kind, typestore=types)
                       for topic in topics}
        arrivals = [(time_ns, topic, data) for topic, messages in topics.items()
                    for time_ns, data in messages]
        for time_ns, topic, data in sorted(arrivals, key=lambda arrival: arrival[0]):
            writer.write(connections[topic], time_ns, data)
    return path


def write_split(path, messages, parts, form='mcap'):
    """Write one recording split over several files, as rosbag2 does; return the path."""
    import yaml
    at = np.linspace(0, len(messages), parts + 1).astype(int)
    path.mkdir()
    abouts = []
    for i, (first, last) in enumerate(zip(at, at[1:])):
        part = write_recording(path / 'part', messages[first:last], form)
        abouts.append(yaml.safe_load((part / 'metadata.yaml').read_text())[
            'rosbag2_bagfile_information'])
        stored = stored_file(part)
        stored.rename(path / f'{path.name}_{i}{stored.suffix}')
        abouts[-1]['files'][0]['path'] = f'{path.name}_{i}{stored.suffix}'
        shutil.rmtree(part)
    whole = dict(abouts[0])
    whole['files'] = [about['files'][0] for about in abouts]
    whole['relative_file_paths'] = [file['path'] for file in whole['files']]
    whole['message_count'] = len(messages)
    whole['topics_with_message_count'][0]['message_count'] = len(messages)
    whole['duration'] = {'nanoseconds': messages[-1][0] - messages[0][0]}
    (path / 'metadata.yaml').write_text(yaml.safe_dump({'rosbag2_bagfile_information': whole}))
    return path


def stored_file(recording):
    """Return the only file of a recording except its metadata."""
    (file,) = (path for path in Path(recording).iterdir() if path.name != 'metadata.yaml')
    return file


def cut(file, fraction):
    """Truncate a file to this fraction."""
    data = file.read_bytes()
    file.write_bytes(data[:int(fraction * len(data))])
    return file
