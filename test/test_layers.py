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
from functools import cache
from pathlib import Path
import re
import subprocess
import sys

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
        'engine_xml', 'event_timing', 'exceptions', 'friction', 'gravity_check',
        'gravity_verdict', 'joint_series', 'joint_state_bytes', 'link_bodies',
        'link_visuals', 'mesh_bounds', 'mesh_files', 'urdf_values',
        'message_tables', 'model_finding', 'payload',
        'payload_transition', 'planar', 'planar_chain', 'planar_urdf', 'recording_loss',
        'result_store', 'runge_kutta', 'sample_faults',
        'set_point_stream', 'state_watch',
        'sticking', 'trajectory', 'trajectory_checks', 'trajectory_segments', 'transmissions',
        'urdf', 'validation',
        'fourier_series', 'low_pass', 'momentum_observer', 'whole_turns',
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
        'bag_analysis', 'control', 'controller', 'description_file',
        'analysis_files', 'analysis_report', 'analysis_task', 'analysis_words', 'arm_recording',
        'bag_tasks', 'compression',
        'effort_residual',
        'mcap_salvage', 'message_types', 'parameter_file', 'recorded_topic', 'recording_files',
        'recording_writer', 'sqlite_salvage', 'stored_file',
        'motion_limits', 'path_conditioning', 'point_to_point', 'reference_generator',
        'loop_warnings', 'stable_gains',
        'gear_modes', 'gravity_capability', 'identification', 'inertia_survey', 'joint_forces',
        'limit_warnings', 'model_check', 'motion', 'motion_events', 'plant',
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
LIBRARIES = {'core': {'numpy'}, 'model': {'numpy', 'pinocchio'}}
"""The only libraries that a layer may import."""
LAUNCH = {'launch', 'launch_ros'}

ROS_PACKAGES = re.compile(
    r'(rclpy|rcl|rpyutils|launch|launch_\w+|ament_\w+|rosidl_\w+|rosbag2\w*|tf2\w*|\w+_msgs'
    r'|\w+_srvs|\w+_interfaces|diagnostic_updater)$')


def module_name(path):
    """Return the name of a module inside the package, as in `LAYERS`."""
    parts = path.relative_to(PACKAGE).with_suffix('').parts
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


MODULES = {
    module_name(path): path for path in sorted(PACKAGE.rglob('*.py')) if module_name(path)}


def is_in(module, entry):
    """Return whether an entry of `LAYERS` stands for this module."""
    return module == entry or (entry.endswith('.') and f'{module}.'.startswith(entry))


def layers_of(module):
    """Return the layer of each entry of `LAYERS` that stands for this module."""
    return [layer for layer, names in LAYERS.items() for name in names if is_in(module, name)]


def layer_of(module):
    """Return the layer of a module; one that is not in the table may import everything."""
    return next(iter(layers_of(module)), ORDER[-1])


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


@cache
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

FORMS_OF_IMPORT = {
    'import rclpy.node as n, numpy': {'rclpy.node', 'numpy'},
    'from robot_dynamics import ros': {'robot_dynamics', 'robot_dynamics.ros'},
    'from . import planar': {'robot_dynamics', 'robot_dynamics.planar'},
    'from .ros import x': {'robot_dynamics.ros', 'robot_dynamics.ros.x'},
    'def f():\n    import rclpy': {'rclpy'},
    'if TYPE_CHECKING:\n    from sensor_msgs.msg import Joy': {
        'sensor_msgs.msg', 'sensor_msgs.msg.Joy'},
    'importlib.import_module("rclpy")': {'rclpy'},
    '__import__("rclpy")': {'rclpy'},
    '"import rclpy"': set(),
}


def test_every_form_of_import_is_found():
    found = {source: imports_of(source, 'arm_model') for source in FORMS_OF_IMPORT}
    assert found == FORMS_OF_IMPORT
    assert 'robot_dynamics.planar' in imports_of('from ..planar import x', 'ros.node')
    assert 'robot_dynamics.ros.running' in imports_of('from .running import x', 'ros.node')
    assert 'robot_dynamics.ros.running' in imports_of('from . import running', 'ros', True)
    assert 'arm_model' in inner_imports('rigid_body')
    assert 'pinocchio' in outer_imports('rigid_body')
    assert outer_imports('validation') == {'numpy'}


def test_ros_packages_are_distinguished_from_other_libraries():
    ros = [
        'rclpy', 'sensor_msgs', 'std_srvs', 'builtin_interfaces', 'robot_dynamics_interfaces',
        'launch_ros', 'ament_index_python']
    others = ['numpy', 'pinocchio', 'rosbags', 'matplotlib']
    assert [name for name in ros + others if ROS_PACKAGES.match(name)] == ros


# --- the rules: each test lists all violations ---------------------------------------------------

def test_the_table_has_every_module_once_and_no_other():
    wrong = [
        f'{module} has {len(layers_of(module))} entries'
        for module in MODULES if len(layers_of(module)) != 1]
    wrong += [
        f'{name} does not exist' for names in LAYERS.values() for name in names
        if not any(is_in(module, name) for module in MODULES)]
    assert not wrong, 'correct LAYERS of this test:\n' + '\n'.join(wrong)


def test_imports_point_down():
    upward = [
        f'{module} ({layer_of(module)}) imports {name} ({layer_of(name)})'
        for module in MODULES for name in sorted(inner_imports(module))
        if ORDER.index(layer_of(name)) > ORDER.index(layer_of(module))]
    # Importing any module imports the package itself, with all that it imports.
    upward += [f'the package itself imports {name}' for name in sorted(
        imports_of((PACKAGE / '__init__.py').read_text(encoding='utf-8'), is_package=True))]
    assert not upward, '\n'.join(upward)


def test_each_layer_imports_only_its_libraries():
    wrong = []
    for module in MODULES:
        layer, found = layer_of(module), outer_imports(module)
        forbidden = found - LIBRARIES.get(layer, found) | found & LAUNCH
        if layer in LIBRARY:
            forbidden |= {name for name in found if ROS_PACKAGES.match(name)}
        wrong += [f'{module} ({layer}) imports {name}' for name in sorted(forbidden)]
    assert not wrong, '\n'.join(wrong)


def test_launch_files_import_no_node():
    # A launch file starts processes, and may import any of our modules to know what to start.
    wrong = [
        f'{path.name} imports {name}' for path in LAUNCH_FILES
        for name in sorted(imports_of(path.read_text(encoding='utf-8')))
        if name.split('.')[0] == 'rclpy' or (
            name.endswith('_node') and name.removeprefix('robot_dynamics.') in MODULES)]
    assert LAUNCH_FILES
    assert not wrong, '\n'.join(wrong)


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


def test_importing_a_layer_loads_nothing_of_those_above():
    library, core = loaded_by(in_layers(*LIBRARY)), loaded_by(in_layers('core'))
    assert {'robot_dynamics', 'pinocchio'} <= library
    assert {'robot_dynamics', 'numpy'} <= core
    ros = sorted(name for name in library if ROS_PACKAGES.match(name))
    assert not ros, f'the library loads {ros}'
    heavy = sorted({'pinocchio', 'scipy', 'matplotlib'} & core)
    assert not heavy, f'the core loads {heavy}'
