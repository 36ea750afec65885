# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""No tool replaces an output file silently; all follow one rule."""

from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.tools import planar_urdf
from robot_dynamics_tools.commands import animate, excite, export_mjcf, torque_map
from robot_dynamics_tools.options import prepare_directory

QUICK: dict[str, tuple[Callable[[Sequence[str]], int], str, list[str]]] = {
    'animate': (animate.main, 'out/planar_arm.gif', ['--duration', '1', '--rate', '1']),
    'excite --output': (
        excite.main, 'x.yaml', ['--duration', '2', '--harmonics', '2', '--output', 'x.yaml']),
    'export_mjcf -o': (export_mjcf.main, 'x.xml', ['-o', 'x.xml']),
    'planar_urdf -o': (planar_urdf.main, 'x.urdf', ['-o', 'x.urdf']),
    'torque_map -o': (torque_map.main, 'x.svg', ['--samples', '5', '-o', 'x.svg']),
}
"""Tools with an output file: its path, and arguments for a quick run."""


@pytest.mark.parametrize('name', QUICK)
def test_an_existing_file_is_kept_unless_forced(name, tmp_path, monkeypatch, capsys):
    main, output, arguments = QUICK[name]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('OPENBLAS_NUM_THREADS', '1')
    path = Path(output)
    path.parent.mkdir(exist_ok=True)
    path.write_text('mine', encoding='utf-8')
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ('', f'{name.split()[0]}: output {output!r} exists, expected the name '
                              'of a new file, or --force to replace it\n')
    assert path.read_text(encoding='utf-8') == 'mine'
    assert main([*arguments, '--force']) == 0
    assert path.read_bytes() != b'mine'


@pytest.mark.parametrize(
    'name', ['excite --output', 'export_mjcf -o', 'planar_urdf -o', 'torque_map -o'])
def test_a_file_that_cannot_be_written_is_named(name, tmp_path, capsys):
    main, output, arguments = QUICK[name]
    (tmp_path / 'file').touch()
    assert main([*arguments[:-1], str(tmp_path / 'file' / output)]) == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith(f'{name.split()[0]}: cannot write ')


@pytest.mark.parametrize('name', ['animate', 'torque_map'])
def test_a_robot_does_not_choose_where_its_file_goes(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    evil = default_arm_urdf().replace('planar_arm', '../../evil &lt;b>')
    Path('evil.urdf').write_text(evil.replace('"joint1"', r'"$\x$"'), encoding='utf-8')
    main, _, arguments = QUICK[name if name in QUICK else f'{name} -o']
    assert main([*arguments[:-2 if '-o' in arguments else None], '--urdf', 'evil.urdf']) == 0
    assert [path.name.partition('_gravity')[0] for path in Path('out').iterdir()] == [
        {'animate': '.._.._evil__b_.gif', 'torque_map': '.._.._evil__b_'}[name]]


@pytest.mark.parametrize('error', [OSError(28, 'No space left on device'), KeyboardInterrupt()])
def test_no_half_written_file_is_left(tmp_path, monkeypatch, capsys, error):
    def write(path: Path, content: bytes) -> None:
        path.write_text('half')
        raise error

    monkeypatch.setattr(Path, 'write_bytes', write)
    assert planar_urdf.main(['-o', str(tmp_path / 'x')]) == (
        1 if isinstance(error, OSError) else 130)
    assert capsys.readouterr().err.count('\n') == 1
    assert list(tmp_path.iterdir()) == []


def test_a_device_is_no_file(capfd):
    assert planar_urdf.main(['-o', '/dev/stdout']) == 0
    assert capfd.readouterr().out == default_arm_urdf()


def arguments_of(output: Path, **settings: object) -> Namespace:
    return Namespace(**{
        'output': output, 'cutoff': None, 'jobs': None, 'dask': None, 'force': False, **settings})


def test_a_directory_is_used_again_by_the_same_command(tmp_path):
    output = tmp_path / 'out'
    report = output / 'report.html'
    assert prepare_directory(output, [report], arguments_of(output)) == output / 'results'
    report.touch()
    prepare_directory(output, [report], arguments_of(output))
    prepare_directory(output, [report], arguments_of(output, jobs=2))  # the same results
    with pytest.raises(InvalidInputError) as caught:
        prepare_directory(output, [report], arguments_of(output, cutoff=5.0))
    assert str(caught.value) == (
        f'output {str(report)!r} exists and is not of the same command, expected another '
        '--output, or --force to replace it')
    prepare_directory(output, [report], arguments_of(output, cutoff=5.0, force=True))
    prepare_directory(output, [report], arguments_of(output, cutoff=5.0))
    with pytest.raises(InvalidInputError, match='is not of the same command'):
        prepare_directory(output, [report], arguments_of(output))
    (tmp_path / 'page.html').touch()  # in a directory that no command has made
    with pytest.raises(InvalidInputError, match='is not of the same command'):
        prepare_directory(tmp_path, [tmp_path / 'page.html'], arguments_of(tmp_path))
