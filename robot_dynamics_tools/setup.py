# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Install the tools of robot_dynamics as an ament_python package."""

from glob import glob
from pathlib import Path
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'robot_dynamics_tools'
EXECUTABLES = {
    'analyze': '__main__:tool',
    'animate': '__main__:tool',
    'calibrate_gravity': '__main__:tool',
    'connect': '__main__:tool',
    'demo': '__main__:tool',
    'dynamics': '__main__:main',
    'dynamics_monitor': 'monitor.entry_points:dynamics_monitor',
    'estimate_payload': '__main__:tool',
    'excite': '__main__:tool',
    'export_mjcf': '__main__:tool',
    'identify': '__main__:tool',
    'learn_contact_levels': '__main__:tool',
    'mujoco_arm': 'mujoco.entry_point:mujoco_arm',
    'torque_map': '__main__:tool',
    'viewer': '__main__:tool',
}
# colcon installs executables into lib/robot_dynamics_tools, for `ros2 run`. A wheel (pip install)
# puts them on the PATH, where their names must not be those of other programs.
is_wheel = {'bdist_wheel', 'dist_info', 'editable_wheel'} & set(sys.argv)
prefix = 'robot_dynamics_' if is_wheel else ''
manifest = ElementTree.parse(Path(__file__).resolve().parent / 'package.xml')
maintainer = manifest.find('maintainer')


setup(
    name=package_name,
    version='0.1.0',  # see scripts/release
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
    ],
    python_requires='>=3.10',
    install_requires=[
        'setuptools', 'robot_dynamics', 'matplotlib', 'numpy', 'pillow', 'pyyaml',
        'rosbags', 'scipy', "backports.zstd; python_version < '3.14'"],
    extras_require={
        'test': ['pytest'],  # `colcon test` runs pytest because of this line
        'parquet': ['pyarrow'],  # of analyze
        'report': ['bokeh>=3.4'],  # zoom in the figures of HTML reports
        'dask': ['distributed'],  # of tools that take many recordings
        'mujoco': ['mujoco>=3.2'],  # the node mujoco_arm
        'completion': ['argcomplete'],  # of `robot_dynamics_dynamics` in a shell
        'viewer': ['pycollada', 'trimesh', 'viser~=1.1', 'websockets'],  # in a browser
        'video': ['imageio-ffmpeg'],  # MP4 where no ffmpeg is installed
        # other engines, for the benchmarks: requirements/peers.txt
        'peers': ['drake', 'dynibo', 'mujoco[sysid]>=4', 'roboticstoolbox-python>=1.5'],
    },
    zip_safe=False,
    author=manifest.findtext('author'),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    description=manifest.findtext('description'),
    license=manifest.findtext('license'),
    license_files=['LICENSE'],
    entry_points={
        'console_scripts': [
            f'{prefix}{name} = {package_name}.{function}'
            for name, function in EXECUTABLES.items()],
        # `ros2 dynamics`, where there is ros2cli
        'ros2cli.command': [
            f'dynamics = {package_name}.ros2_dynamics.ros2cli:DynamicsCommand',
        ],
    },
)
