# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The topics that control laws declare."""

from collections.abc import Mapping
from functools import partial
from importlib import import_module
from typing import Any

from robot_dynamics.control.laws.control_law import LawTopic
from robot_dynamics.control.laws.law_table import declared
from robot_dynamics.ros.dynamics.control_path import ControlPath
from robot_dynamics.ros.dynamics.goals.trajectory_input import NEWEST_ONLY, TrajectoryInput
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks


def subscribe_laws(
    node: GuardedCallbacks, path: ControlPath, trajectories: TrajectoryInput,
) -> None:
    """Subscribe on a node; references of laws count as goals of `trajectories`."""
    for topic in declared('TOPICS'):
        node.create_subscription(
            _type_named(topic.message_type), topic.name, partial(_deliver, path, topic),
            NEWEST_ONLY)
    for topic in declared('REFERENCES'):
        node.create_subscription(
            _type_named(topic.message_type), topic.name, partial(_follow, trajectories, topic), 1,
            refuse=trajectories.refuse)


def _type_named(name: str) -> Any:
    package, _, message = name.split('/')
    return getattr(import_module(f'{package}.msg'), message)


def _deliver(path: ControlPath, topic: LawTopic, message: Any) -> None:
    loop = path.loop
    if loop is not None:
        loop.controller.deliver(topic, message)


def _follow(
    trajectories: TrajectoryInput, topic: LawTopic, message: Any, info: Mapping[str, int],
) -> None:
    trajectories.follow(topic.name, lambda controller: topic.take(controller, message), info)
