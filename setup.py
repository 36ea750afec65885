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

"""Install the nodes, the library and the tools as an ament_python package."""

from glob import glob
import sys

from setuptools import find_packages, setup

package_name = 'robot_dynamics'
EXECUTABLES = {
    'dynamics_node': 'robot_dynamics.ros.entry_points:dynamics_node',
    'simulated_arm': 'robot_dynamics.ros.entry_points:simulated_arm',
    'analyze_bag': 'robot_dynamics.tools.analyze_bag:main',
    'animate': 'robot_dynamics.tools.animate:main',
    'check_model': 'robot_dynamics.tools.check_model:main',
    'demo': 'robot_dynamics.tools.demo.cli:main',
    'dynamics': 'robot_dynamics.tools.ros2_dynamics.verbs:main',
    'excite': 'robot_dynamics.tools.excite:main',
    'identify': 'robot_dynamics.tools.identify:main',
    'planar_urdf': 'robot_dynamics.tools.planar_urdf:main',
    'torque_map': 'robot_dynamics.tools.torque_map:main',
    'viewer': 'robot_dynamics.tools.viewer.cli:main',
}
# colcon installs executables into lib/robot_dynamics, for `ros2 run`. A wheel (pip install) puts
# them on the PATH, where their names must not be those of other programs.
is_wheel = {'bdist_wheel', 'dist_info', 'editable_wheel'} & set(sys.argv)
prefix = f'{package_name}_' if is_wheel else ''

setup(
    name=package_name,
    version='0.1.0',
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
        'dask': ['distributed'],  # of tools that take many recordings
        'xacro': ['xacro'],
        'completion': ['argcomplete'],  # of `robot_dynamics_dynamics` in a shell
        'viewer': ['pycollada', 'trimesh', 'viser~=1.1', 'websockets'],  # in a browser
        'video': ['imageio-ffmpeg'],  # MP4 where no ffmpeg is installed
        # other engines, for the benchmarks: requirements/peers.txt
        'peers': ['drake', 'mujoco>=4', 'roboticstoolbox-python>=1.5'],
    },
    zip_safe=False,
    maintainer='The robot_dynamics authors',
    maintainer_email='maintainers@robot-dynamics.example',
    description='Which joint torques produce a motion? Dynamics of robot arms with a URDF.',
    license='Apache-2.0',
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
            'check = robot_dynamics.tools.ros2_dynamics.ros2cli:CheckVerb',
            'payload = robot_dynamics.tools.ros2_dynamics.ros2cli:PayloadVerb',
            'status = robot_dynamics.tools.ros2_dynamics.ros2cli:StatusVerb',
        ],
    },
)
