# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Only one module of the package uses members of rclpy that are not documented."""

import ast
import inspect
from pathlib import Path
import re

from own_process import own_process
from rclpy.lifecycle import LifecycleNode
import robot_dynamics
from robot_dynamics.ros.dynamics.node import DynamicsNode
from robot_dynamics.ros.middleware.guarded_callbacks import GuardedCallbacks
from robot_dynamics.ros.simulated_arm.node import SimulatedArmNode

PACKAGE = Path(robot_dynamics.__file__).parent
IMPLEMENTATION_MODULE = re.compile(r'rclpy\.(impl\b|_)')
PRIVATE = re.compile('_[a-z]')
UNDOCUMENTED = {
    'handle', 'publish_raw', 'take_message', 'service_take_request', 'take_response',
    'send_response', 'callback', 'srv_type', 'request_id', 'get_ready_entities',
    'rclpy_implementation'}


def undocumented(tree: ast.Module) -> list[str]:
    """Return the uses of members of rclpy that are not documented."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and IMPLEMENTATION_MODULE.match(node.module or ''):
            found.append(f'line {node.lineno}: from {node.module}')
        elif isinstance(node, ast.Import):
            found += [f'line {node.lineno}: import {name.name}' for name in node.names
                      if IMPLEMENTATION_MODULE.match(name.name)]
        elif isinstance(node, ast.Attribute) and (
                node.attr in UNDOCUMENTED
                or PRIVATE.match(node.attr) and not is_own(node.value)):
            found.append(f'line {node.lineno}: .{node.attr}')
    return found


def is_own(value: ast.expr) -> bool:
    return isinstance(value, ast.Name) and value.id in ('self', 'cls')


def test_no_other_module_uses_undocumented_members():
    modules = [path for path in sorted(PACKAGE.rglob('*.py')) if path.name != 'rclpy_internals.py'
               and re.search(r'^\s*(import|from) rclpy\b', path.read_text('utf-8'), re.MULTILINE)]
    assert len(modules) > 20
    uses = {str(path.relative_to(PACKAGE)): undocumented(ast.parse(path.read_text('utf-8')))
            for path in modules}
    assert {path: found for path, found in uses.items() if found} == {}, (
        'move these to ros/middleware/rclpy_internals.py, with a fallback and a test')


def test_nodes_name_none_of_their_attributes_as_rclpy_does():
    with own_process() as process:
        bare = process.add(LifecycleNode('bare', context=process.context))
        of_rclpy = {name for name in dir(bare) if PRIVATE.match(name)}
    own = set()
    for kind in (DynamicsNode, SimulatedArmNode, GuardedCallbacks):
        own |= set(re.findall(r'self\.(_[a-z]\w*)', inspect.getsource(kind)))
    assert len(own) > 20
    assert own & of_rclpy == set()
