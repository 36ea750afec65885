# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes accept the parameter files of this package."""

from pathlib import Path
import re
from typing import Any

from robot_dynamics.ros.dynamics.parameters import SPECS as DYNAMICS_SPECS
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM
from sensor_msgs.msg import JointState
import yaml

ROOT = Path(__file__).resolve().parents[3]
FILES = {'default_arm.yaml', 'ur10.yaml', 'xarm7.yaml'}


def flat(tree: dict[str, Any], prefix: str = '') -> dict[str, Any]:
    entries: dict[str, Any] = {}
    for key, value in tree.items():
        name = f'{prefix}{key}'
        entries.update(flat(value, f'{name}.') if isinstance(value, dict) else {name: value})
    return entries


def test_every_parameter_of_every_file_is_valid():
    """The nodes run on two of them; without a node, names and ranges are checked of all."""
    files = {path.name: path for path in (ROOT / 'config').glob('*.yaml')}
    assert {name for name in files if not name.startswith('planar')} == FILES
    for name in FILES:
        for key, value in values_of(files[name].read_text(encoding='utf-8')).items():
            specs = [spec for specs in SPECS.values() for spec in specs if spec.name == key]
            assert specs, key
            for spec in specs:
                spec.check(value)


NAMES = {DYNAMICS: 'my_model', SIMULATED_ARM: 'my_arm'}
"""Other names than those that the nodes have by default."""
SPECS = {DYNAMICS: DYNAMICS_SPECS, SIMULATED_ARM: SIMULATED_ARM_SPECS}


def nodes_on(file: Path, namespace: str, **parameters: str) -> list[NodeProcess]:
    """Return both nodes with other names; the arm stays on its brakes, as no effort reaches it."""
    return [NodeProcess(
        module, parameters, namespace=namespace, node_name=name,
        arguments=('--ros-args', '--params-file', str(file)),
        remaps={'effort_command': 'unused'} if module == SIMULATED_ARM else {})
        for module, name in NAMES.items()]


def check_parameters(client: RosClient, namespace: str, written: dict[str, Any]) -> None:
    """Check that each node has the values of the file, and that the two have all of them."""
    used = set()
    for module, specs in SPECS.items():
        names = [spec.name for spec in specs if spec.name in written]
        for name in names:
            taken = client.get_parameter(f'{namespace}/{NAMES[module]}', name)
            value = written[name]
            assert (list(taken) if isinstance(value, list) else taken) == value, (
                f'{module}: {name}')
        used |= set(names)
    assert used == set(written)


def values_of(text: str) -> dict[str, Any]:
    """Return the parameters of a file that has one section, for any node."""
    tree = yaml.safe_load(text)
    assert list(tree) == ['/**']
    return flat(tree['/**']['ros__parameters'])


EXAMPLE = re.compile(r'^( +)# (( *)(\w+):( *\[.*)?)(#.*)?$', re.MULTILINE)
"""A parameter, or a group of them, that stands in a comment."""


def test_the_examples_in_the_comments_are_taken_too(client, tmp_path):
    path = tmp_path / 'default_arm.yaml'
    text = re.sub(EXAMPLE, r'\1\2', (ROOT / 'config' / path.name).read_text(encoding='utf-8'))
    path.write_text(text, encoding='utf-8')
    written = values_of(text)
    assert {'friction.coulomb', 'actuator.backlash', 'robot_compensates'} <= set(written)
    with running(*nodes_on(path, '/cell')):
        check_parameters(client, '/cell', written)
        client.wait_for(JointState, '/cell/my_model/gravity_compensation')
        client.forget('/cell')
