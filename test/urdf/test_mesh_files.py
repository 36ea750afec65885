# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The files of meshes that a URDF names."""

import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.urdf.mesh_files import find_mesh, find_untrusted_mesh

# --- mesh files ----------------------------------------------------------------------------------

@pytest.fixture
def mesh(tmp_path, monkeypatch):
    """Return a mesh in the package `arm`, which has its URDF in `arm/urdf`."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    file = tmp_path / 'arm' / 'meshes' / 'link.stl'
    file.parent.mkdir(parents=True)
    (tmp_path / 'arm' / 'urdf').mkdir()
    file.touch()
    return file


def test_names_of_all_kinds_lead_to_the_file(mesh):
    package = mesh.parent.parent
    urdf = package / 'urdf'
    assert find_mesh('package://arm/meshes/link.stl', urdf) == mesh
    assert find_mesh('package://arm/meshes/link.stl', package) == mesh
    assert find_mesh('package://arm/meshes/link.stl', package.parent) == mesh
    assert find_mesh(f'file://{mesh}', urdf) == mesh
    assert find_mesh(str(mesh), urdf) == mesh
    assert find_mesh('../meshes/link.stl', urdf).samefile(mesh)
    assert find_mesh('meshes/link.stl', package) == mesh


def test_what_is_no_file_is_not_found(mesh):
    package = mesh.parent.parent
    for name in ('package://arm/meshes/gone.stl', 'package://arm/meshes', 'package://', 'meshes',
                 'file:///gone.stl', f'http://{mesh}', 'model://arm/meshes/link.stl'):
        assert find_mesh(name, package) is None, name
    assert find_mesh('meshes/link.stl', package / 'urdf') is None  # relative to another directory


def test_packages_of_the_environment_are_found_after_those_next_to_the_urdf(
    mesh, tmp_path, monkeypatch,
):
    urdf = mesh.parent.parent / 'urdf'
    others = []
    for prefix in ('one', 'two'):
        other = tmp_path / prefix / 'share' / 'arm' / 'meshes' / 'link.stl'
        other.parent.mkdir(parents=True)
        other.touch()
        others.append(other)
    name = 'package://arm/meshes/link.stl'
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "one"}:{tmp_path / "two"}')
    assert find_mesh(name, urdf) == mesh
    mesh.unlink()
    assert find_mesh(name, urdf) == others[0]
    others[0].unlink()
    assert find_mesh(name, urdf) == others[1]
    monkeypatch.delenv('AMENT_PREFIX_PATH')
    assert find_mesh(name, urdf) is None


# --- meshes of a description from a topic --------------------------------------------------------

@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a mesh in the share directory of the package `arm`, and others outside."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path}/install:{tmp_path}/none')
    for name in ('install/share/arm', 'own/arm', 'secret'):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / 'link.stl').touch()
    (tmp_path / 'own' / 'out.stl').symlink_to(tmp_path / 'secret' / 'link.stl')
    (tmp_path / 'own' / 'in.stl').symlink_to('arm/link.stl')
    (tmp_path / 'install/share/arm/source.stl').symlink_to(tmp_path / 'secret' / 'link.stl')
    return tmp_path


@pytest.mark.parametrize(('name', 'file'), [
    ('package://arm/link.stl', 'install/share/arm/link.stl'),
    ('package:///arm/../arm/link.stl', 'install/share/arm/link.stl'),
    ('package://arm/source.stl', 'install/share/arm/source.stl'),  # as colcon --symlink-install
    ('file://{}/install/share/arm/link.stl', 'install/share/arm/link.stl'),
    ('{}/own/arm/link.stl', 'own/arm/link.stl'), ('arm/link.stl', 'own/arm/link.stl'),
    ('in.stl', 'own/in.stl'), ('{}/own/in.stl', 'own/in.stl')])
def test_meshes_of_packages_and_declared_directories_are_found(installed, name, file):
    assert find_untrusted_mesh(name.format(installed), [installed / 'own']) == installed / file


@pytest.mark.parametrize('name', [
    'package://../../secret/link.stl', 'package://arm/../../../secret/link.stl',
    'package://secret/../../../secret/link.stl', 'file://{}/secret/link.stl',
    'file://{}/install/share/../../secret/link.stl', '{}/secret/link.stl', '/etc/passwd',
    'file:///etc/passwd', '../secret/link.stl', 'out.stl', '{}/own/out.stl'])
def test_other_meshes_are_not_opened_and_their_existence_is_not_revealed(installed, name):
    for word in ('link', 'gone'):
        path = name.format(installed).replace('link', word)
        with pytest.raises(ModelError, match=(
                rf'^mesh {path!r} of a description from a topic is not opened, expected a file')):
            find_untrusted_mesh(path, [installed / 'own'])
    with pytest.raises(ModelError, match='is not opened|is not found'):
        find_untrusted_mesh(name.format(installed))


@pytest.mark.parametrize(('name', 'words'), [
    ('package://arm/gone.stl', 'is not found'), ('gone.stl', 'is not found'),
    ('http://example.com/a.stl', 'of an unknown kind')])
def test_a_missing_mesh_is_reported(installed, name, words):
    with pytest.raises(ModelError, match=words):
        find_untrusted_mesh(name, [installed / 'own'])
