# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Sphinx builds the site of docs/ with this file: `scripts/docs`, or `rosdoc2 build`."""

from importlib import resources
import os
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

from docutils import nodes
from latex2mathml.converter import convert

ROOT = next(folder for folder in Path(__file__).resolve().parents
            if (folder / 'robot_dynamics_interfaces').is_dir())  # rosdoc2 copies docs/
DOCS = ROOT / 'docs'
PAGES_OF_FILES = {'README.md': 'index.md', 'CONTRIBUTING.md': 'contributing.md'}
LINK = re.compile(  # or a block of code, which stays unchanged
    r'^(```|~~~).*?^\1[`~]*$|(?<=\]\()(?!#|[a-z]+:)(?P<link>[^)#\s]+)', re.MULTILINE | re.DOTALL)
PACKAGES = {'robot_dynamics': ROOT, 'robot_dynamics_tools': ROOT / 'robot_dynamics_tools'}
NO_LIBRARY = ('ros', 'tools', 'commands', 'demo', 'gravity_motion', 'monitor', 'ros2_dynamics',
              'viewer', 'mujoco/mujoco_arm.py', 'recorder.py')
"""Nodes and executables, which the Python reference leaves out."""
sys.path[:0] = map(str, PACKAGES.values())

project = 'robot_dynamics'
copyright = '2026 The robot_dynamics authors'  # noqa: A001 - its name
release = ElementTree.parse(ROOT / 'package.xml').findtext('version')
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.apidoc', 'sphinx_copybutton']
exclude_patterns = ['index.rst', 'standard*', '__*']  # of rosdoc2
suppress_warnings = ['myst.header']  # a table of evidence may follow at any level
rosdoc2_settings = {'override_theme': False}
highlight_language = 'text'
smartquotes = False

myst_enable_extensions = ['dollarmath']
myst_heading_anchors = 4

html_theme = 'furo'
html_title = f'{project} {release}'
html_static_path = [
    'site/site.css', str(resources.files('ziamath') / 'fonts' / 'STIXTwoMath-Regular.ttf')]
html_css_files = ['site.css']
html_math_renderer = 'mathml'
html_copy_source = False

default_role = 'code'  # in docstrings
autodoc_member_order = 'bysource'
autodoc_typehints_format = 'short'
autodoc_default_options = {'members': True, 'undoc-members': True, 'ignore-module-all': True}
apidoc_modules = [
    {'path': str(folder / package), 'destination': f'reference/python/{package}',
     'module_first': True,
     'exclude_patterns': [f'{folder / package}/{name}' for name in NO_LIBRARY]}
    for package, folder in PACKAGES.items()]


def read_page(app, page, source):
    """Insert README and CONTRIBUTING; make links relative to where the page is built."""
    file = {name.removesuffix('.md'): file for file, name in PAGES_OF_FILES.items()}.get(page)
    if file:
        source[0] = (ROOT / file).read_text(encoding='utf-8') + source[0]
        app.env.note_dependency(str(ROOT / file))
    folder = ROOT if file else (DOCS / page).parent

    def replace(found):
        if not found['link']:
            return found[0]
        target = Path(os.path.normpath(folder / found[0]))
        if target.parent == ROOT and target.name in PAGES_OF_FILES:
            target = DOCS / PAGES_OF_FILES[target.name]
        start = DOCS if target.is_relative_to(DOCS) else app.srcdir
        return os.path.relpath(target, (start / page).parent)

    if app.env.doc2path(page).suffix == '.md':
        source[0] = LINK.sub(replace, source[0])


def read_docstring(app, what, name, value, options, lines):
    """Escape bars, which mean a magnitude; append the names that a package offers."""
    lines[:] = re.sub(r'`[^`]*`|\|', lambda found: r'\|' if found[0] == '|' else found[0],
                      '\n'.join(lines)).split('\n')
    names = getattr(value, '__all__', ()) if what == 'module' else ()
    if names:
        modules = {each: getattr(getattr(value, each), '__module__', name) for each in names}
        links = (f':py:obj:`{each} <{modules[each]}.{each}>`' for each in names)
        lines += ['', f'Names to import from `{name}`: {", ".join(links)}.']


def show_formula(writer, node):
    """Write a formula as MathML, which browsers draw without a script or a network."""
    block = isinstance(node, nodes.math_block)
    mathml = convert(' '.join(node.astext().split()), display='block' if block else 'inline')
    unknown = re.findall(r'\\[A-Za-z]+', mathml)
    if unknown:
        raise ValueError(f'{unknown} in ${node.astext()}$ cannot be shown as MathML')
    writer.body.append(mathml)
    raise nodes.SkipNode


def setup(app):
    """Connect the functions above."""
    app.connect('source-read', read_page)
    app.connect('autodoc-process-docstring', read_docstring)
    app.add_html_math_renderer('mathml', (show_formula, None), (show_formula, None))
