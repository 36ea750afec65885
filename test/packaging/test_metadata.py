# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What distributions read: manifests, setup.py, licences, changelogs, and the version in each."""

from pathlib import Path
import re
import shutil
import subprocess
import sys

from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
from catkin_pkg.package_version import (
    get_forthcoming_label,
    update_changelog_sections,
    update_versions,
)
import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT / 'robot_dynamics_tools'
PATHS = (ROOT, ROOT / 'robot_dynamics_interfaces', TOOLS)
RELEASING = (ROOT / 'docs' / 'releasing.md').read_text(encoding='utf-8')


def setup_py(directory: Path, *options: str) -> list[str]:
    """Return the lines that setup.py prints for options such as --version."""
    return subprocess.run(
        [sys.executable, 'setup.py', *options], cwd=directory, check=True, capture_output=True,
        text=True).stdout.splitlines()


def version_attribute(directory: Path) -> str:
    """Return `robot_dynamics.__version__` of the checkout in a directory."""
    return subprocess.run(
        [sys.executable, '-c', 'import robot_dynamics; print(robot_dynamics.__version__)'],
        cwd=directory, check=True, capture_output=True, text=True,
        env={'PYTHONPATH': str(directory)}).stdout.strip()


@pytest.mark.parametrize('path', PATHS, ids=lambda path: path.name)
def test_the_manifest_is_valid_and_complete(path):
    warnings: list[str] = []
    package = parse_package(str(path), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert package.authors
    assert [url.type for url in package.urls] == ['repository']
    assert (path / package.licenses[0].file).read_text() == (ROOT / 'LICENSE').read_text()


def test_placeholders_say_so_and_are_in_the_checklist():
    """An address that does not exist contains the request to replace it."""
    texts = [(path / 'package.xml').read_text(encoding='utf-8') for path in PATHS]
    found = {name for text in texts for name in re.findall(r'[\w.:/@-]+\.invalid[\w/-]*', text)}
    assert len(found) == 2  # the address and the URL
    for name in found:
        assert 'placeholder-to-be-replaced-at-release' in name
        assert name in RELEASING


@pytest.mark.parametrize('path', [ROOT, TOOLS], ids=lambda path: path.name)
def test_setup_py_has_what_the_manifest_has(path):
    package = parse_package(str(path))
    assert setup_py(
        path, '--version', '--author', '--maintainer', '--maintainer-email', '--url',
        '--license', '--description') == [
            package.version, package.authors[0].name, package.maintainers[0].name,
            package.maintainers[0].email, package.urls[0].url, str(package.licenses[0]),
            package.description]


@pytest.mark.parametrize('path', PATHS, ids=lambda path: path.name)
def test_the_changelog_has_a_section_for_this_version(path):
    changelog = get_changelog_from_path(str(path))
    version = parse_package(str(path)).version
    assert version in [version for version, _, _ in changelog.foreach_version()]
    assert changelog.get_content_of_version(version)


def test_the_tools_of_a_release_change_the_version_everywhere(tmp_path):
    """What `catkin_prepare_release` does, without git."""
    for name in ('package.xml', 'setup.py', 'setup.cfg', 'CHANGELOG.rst', 'LICENSE'):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / 'robot_dynamics', tmp_path / 'robot_dynamics')
    nested = [tmp_path / path.name for path in PATHS[1:]]
    for path in nested:
        shutil.copytree(ROOT / path.name, path, ignore=shutil.ignore_patterns('__pycache__'))
    assert version_attribute(tmp_path) == parse_package(str(tmp_path)).version
    for path in (tmp_path, *nested):
        package, changelog = parse_package(str(path)), get_changelog_from_path(str(path))
        update_versions({str(path): package}, '7.8.9')
        assert parse_package(str(path)).version == '7.8.9'
        label = get_forthcoming_label(changelog.rst)
        if label is not None:  # the commit of a release has none
            file = str(path / 'CHANGELOG.rst')
            update_changelog_sections({package.name: (file, changelog, label)}, '7.8.9')
            assert '7.8.9' in [v for v, _, _ in get_changelog_from_path(file).foreach_version()]
    for path in (tmp_path, tmp_path / TOOLS.name):
        assert setup_py(path, '--version') == ['7.8.9']
    assert version_attribute(tmp_path) == '7.8.9'
