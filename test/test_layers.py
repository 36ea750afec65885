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
Imports point one way: core ← model ← uses of the model ← ROS ← tools ← launch files.

A new module has to be entered in `LAYERS`, below; a module may import those of its own layer and
of the layers before it.
"""

import ast
from pathlib import Path
import re
import subprocess
import sys

import pytest
import robot_dynamics

PACKAGE = Path(robot_dynamics.__file__).parent
LAUNCH_FILES = sorted((Path(__file__).parents[1] / 'launch').glob('*.py'))

# From the bottom up. A name that ends in a dot stands for all the modules of a package.
LAYERS = {
    # numpy alone
    'core': (
        'cutoff', 'gear_friction', 'urdf_edit', 'velocity_check', 'presliding', 'pseudo_inertia',
        'actuator', 'backlash', 'body_checks', 'command_supervisor', 'command_timeout',
        'coordinates', 'crossing', 'damped_step', 'drive', 'effort_guard', 'effort_semantics',
        'engine_xml', 'event_timing', 'exceptions', 'filtering', 'friction', 'gravity_check',
        'gravity_verdict', 'joint_series', 'joint_state_bytes', 'link_bodies',
        'link_visuals', 'mesh_bounds', 'mesh_files', 'urdf_values',
        'message_tables', 'model_finding', 'payload',
        'payload_transition', 'planar', 'planar_chain', 'planar_urdf', 'recording_loss',
        'result_store', 'runge_kutta', 'sample_faults',
        'set_point_stream', 'state_watch',
        'sticking', 'trajectory', 'trajectory_checks', 'transmissions', 'urdf', 'validation',
        'fourier_series', 'low_pass', 'momentum_observer',
    ),
    # and Pinocchio
    'model': ('arm_dynamics', 'arm_model', 'joint_order', 'regressor', 'rigid_body'),
    # and whatever is not ROS
    'uses': (
        'base_parameters', 'consistent_parameters', 'friction_columns', 'identified_model',
        'identified_urdf', 'identify_task', 'information', 'model_choice', 'model_test',
        'motion_filter', 'motion_regression', 'parameter_estimate', 'pulled_least_squares',
        'bag_identification', 'drive_gain', 'html_page', 'identification_report',
        'identification_words',
        'bag_analysis', 'control', 'controller', 'demo_report', 'description_file',
        'analysis_files', 'analysis_report', 'analysis_task', 'analysis_words', 'arm_recording',
        'bag_tasks', 'compression',
        'effort_residual',
        'mcap_salvage', 'message_types', 'parameter_file', 'recorded_topic', 'recording_files',
        'recording_writer', 'sqlite_salvage', 'stored_file',
        'gear_modes', 'gravity_capability', 'identification', 'inertia_survey', 'joint_forces',
        'limit_warnings', 'model_check', 'motion', 'motion_events', 'plant', 'playback',
        'plotting', 'recording', 'reference_motion', 'robot_side', 'simulation', 'soft_gains',
        'tracking', 'trajectory_efforts',
        'evolution_strategy', 'excitation', 'excitation_limits', 'excitation_trajectory',
        'external_effort',
        'live_residual', 'trajectory_file',
        # pictures
        'arm_marks', 'arm_motion', 'chain_animation', 'chain_panels', 'chain_stage',
        'moving_picture', 'planar_view', 'stick_figure', 'torque_grid', 'torque_map_picture',
        'workspace_gravity', 'workspace_picture',
    ),
    # and ROS
    'ros': ('ros.',),
    'tools': ('tools.',),
}
ORDER = tuple(LAYERS)

LIBRARY = ('core', 'model', 'uses')
CORE_LIBRARIES = {'numpy'}
MODEL_LIBRARIES = CORE_LIBRARIES | {'pinocchio'}

ROS_PACKAGES = re.compile(
    r'(rclpy|rcl|rpyutils|launch|launch_\w+|ament_\w+|rosidl_\w+|rosbag2\w*|tf2\w*|\w+_msgs'
    r'|\w+_srvs|\w+_interfaces|diagnostic_updater)$')


def module_name(path):
    """Return the name of a module inside the package, as in `LAYERS`."""
    parts = path.relative_to(PACKAGE).with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


MODULES = {
    module_name(path): path for path in sorted(PACKAGE.rglob('*.py')) if module_name(path)}


def layer_of(module):
    """Return the layer of a module, None where the table does not have it."""
    for layer, names in LAYERS.items():
        for name in names:
            if module == name or (name.endswith('.') and f'{module}.'.startswith(name)):
                return layer
    return None


def imports_of(source, module='', is_package=False):
    """Return the full names of all that a source imports, anywhere in it."""
    here = ['robot_dynamics', *module.split('.')] if module else ['robot_dynamics']
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ''
            if node.level:
                up = node.level - 1 if is_package else node.level
                base = '.'.join([*here[:len(here) - up], *filter(None, [node.module])])
            # A name out of a package may be a module of it.
            found |= {base} | {f'{base}.{alias.name}' for alias in node.names}
        elif isinstance(node, ast.Call):
            function = node.func
            name = function.attr if isinstance(function, ast.Attribute) else getattr(
                function, 'id', '')
            if name in ('import_module', '__import__') and node.args and isinstance(
                    node.args[0], ast.Constant):
                found.add(str(node.args[0].value))
    return found


def imports_of_module(module):
    path = MODULES[module]
    return imports_of(path.read_text(encoding='utf-8'), module, path.name == '__init__.py')


def inner_imports(module):
    """Return the modules of this package that a module imports."""
    names = {name.removeprefix('robot_dynamics.') for name in imports_of_module(module)
             if name.startswith('robot_dynamics.')}
    return {name for name in names if name in MODULES and name != module}


def outer_imports(module):
    """Return the libraries that a module imports, without those of Python itself."""
    names = {name.split('.')[0] for name in imports_of_module(module)}
    return {name for name in names if name not in sys.stdlib_module_names} - {'robot_dynamics'}


def in_layers(*layers):
    return [module for module in MODULES if layer_of(module) in layers]


# --- the scanner ---------------------------------------------------------------------------------

@pytest.mark.parametrize(('source', 'found'), [
    ('import rclpy.node as n, numpy', {'rclpy.node', 'numpy'}),
    ('from robot_dynamics import ros', {'robot_dynamics', 'robot_dynamics.ros'}),
    ('from . import planar', {'robot_dynamics', 'robot_dynamics.planar'}),
    ('from .ros import x', {'robot_dynamics.ros', 'robot_dynamics.ros.x'}),
    ('def f():\n    import rclpy', {'rclpy'}),
    ('if TYPE_CHECKING:\n    from sensor_msgs.msg import Joy',
     {'sensor_msgs.msg', 'sensor_msgs.msg.Joy'}),
    ('importlib.import_module("rclpy")', {'rclpy'}),
    ('__import__("rclpy")', {'rclpy'}),
    ('"import rclpy"', set()),
])
def test_every_form_of_import_is_found(source, found):
    assert imports_of(source, 'arm_model') == found


def test_imports_relative_to_a_package():
    assert 'robot_dynamics.planar' in imports_of('from ..planar import x', 'ros.node')
    assert 'robot_dynamics.ros.running' in imports_of('from .running import x', 'ros.node')
    assert 'robot_dynamics.ros.running' in imports_of('from . import running', 'ros', True)


@pytest.mark.parametrize(('name', 'is_ros'), [
    ('rclpy', True), ('sensor_msgs', True), ('std_srvs', True), ('builtin_interfaces', True),
    ('robot_dynamics_interfaces', True), ('launch_ros', True), ('ament_index_python', True),
    ('numpy', False), ('pinocchio', False), ('rosbags', False), ('matplotlib', False),
])
def test_packages_of_ros_are_told_from_others(name, is_ros):
    assert bool(ROS_PACKAGES.match(name)) == is_ros


def test_the_scanner_finds_what_is_known_to_be_there():
    assert 'arm_model' in inner_imports('rigid_body')
    assert 'pinocchio' in outer_imports('rigid_body')
    assert outer_imports('validation') == {'numpy'}


# --- the rules -----------------------------------------------------------------------------------

def test_every_module_has_a_layer():
    missing = [module for module in MODULES if layer_of(module) is None]
    assert not missing, f'enter {missing} in LAYERS of this test'


def test_no_module_has_two_layers():
    names = [name for layer in LAYERS.values() for name in layer]
    assert len(names) == len(set(names))


@pytest.mark.parametrize('module', MODULES)
def test_imports_point_down(module):
    own = layer_of(module)
    assert own is not None, f'enter {module} in LAYERS of this test'
    upward = {name for name in inner_imports(module)
              if ORDER.index(layer_of(name) or 'tools') > ORDER.index(own)}
    assert not upward, f'{module} ({own}) imports {sorted(upward)}'


@pytest.mark.parametrize('module', in_layers('core'))
def test_the_core_needs_numpy_alone(module):
    assert outer_imports(module) <= CORE_LIBRARIES


@pytest.mark.parametrize('module', in_layers('model'))
def test_the_model_needs_pinocchio_and_no_more(module):
    assert outer_imports(module) <= MODEL_LIBRARIES


@pytest.mark.parametrize('module', in_layers(*LIBRARY))
def test_the_library_knows_nothing_of_ros(module):
    ros = {name for name in outer_imports(module) if ROS_PACKAGES.match(name)}
    assert not ros, f'{module} imports {sorted(ros)}'


def test_the_package_itself_imports_nothing():
    # Else every module below would carry along whatever it names.
    assert imports_of((PACKAGE / '__init__.py').read_text(encoding='utf-8')) == set()


@pytest.mark.parametrize('module', MODULES)
def test_launch_belongs_to_launch_files(module):
    assert not {'launch', 'launch_ros'} & outer_imports(module)


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_are_no_nodes(path):
    # A launch file starts processes, and may import any of our modules to know what to start.
    found = imports_of(path.read_text(encoding='utf-8'))
    assert not {name for name in found if name.split('.')[0] == 'rclpy'}
    ours = {name.removeprefix('robot_dynamics.') for name in found
            if name.startswith('robot_dynamics.')}
    assert not {name for name in ours if name in MODULES and name.endswith('_node')}


def test_there_is_no_cycle():
    graph = {module: inner_imports(module) for module in MODULES}
    while True:
        leaves = [module for module, needs in graph.items() if not needs & graph.keys()]
        if not leaves:
            break
        for module in leaves:
            del graph[module]
    assert not graph, f'these import one another, or need those that do: {sorted(graph)}'


# --- what is loaded ------------------------------------------------------------------------------

def loaded_by(modules):
    """Return the top-level packages in a fresh interpreter that has imported these modules."""
    lines = [f'import robot_dynamics.{module}' for module in modules]
    program = '\n'.join([
        'import sys', f'sys.path.insert(0, {str(PACKAGE.parent)!r})', *lines,
        'print(*sorted({name.split(".")[0] for name in sys.modules}))'])
    result = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return set(result.stdout.split())


def test_importing_the_library_does_not_load_ros():
    loaded = loaded_by(in_layers(*LIBRARY))
    assert {'robot_dynamics', 'pinocchio'} <= loaded
    assert not {name for name in loaded if ROS_PACKAGES.match(name)}


def test_importing_the_core_does_not_load_the_engine():
    loaded = loaded_by(in_layers('core'))
    assert {'robot_dynamics', 'numpy'} <= loaded
    assert not {'pinocchio', 'scipy', 'matplotlib'} & loaded
