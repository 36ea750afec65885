# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The log of the model check of a node, compared with the tool check_model."""

from robot_dynamics.model.arm import load_arm
from robot_dynamics.model_check.mesh_bounds import MeshReader
from robot_dynamics.model_check.mesh_check import lines_of_meshes
from robot_dynamics.model_check.report import check_description
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.ros.dynamics.model_source import check_or_refuse
from robots import robot_path


class Log(list[str]):
    """The lines that a logger gets."""

    warning = info = list.append


def test_tool_and_node_report_what_their_counts_cover():
    """The tool reads the meshes of the UR10, the node does not."""
    path = robot_path('ur10')
    xml = path.read_text(encoding='utf-8')
    tool = check_description(xml, meshes=MeshReader(path.parent))
    log = Log()
    check_or_refuse(xml, load_arm(xml), {'ignore_checks': []}, log)
    assert (tool.counts, len(log)) == ('0 errors, 8 warnings', 6)
    assert log[-1].startswith(
        'Model check: 0 errors, 5 warnings. Scope: links compared with their shapes only, meshes '
        'are not read (not compared: 7 links); largest gravity torque searched from 128 positions')
    assert 'The tool check_model also reads meshes' in log[-1]
    assert 'shapes and meshes; largest gravity torque searched from 512 positions' in tool.scope
    assert 'dynamics_node reads meshes of installed packages only' in tool.scope


def test_the_meshes_of_installed_packages_are_read_in_another_process(monkeypatch):
    path = robot_path('ur10')
    xml = path.read_text(encoding='utf-8')
    assert lines_of_meshes(xml) == []  # the package is not in the environment of ROS
    prefix = next(parent for parent in path.parents if parent.name == 'share').parent
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    lines, known = lines_of_meshes(xml), check_description(xml).findings
    of_tool = check_description(xml, meshes=MeshReader(path.parent)).findings
    assert len(lines) == 3
    assert lines == [str(finding) for finding in of_tool if finding not in known]


def test_a_node_is_silent_on_a_model_that_it_checks_completely():
    log = Log()
    check_or_refuse(default_arm_urdf(), load_arm(default_arm_urdf()), {'ignore_checks': []}, log)
    assert log == []
