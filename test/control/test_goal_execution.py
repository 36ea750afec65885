# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""References that were sent before a stop, a fault or a restart of the joint states."""

from typing import Any

from lock_step_loop import LockStep
import numpy as np
import pytest
from robot_dynamics.control.safety.ending import Ending, Kind
from robot_dynamics.control.safety.faults import Fault
from robot_dynamics.exceptions import TrajectoryError
from robot_dynamics.model.arm import load_arm
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.trajectories.joint_trajectory import JointTrajectory, make_trajectory


@pytest.mark.parametrize(('end', 'words'), [
    (lambda loop: loop.stop(), '~/stop was called'),
    (lambda loop: loop.end(1.0, Ending.by(Fault('broken', 'words'))), 'fault broken: words'),
    (lambda loop: loop.end(1.0, Ending(Kind.HOLD, 'restarted')), 'restarted')])
@pytest.mark.parametrize('is_goal', [True, False])
def test_what_ends_the_motion_refuses_a_goal_that_was_sent_before(end, words, is_goal):
    """It comes while the trajectory is prepared, or before its goal is executed."""
    bench = LockStep(load_arm(default_arm_urdf()), q=np.array([0.3, 0.3]))
    bench.run(0.3)
    names = bench.arm.joint_names
    trajectory = make_trajectory(names, [0.0], [bench.q + 0.3], [], [], names)
    loop, sent = bench.loop, bench.loop.goals.epoch
    end(loop)
    bench.run(0.1)  # the fault has ended
    if is_goal:
        def begin() -> object:
            return loop.goals.execute(trajectory, 0, None, lambda: None, sent)
    else:
        def begin() -> object:
            return loop.follow(trajectory)
        prepare = loop.controller.prepare

        def prepare_while_it_ends(trajectory: JointTrajectory) -> Any:
            prepared = prepare(trajectory)
            end(loop)
            bench.run(0.1)
            return prepared
        loop.controller.prepare = prepare_while_it_ends
    with pytest.raises(TrajectoryError, match=words):
        begin()
    assert loop.goals.goal is None
    assert np.ptp(bench.run(0.5).q, axis=0).max() < 1e-3
