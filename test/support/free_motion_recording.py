# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A recording of the default arm without contact, and the verb that learns contact levels."""

from pathlib import Path

from identification_bench import moves_with_pauses
import numpy as np
from recordings import encoded, START_NS, write_recording
from robot_dynamics.model import ArmDynamics, load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.tools.ros2_dynamics.verbs import make_parser, run


def record_free_motion(folder: Path) -> None:
    """Write the recording `bag` of 70 s without contact, with noise, and `arm.urdf`."""
    arm = load_arm(default_arm_urdf())
    states = moves_with_pauses(arm, 100.0, 70.0)
    effort = ArmDynamics(arm).inverse_dynamics_batch(states.q, states.v, states.a)
    effort += np.random.default_rng(0).normal(size=effort.shape)
    stamps = START_NS + np.round(1e9 * states.times).astype(np.int64)
    write_recording(folder / 'bag', encoded(
        stamps, arm.joint_names, states.q, states.v, effort))
    (folder / 'arm.urdf').write_text(default_arm_urdf())


def learn_contact_levels(folder: Path, *words: str) -> int:
    """Run the verb on this recording; return its exit status."""
    return run('learn_contact_levels', make_parser().parse_args([
        'learn_contact_levels', str(folder / 'bag'), '--urdf', str(folder / 'arm.urdf'), *words]))
