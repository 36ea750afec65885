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


"""Measure and draw docs/images/growth.png: what a call costs as an arm gets more joints."""

from pathlib import Path
import sys

from benchmarks.growth import (
    exponent,
    INVERSE_DYNAMICS,
    JOINTS,
    linear_fit,
    LONG,
    measure,
    report,
)
import numpy as np
from robot_dynamics.reporting.figures import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    styled_figure,
    VERMILION,
)

LOOKS = {
    INVERSE_DYNAMICS: (BLUE, '-'), 'gravity': (GREEN, '--'), 'mass matrix': (ORANGE, '-'),
    'Coriolis matrix': (VERMILION, '--'), 'all terms': (PURPLE, '-.'),
    'forward dynamics': (SKY, '-')}


def main(directory: Path) -> None:
    """Write the picture into a directory, and print the table of the same measurement."""
    times, n = measure(), np.array(JOINTS, dtype=np.float64)
    report(times)
    with styled_figure(10.0, 3.8) as figure:
        every, inverse = figure.subplots(1, 2)
        for name, values in times.items():
            colour, dash = LOOKS[name]
            every.loglog(n, 1e6 * values, color=colour, linestyle=dash, marker='.',
                         label=f'{name}, $n^{{{exponent(values):.2f}}}$ from {LONG} on')
        every.set(xlabel='joints n', ylabel='time a call [µs]',
                  title='What a call costs as the arm grows')
        every.set_xticks(JOINTS, [str(joints) for joints in JOINTS])
        every.minorticks_off()
        every.set_ylim(top=20.0 * every.get_ylim()[1])  # room for the legend
        every.legend(frameon=False)

        values = times[INVERSE_DYNAMICS]
        line = linear_fit(values)
        inverse.plot(n, 1e6 * (line.a + line.b * n), color=BLACK, linewidth=1.0, label=(
            f'{1e6 * line.a:.1f} µs + {1e6 * line.b:.2f} µs · n, $R^2$ = {line.r_squared:.4f}'))
        inverse.plot(n, 1e6 * values, color=BLUE, linestyle='', marker='o', label='measured')
        inverse.set(xlabel='joints n', ylabel='time a call [µs]', xlim=(0.0, None),
                    ylim=(0.0, None), title='Inverse dynamics')
        inverse.legend(frameon=False)
        figure.savefig(directory / 'growth.png')


if __name__ == '__main__':
    main(Path(sys.argv[1]))
