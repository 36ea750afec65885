# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Install the nodes and the library as an ament_python package."""

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
    'check_model': 'robot_dynamics.tools.command_line:execute',
    'planar_urdf': 'robot_dynamics.tools.command_line:execute',
}
# colcon installs executables into lib/robot_dynamics, for `ros2 run`. A wheel (pip install) puts
# them on the PATH, where their names must not be those of other programs.
is_wheel = {'bdist_wheel', 'dist_info', 'editable_wheel'} & set(sys.argv)
prefix = f'{package_name}_' if is_wheel else ''
here = Path(__file__).resolve().parent
manifest = ElementTree.parse(here / 'package.xml')
maintainer = manifest.find('maintainer')


def check_interfaces():
    """Stop a build by colcon that has not found the nested packages."""
    name = f'{package_name}_interfaces'
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    if not any(Path(prefix, 'share', name, 'package.xml').exists() for prefix in prefixes):
        sys.exit(f'{package_name} needs the package {name} in its directory, which colcon does '
                 f'not search. Run: colcon build --base-paths {here.parent} {here / name} '
                 f'{here / f"{package_name}_tools"}')


# Packages of Debian are built with --root, and pip builds a wheel: neither needs the messages.
is_installed = {'develop', 'install'} & set(sys.argv) and '--help' not in sys.argv
has_root = any(argument.startswith('--root') for argument in sys.argv)
if is_installed and not has_root and 'AMENT_PREFIX_PATH' in os.environ:
    check_interfaces()

setup(
    name=package_name,
    version='0.1.0',  # see scripts/release
    packages=find_packages(include=['robot_dynamics', 'robot_dynamics.*']),
    package_data={package_name: ['py.typed', 'model_check/report.css']},
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
    install_requires=['setuptools', 'numpy', 'pin', 'pyyaml'],
    extras_require={
        'test': ['pytest'],  # `colcon test` runs pytest because of this line
        'robots': ['example-robot-data'],  # descriptions by name, such as ur10
        'scipy': ['scipy'],  # the discrete model of an arm
        'xacro': ['xacro'],
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
            f'{prefix}{name} = {function}' for name, function in EXECUTABLES.items()],
    },
)
