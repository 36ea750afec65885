# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What distributions read: manifests, setup.py, licences and changelogs."""

from pathlib import Path
import subprocess
import sys

from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package import parse_package
import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ROOT / 'robot_dynamics_tools'
PATHS = (ROOT, ROOT / 'robot_dynamics_interfaces', TOOLS)


def setup_py(directory: Path, *options: str) -> list[str]:
    """Return the lines that setup.py prints for options such as --version."""
    return subprocess.run(
        [sys.executable, 'setup.py', *options], cwd=directory, check=True, capture_output=True,
        text=True).stdout.splitlines()


@pytest.mark.parametrize('path', PATHS, ids=lambda path: path.name)
def test_the_manifest_is_valid_and_complete(path):
    warnings: list[str] = []
    package = parse_package(str(path), warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert package.authors
    root = parse_package(str(ROOT))  # see scripts/release
    assert list(map(str, package.maintainers)) == list(map(str, root.maintainers))
    assert package.version == root.version
    assert (path / package.licenses[0].file).read_text() == (ROOT / 'LICENSE').read_text()


@pytest.mark.parametrize('path', [ROOT, TOOLS], ids=lambda path: path.name)
def test_setup_py_has_what_the_manifest_has(path):
    package = parse_package(str(path))
    assert setup_py(
        path, '--version', '--author', '--maintainer', '--maintainer-email',
        '--license', '--description') == [
            package.version, package.authors[0].name, package.maintainers[0].name,
            package.maintainers[0].email, str(package.licenses[0]),
            package.description]


@pytest.mark.parametrize('path', PATHS, ids=lambda path: path.name)
def test_the_changelog_has_a_section_for_this_version(path):
    changelog = get_changelog_from_path(str(path))
    version = parse_package(str(path)).version
    assert version in [version for version, _, _ in changelog.foreach_version()]
    assert changelog.get_content_of_version(version)
