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

"""Pages of the Python reference: signatures and docstrings of the public modules, unchanged."""

import ast
from collections.abc import Iterator
import inspect
import re

from readme_pages import ROOT

PACKAGE = ROOT / 'robot_dynamics'
GROUPS = {
    'Arms and their dynamics': (
        'model.arm',
        'model.arm_dynamics',
        'model.rigid_body',
        'model.regressor',
        'model.payload',
        'joints.friction',
        'joints.gear_friction',
        'joints.presliding',
        'joints.actuator',
        'simulation.backlash',
        'model.joint_order',
    ),
    'Planar arms': (
        'planar.two_link',
        'planar.chain',
        'planar.urdf',
    ),
    'Control and simulation': (
        'control.control_law',
        'control.controller',
        'control.stable_gains',
        'simulation.arm_simulation',
        'joints.effort_convention',
        'monitoring.external_effort',
        'monitoring.momentum_observer',
        'monitoring.live_residual',
    ),
    'Trajectories': (
        'trajectories.interpolation',
        'trajectories.files',
        'trajectories.efforts',
        'trajectories.reference_generator',
        'trajectories.motion_limits',
        'trajectories.point_to_point',
        'trajectories.path_conditioning',
        'trajectories.demo_motion',
        'trajectories.excitation',
        'trajectories.evolution_strategy',
        'trajectories.excitation_limits',
        'trajectories.excitation_trajectory',
        'trajectories.fourier_series',
    ),
    'Checks of a model': (
        'model_check.checks',
        'model_check.finding',
        'model.worst_gravity',
        'pictures.workspace_gravity',
        'pictures.torque_grid',
        'simulation.joint_forces',
    ),
    'Recordings': (
        'recordings.reader',
        'recordings.writer',
        'recordings.bag_files',
        'analysis.arm_recording',
        'analysis.motion_filter',
        'analysis.residual',
        'analysis.bag_analysis',
        'analysis.batch',
        'model.arm_parameters',
    ),
    'Identification': (
        'identification.bag_identification',
        'identification.pipeline',
        'identification.identified_arm',
        'model.base_parameters',
        'identification.uncertainty',
        'identification.consistent_fit',
        'model.pseudo_inertia',
        'identification.friction_regressor',
        'identification.drive_gains',
    ),
    'Pictures': (
        'reporting.figures',
        'animation.chain_animation',
        'pictures.stick_figure',
        'animation.video',
    ),
    'Input and errors': (
        'validation',
        'exceptions',
        'urdf.description_file',
    ),
}
"""The modules that programs of others are meant to import, by what they are for."""

Definition = ast.FunctionDef | ast.ClassDef


def page_of_group(group: str) -> str:
    """Return the name of the page of a group."""
    return f'reference/python/{group.lower().replace(" ", "_")}.md'


def api_pages() -> dict[str, str]:
    """Return a page a group, and one with all modules."""
    pages, contents = {}, ['# Python\n', 'What can be imported without ROS; `robot_dynamics.ros` '
                           'and the tools are on top of it.\n']
    for group, modules in GROUPS.items():
        page = page_of_group(group)
        pages[page] = '\n'.join([f'# {group}\n', *map(_module, modules)])
        contents += [f'## {group}\n', '| module | |\n| --- | --- |']
        for module in modules:
            link = f'{page.removeprefix("reference/")}#robot_dynamics{module}'
            first = _first_line(_tree(module)).replace('|', '\\|')
            contents.append(f'| [`{module}`]({link}) | {_prose(first)} |')
        contents.append('')
    return {**pages, 'reference/python.md': '\n'.join(contents)}


def public_names(module: str) -> list[str]:
    """Return the names of the functions and classes that a module's page has."""
    return [definition.name for definition in _definitions(_tree(module))]


def _tree(module: str) -> ast.Module:
    return ast.parse((PACKAGE / f'{module.replace(".", "/")}.py').read_text(encoding='utf-8'))


def _module(module: str) -> str:
    tree = _tree(module)
    text = [f'## robot_dynamics.{module}\n', _docstring(tree)]
    for definition in _definitions(tree):
        text += [f'### {definition.name} {{: #{module}.{definition.name} }}\n',
                 _signature(definition), _docstring(definition)]
        if isinstance(definition, ast.ClassDef):
            for method in _definitions(definition):
                text += [f'#### {definition.name}.{method.name} '
                         f'{{: #{module}.{definition.name}.{method.name} }}\n',
                         _signature(method), _docstring(method)]
    return '\n'.join(text)


def _definitions(tree: ast.Module | ast.ClassDef) -> Iterator[Definition]:
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith('_'):
            yield node


def _signature(definition: Definition) -> str:
    """Return a class with its fields, or the head of a function, as code."""
    if isinstance(definition, ast.FunctionDef):
        marks = [f'@{ast.unparse(mark)}\n' for mark in definition.decorator_list]
        returns = f' -> {ast.unparse(definition.returns)}' if definition.returns else ''
        code = f'{"".join(marks)}{definition.name}({ast.unparse(definition.args)}){returns}'
        if len(code) > 99:
            code = re.sub(r'\((.*)\)( -> .*)?$', _wrapped, code, flags=re.DOTALL)
    else:
        bases = f'({", ".join(map(ast.unparse, definition.bases))})' if definition.bases else ''
        fields = [f'\n    {ast.unparse(node)}' for node in definition.body
                  if isinstance(node, ast.AnnAssign)]
        code = f'class {definition.name}{bases}:{"".join(fields)}'.rstrip(':')
    return f'```python\n{code}\n```\n'


def _wrapped(found: re.Match[str]) -> str:
    """Return a long list of arguments with one on each line."""
    parts, depth, start = [], 0, 0
    for i, letter in enumerate(found[1]):
        depth += (letter in '([{') - (letter in ')]}')
        if letter == ',' and depth == 0:
            parts.append(found[1][start:i].strip())
            start = i + 1
    parts.append(found[1][start:].strip())
    return '(\n    ' + ',\n    '.join(parts) + ')' + (found[2] or '')


def _first_line(tree: ast.Module) -> str:
    return (ast.get_docstring(tree) or '').partition('\n')[0]


def _docstring(node: ast.Module | Definition) -> str:
    text = inspect.cleandoc(ast.get_docstring(node) or '')
    return _prose(text) + '\n'


def _prose(text: str) -> str:
    """Return a docstring as Markdown: its stars, underscores and brackets are letters."""
    lines = []
    for line in text.split('\n'):
        if not line.startswith('    '):  # else it is code
            parts = re.split(r'(`[^`]+`)', line)
            parts[::2] = [
                re.sub(r'([*_\[\]#])', r'\\\1', part).replace('<', '&lt;') for part in parts[::2]]
            line = ''.join(parts)
        lines.append(line)
    return '\n'.join(lines)
