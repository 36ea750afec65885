# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Animation files: GIF by Pillow, MP4 by ffmpeg.

A frame may have any duration, so that a pause costs one frame in a GIF. All frames of a GIF share
one palette without dithering: unchanged areas are bit-identical, and are not stored again.

Frames go to ffmpeg through a pipe of this module. `imageio_ffmpeg.write_frames` does not check
the exit status of ffmpeg, so that a path that cannot be written would raise no error; it would
also make the library a requirement where ffmpeg is installed already.
"""

from collections.abc import Iterable
from contextlib import suppress
from itertools import chain
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.dependencies import install_command, optional
from robot_dynamics.exceptions import InvalidInputError, MissingDependencyError

FORMATS = ('.gif', '.mp4')
MP4_RATE = 30
"""Frames per second of an MP4."""
_COLOURS = 127
"""Colours of the palette of a GIF, without the one of unchanged pixels; few make small files."""
_PAUSES = 4
"""Number of the frames shown longest, whose colours the palette contains."""
_LOOKED_AT = 16
"""Number of frames from which the palette is chosen."""
_SHORTEST = 0.02
"""Shortest duration [s] of a frame of a GIF; viewers slow shorter ones down."""

Pixels = npt.NDArray[np.uint8]


class Frame(NamedTuple):
    """Pixels (height, width, 3), and for how long they are shown [s]."""

    pixels: Pixels
    seconds: float


def check_format(path: Path) -> None:
    """
    Raise an error if the name of this path does not permit writing an animation.

    InvalidInputError for another suffix, MissingDependencyError without the program.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InvalidInputError(
            f'the picture is {str(path)!r}, expected a name that ends in one of {list(FORMATS)}')
    if suffix == '.mp4':
        _ffmpeg()


def write_video(path: Path, frames: Iterable[Frame]) -> int:
    """
    Write the frames, all of one size, to a .gif or .mp4, and return how many there were.

    Raises as `check_format`, InvalidInputError without a frame, and OSError.
    """
    check_format(path)
    others = iter(frames)
    first = next(others, None)
    if first is None:
        raise InvalidInputError('the moving picture has 0 frames, expected at least 1')
    return (_write_gif if path.suffix.lower() == '.gif' else _write_mp4)(path, first, others)


def _write_gif(path: Path, first: Frame, others: Iterable[Frame]) -> int:
    image = optional('PIL.Image', 'a GIF')
    kept = [first, *others]
    pauses = sorted(kept, key=lambda frame: frame.seconds)[-_PAUSES:]
    some = np.concatenate([frame.pixels for frame in (
        *kept[::max(1, len(kept) // _LOOKED_AT)], *pauses)], axis=1)
    palette = image.fromarray(some).quantize(
        _COLOURS, method=image.Quantize.MAXCOVERAGE, dither=image.Dither.NONE)
    begin, *rest = (
        image.fromarray(frame.pixels).quantize(palette=palette, dither=image.Dither.NONE)
        for frame in kept)
    begin.save(
        path, format='GIF', save_all=True, append_images=rest, loop=0, optimize=False,
        palette=bytes(palette.getpalette()),  # the same for all frames
        duration=_milliseconds([frame.seconds for frame in kept]))
    return len(kept)


def _milliseconds(seconds: list[float]) -> list[int]:
    """Return times in the steps of a GIF, 10 ms, with the same sum as the seconds."""
    ends = np.round(100.0 * np.cumsum(np.maximum(seconds, _SHORTEST))).astype(int)
    return [10 * int(step) for step in np.diff(ends, prepend=0)]


def _write_mp4(path: Path, first: Frame, others: Iterable[Frame]) -> int:
    """Pass each frame to ffmpeg as often as its duration at MP4_RATE requires."""
    count, shown, due = 0, 0, 0.0
    # The pixel format that every player supports needs even sizes.
    height, width = (size // 2 * 2 for size in first.pixels.shape[:2])
    command = [
        _ffmpeg(), '-y', '-loglevel', 'error', '-f', 'rawvideo', '-pixel_format', 'rgb24',
        '-video_size', f'{width}x{height}', '-framerate', str(MP4_RATE), '-i', '-',
        '-pix_fmt', 'yuv420p', '-movflags', '+faststart', str(path.absolute())]
    with tempfile.TemporaryFile() as said:
        with suppress(BrokenPipeError), subprocess.Popen(  # ffmpeg has written the reason
                command, stdin=subprocess.PIPE, stdout=said, stderr=said) as process:
            assert process.stdin is not None
            for frame in chain([first], others):
                count += 1
                due += frame.seconds * MP4_RATE
                while shown < max(round(due), 1):
                    process.stdin.write(frame.pixels[:height, :width].tobytes())
                    shown += 1
        if process.returncode:
            said.seek(0)
            reason = said.read().decode(errors='replace').strip().splitlines()
            raise OSError(f'ffmpeg failed: {reason[-1] if reason else process.returncode}')
    return count


def _ffmpeg() -> str:
    found = shutil.which('ffmpeg')
    if found is not None:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise MissingDependencyError(
            'an MP4 needs the program ffmpeg, which is not on the PATH (sudo apt install ffmpeg, '
            f'or {install_command("imageio_ffmpeg")}); a .gif needs no more than Pillow') from None
