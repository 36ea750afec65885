# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Install the nodes, the library and the tools as an ament_python package."""

from glob import glob
import os
from pathlib import Path
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'robot_dynamics'
EXECUTABLES = {
    'dynamics_node': 'robot_dynamics.ros.entry_points:dynamics_node',
    'simulated_arm': 'robot_dynamics.ros.entry_points:simulated_arm',
    'mujoco_arm': 'robot_dynamics.ros.entry_points:mujoco_arm',
    'analyze_bag': 'robot_dynamics.tools.analyze_bag:main',
    'animate': 'robot_dynamics.tools.animate:main',
    'calibrate_gravity': 'robot_dynamics.tools.calibrate_gravity:main',
    'check_model': 'robot_dynamics.tools.check_model:main',
    'demo': 'robot_dynamics.tools.demo.cli:main',
    'dynamics': 'robot_dynamics.tools.ros2_dynamics.cli:main',
    'dynamics_monitor': 'robot_dynamics.tools.monitor.entry_points:dynamics_monitor',
    'estimate_payload': 'robot_dynamics.tools.estimate_payload:main',
    'excite': 'robot_dynamics.tools.excite:main',
    'export_mjcf': 'robot_dynamics.tools.export_mjcf:main',
    'identify': 'robot_dynamics.tools.identify:main',
    'planar_urdf': 'robot_dynamics.tools.planar_urdf:main',
    'torque_map': 'robot_dynamics.tools.torque_map:main',
    'viewer': 'robot_dynamics.tools.viewer.cli:execute',
}
# colcon installs executables into lib/robot_dynamics, for `ros2 run`. A wheel (pip install) puts
# them on the PATH, where their names must not be those of other programs.
is_wheel = {'bdist_wheel', 'dist_info', 'editable_wheel'} & set(sys.argv)
prefix = f'{package_name}_' if is_wheel else ''
here = Path(__file__).resolve().parent
manifest = ElementTree.parse(here / 'package.xml')
maintainer = manifest.find('maintainer')


def check_interfaces():
    """Stop a build by colcon that has not found the nested package of the messages."""
    name = f'{package_name}_interfaces'
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    if not any(Path(prefix, 'share', name, 'package.xml').exists() for prefix in prefixes):
        sys.exit(f'{package_name} needs the package {name} in its directory, which colcon does '
                 f'not search. Run: colcon build --base-paths {here.parent} {here / name}')


# Packages of Debian are built with --root, and pip builds a wheel: neither needs the messages.
is_installed = {'develop', 'install'} & set(sys.argv) and '--help' not in sys.argv
has_root = any(argument.startswith('--root') for argument in sys.argv)
if is_installed and not has_root and 'AMENT_PREFIX_PATH' in os.environ:
    check_interfaces()

setup(
    name=package_name,
    version='0.1.0',  # catkin_prepare_release changes it together with package.xml
    packages=find_packages(include=['robot_dynamics', 'robot_dynamics.*']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/config', glob('config/*.*')),
        (f'share/{package_name}/config/robots', glob('config/robots/*.yaml')),
        (f'share/{package_name}/config/security', glob('config/security/*')),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
        (f'share/{package_name}/rviz', glob('rviz/*.rviz')),
    ],
    python_requires='>=3.10',
    install_requires=['setuptools', 'numpy', 'pin'],
    extras_require={
        'test': ['pytest'],  # `colcon test` runs pytest because of this line
        'tools': [
            'apsw', "backports.zstd; python_version < '3.14'", 'lz4', 'matplotlib', 'mcap',
            'pillow', 'pyyaml', 'rosbags', 'scipy'],
        'parquet': ['pyarrow'],  # of analyze_bag
        'report': ['bokeh>=3.4'],  # zoom in the figures of HTML reports
        'dask': ['distributed'],  # of tools that take many recordings
        'robots': ['example-robot-data'],  # descriptions by name, such as ur10
        'xacro': ['xacro'],
        'mujoco': ['mujoco>=3.2'],  # the node mujoco_arm
        'completion': ['argcomplete'],  # of `robot_dynamics_dynamics` in a shell
        'viewer': ['pycollada', 'trimesh', 'viser~=1.1', 'websockets'],  # in a browser
        'video': ['imageio-ffmpeg'],  # MP4 where no ffmpeg is installed
        # other engines, for the benchmarks: requirements/peers.txt
        'peers': ['drake', 'dynibo', 'mujoco>=4', 'roboticstoolbox-python>=1.5'],
    },
    zip_safe=False,
    author=manifest.findtext('author'),
    maintainer=maintainer.text,
    maintainer_email=maintainer.get('email'),
    url=manifest.findtext('url'),
    description=manifest.findtext('description'),
    license=manifest.findtext('license'),
    license_files=['LICENSE'],
    entry_points={
        'console_scripts': [
            f'{prefix}{name} = {function}' for name, function in EXECUTABLES.items()],
        # `ros2 dynamics`, where there is ros2cli
        'ros2cli.command': [
            'dynamics = robot_dynamics.tools.ros2_dynamics.ros2cli:DynamicsCommand',
        ],
        'ros2cli.extension_point': [
            'robot_dynamics.verb = robot_dynamics.tools.ros2_dynamics.ros2cli:VerbExtension',
        ],
        'robot_dynamics.verb': [
            'inverse = robot_dynamics.tools.ros2_dynamics.ros2cli:InverseVerb',
            'equation = robot_dynamics.tools.ros2_dynamics.ros2cli:EquationVerb',
            'task_space = robot_dynamics.tools.ros2_dynamics.ros2cli:TaskSpaceVerb',
            'pose = robot_dynamics.tools.ros2_dynamics.ros2cli:PoseVerb',
            'check = robot_dynamics.tools.ros2_dynamics.ros2cli:CheckVerb',
            'payload = robot_dynamics.tools.ros2_dynamics.ros2cli:PayloadVerb',
            'estimate_payload = robot_dynamics.tools.ros2_dynamics.ros2cli:EstimatePayloadVerb',
            'learn_contact_levels = robot_dynamics.tools.ros2_dynamics.ros2cli:'
            'LearnContactLevelsVerb',
            'status = robot_dynamics.tools.ros2_dynamics.ros2cli:StatusVerb',
            'move = robot_dynamics.tools.ros2_dynamics.ros2cli:MoveVerb',
            'stop = robot_dynamics.tools.ros2_dynamics.ros2cli:StopVerb',
            'command = robot_dynamics.tools.ros2_dynamics.ros2cli:CommandVerb',
            'reset = robot_dynamics.tools.ros2_dynamics.ros2cli:ResetVerb',
            'retime = robot_dynamics.tools.ros2_dynamics.ros2cli:RetimeVerb',
            'watch = robot_dynamics.tools.ros2_dynamics.ros2cli:WatchVerb',
            'record = robot_dynamics.tools.ros2_dynamics.ros2cli:RecordVerb',
        ],
    },
)
