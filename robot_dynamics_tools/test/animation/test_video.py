# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Videos: the written file is read back, frame by frame."""

from pathlib import Path
import sys

import numpy as np
import numpy.testing as npt
import pytest
from robot_dynamics.exceptions import InvalidInputError, MissingDependencyError
from robot_dynamics_tools.animation.video import check_format, Frame, write_video

Image = pytest.importorskip('PIL.Image')
from PIL import ImageSequence  # noqa: E402


def bar(k, colour=(0, 114, 178)):
    """Return a white frame with a bar of length 4 k."""
    pixels = np.full((40, 65, 3), 255, dtype=np.uint8)
    pixels[10:30, :4 * k] = colour
    return pixels


def test_a_gif_has_the_frames_their_colours_and_their_times(tmp_path):
    frames = [Frame(bar(k), 0.05 if k != 7 else 2.0) for k in range(1, 15)]
    assert write_video(tmp_path / 'x.gif', iter(frames)) == 14
    with Image.open(tmp_path / 'x.gif') as picture:
        assert picture.info['loop'] == 0
        read = [(np.asarray(one.convert('RGB')), one.info['duration'])
                for one in ImageSequence.Iterator(picture)]
    assert [duration for _, duration in read] == [50] * 6 + [2000] + [50] * 7
    for (pixels, _), frame in zip(read, frames):
        npt.assert_array_equal(pixels, frame.pixels)


def test_times_that_a_gif_does_not_have_add_up_all_the_same(tmp_path):
    write_video(tmp_path / 'x.gif', [Frame(bar(k % 15 + 1), 1.0 / 12.0) for k in range(60)])
    with Image.open(tmp_path / 'x.gif') as picture:
        durations = [one.info['duration'] for one in ImageSequence.Iterator(picture)]
    assert set(durations) == {80, 90}
    assert sum(durations) == 5000


def test_many_colours_become_the_nearest_of_a_palette(tmp_path):
    ramp = np.zeros((32, 256, 3), dtype=np.uint8)
    ramp[..., 0] = np.arange(256)
    ramp[:8] = (0, 158, 115)
    write_video(tmp_path / 'x.gif', [Frame(ramp, 0.1)])
    with Image.open(tmp_path / 'x.gif') as picture:
        pixels = np.asarray(picture.convert('RGB')).astype(int)
    npt.assert_array_equal(pixels[:8], ramp[:8])
    assert np.abs(pixels - ramp).max() <= 16


def test_an_mp4_lasts_as_long_as_its_frames(tmp_path):
    try:
        check_format(Path('x.mp4'))
    except MissingDependencyError as error:
        pytest.skip(str(error))
    write_video(tmp_path / 'x.mp4', [Frame(bar(k), 0.1 if k != 7 else 1.0) for k in range(1, 15)])
    data = (tmp_path / 'x.mp4').read_bytes()
    assert data[4:8] == b'ftyp'
    # The header of the movie: version and flags, two dates, time scale, duration.
    at = data.index(b'mvhd') + 4
    scale, duration = (int.from_bytes(data[at + k:at + k + 4], 'big') for k in (12, 16))
    assert duration / scale == pytest.approx(13 * 0.1 + 1.0, abs=0.04)


def test_without_ffmpeg_the_way_out_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.setitem(sys.modules, 'imageio_ffmpeg', None)
    with pytest.raises(MissingDependencyError, match=r'ffmpeg.*not on the PATH.*\.gif needs no'):
        write_video(tmp_path / 'x.mp4', [Frame(bar(3), 0.1)])
    assert not (tmp_path / 'x.mp4').exists()


def test_without_pillow_it_is_named(monkeypatch, tmp_path):
    for name in ('PIL', 'PIL.Image'):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependencyError, match='Pillow'):
        write_video(tmp_path / 'x.gif', [Frame(bar(3), 0.1)])


@pytest.mark.parametrize(('name', 'frames', 'message'), [
    ('x.webm', [Frame(bar(3), 0.1)], r"'.*x\.webm', expected .*\['\.gif', '\.mp4'\]"),
    ('x', [Frame(bar(3), 0.1)], r"expected .*\['\.gif', '\.mp4'\]"),
    ('x.gif', [], 'has 0 frames, expected at least 1'),
])
def test_what_cannot_be_written_is_refused(tmp_path, name, frames, message):
    with pytest.raises(InvalidInputError, match=message):
        write_video(tmp_path / name, frames)
