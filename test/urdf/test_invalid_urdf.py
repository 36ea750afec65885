# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Error messages of the URDF parser.

A description with a DTD, or a description that is too large, is rejected before parsing.
"""

import re
import resource

from fault_table import fault
from one_joint_urdf import INERTIA, JOINT, joint_of, link_of, LINKS, mimics, robot
import pytest
from robot_dynamics.exceptions import ModelError, RobotDynamicsError
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.description_file import read_description
from robot_dynamics.urdf.document import find_dtd
from robot_dynamics.urdf.parser import parse_urdf
from robots import robot_path


def refusal(xml):
    with pytest.raises(ModelError) as caught:
        parse_urdf(xml)
    assert isinstance(caught.value, RobotDynamicsError)
    assert isinstance(caught.value, ValueError)
    return str(caught.value)


MASS = '<mass value="1.5"/>'
SECOND_JOINT = JOINT.replace('turn', 'back')
TIP = '<link name="tip"/>'


def joining(name, parent, child):
    return (f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
            '</joint>')


KINDS = "expected one of ['revolute', 'continuous', 'prismatic', 'fixed']"
LOOP = 'form a closed loop that hangs on no root, expected a tree'
XACRO = 'expected the URDF that the program xacro makes of it'

REFUSALS = [
    (' \n ', ' is empty, expected the XML of a URDF'),
    ('<sdf version="1.6"/>', ' has the root element <sdf>, expected <robot>'),
    (robot(''), ": robot 'bot' has no links, expected at least two"),
    (robot(LINKS + JOINT.replace('name="turn" ', '')), ': a <joint> has no name'),
    (robot(LINKS + JOINT + '<link name="arm"/>'), ": two links are named 'arm'"),
    (robot(LINKS + JOINT + JOINT), ": two joints are named 'turn'"),
    (joint_of('', 'floating'),
     f": joint 'turn' is of type 'floating': an arm needs a fixed base, {KINDS}"),
    (robot(LINKS + JOINT.replace(' type="revolute"', '')),
     f": joint 'turn' is of type '', {KINDS}"),
    (robot(LINKS + JOINT.replace('"base"', '"floor"')),
     ": joint 'turn': parent link is 'floor', expected one of ['base', 'arm']"),
    (robot(LINKS + JOINT.replace('<child link="arm"/>', '')),
     ": joint 'turn': child link is missing, expected one of ['base', 'arm']"),
    (joint_of('', limit=''), ": joint 'turn' is revolute and has no <limit>, which URDF requires: "
     'a joint without limits has the type continuous'),

    (robot('<xacro:include filename="arm.xacro"/>', 'xmlns:xacro="http://www.ros.org/xacro"'),
     f' is a xacro file, it has <xacro:include>, {XACRO}'),
    (robot(f'{LINKS}{JOINT}<xacro:macro name="leg" params="side"/>',
           'name="bot" xmlns:xacro="http://wiki.ros.org/xacro"'),
     f" is a xacro file, it has <xacro:macro name='leg'>, {XACRO}"),
    (robot('', 'xmlns:xacro="http://wiki.ros.org/xacro"'),
     ": robot '' has no links, expected at least two: its text declares xmlns:xacro, is it a "
     'xacro file without its robot?'),
]


@pytest.mark.parametrize(('xml', 'words'), REFUSALS)
def test_message_on(xml, words):
    assert refusal(xml) == f'robot_description{words}'


@pytest.mark.parametrize(('more', 'words'), [
    (SECOND_JOINT, "link 'arm' is the child of two joints, 'turn' and 'back': a closed loop, "
     'expected a tree'),
    (TIP, "links ['base', 'tip'] all have no parent, expected one root"),
    (joining('back', 'arm', 'base'), f"links ['base', 'arm'] {LOOP}"),
    (TIP + '<link name="top"/>' + joining('up', 'tip', 'top') + joining('down', 'top', 'tip'),
     f"links ['tip', 'top'] {LOOP}"),
    (TIP + joining('self', 'tip', 'tip'), f"links ['tip'] {LOOP}"),
])
def test_message_on_what_is_no_tree(more, words):
    assert refusal(robot(LINKS + JOINT + more)) == f'robot_description: {words}'


@pytest.mark.parametrize(('element', 'words'), [
    ('<limit lower="1.5" upper="-1"/>', 'lower=1.5 is above upper=-1'),
    ('<limit lower="inf" upper="inf"/>', 'lower=inf, upper=inf, expected a range that holds a '
     'position in [-1e+09, 1e+09]'),
    ('<limit lower="-pi" upper="2"/>', "lower='-pi', expected a number"),
    ('<limit effort="a lot"/>', "effort='a lot', expected a number"),
    ('<dynamics friction="-1"/>', 'friction=-1, expected a number >= 0'),
    ('<axis xyz="0 0 0"/>', 'axis is zero, expected a direction'),
    ('<axis xyz="0 1"/>', "xyz='0 1', expected three numbers"),
    ('<origin xyz="0 nan 1"/>', "origin: xyz='0 nan 1', expected three numbers"),
])
def test_message_on_an_element_of_a_joint(element, words):
    xml = joint_of('', limit=element) if element.startswith('<limit') else joint_of(element)
    assert refusal(xml) == f"robot_description: joint 'turn': {words}"


@pytest.mark.parametrize(('inside', 'words'), [
    (f'<mass value="1 kg"/>{INERTIA}', "value='1 kg', expected a number"),
    (INERTIA, 'mass is nan, expected a number >= 0'),
    (f'<mass value="-2"/>{INERTIA}', 'mass is -2, expected a number >= 0'),
    (f'<mass value="inf"/>{INERTIA}', 'mass is inf, expected a number >= 0'),
    (MASS + INERTIA.replace(' iyz="0"', ''), 'iyz is nan, expected a number'),
    (MASS + INERTIA.replace('ixx="1"', 'ixx="nan"'), "ixx='nan', expected a number"),
    (f'<origin xyz="0 0"/><mass value="1"/>{INERTIA}',
     "origin: xyz='0 0', expected three numbers"),
])
def test_message_on_an_inertia(inside, words):
    assert refusal(link_of(f'<inertial>{inside}</inertial>')) == (
        f"robot_description: link 'arm': inertial: {words}")


@pytest.mark.parametrize(('relations', 'words'), [
    (['joint="ghost"'], " mimics 'ghost', expected one of ['turn', 'other']"),
    (['joint="third"', 'joint="other"'], " mimics itself, through 'other'"),
    (['joint="turn" multiplier="double"'], ": multiplier='double', expected a number"),
    (['joint="turn" multiplier="inf"'], ': multiplier=inf, expected a finite number'),
])
def test_message_on_a_mimic_relation(relations, words):
    assert refusal(mimics(*(f'<mimic {each}/>' for each in relations))) == (
        f"robot_description: joint 'other'{words}")


@pytest.mark.parametrize('text', [
    '<robot name="bot"><link name="a"></robot>', '<robot name="bot"/><robot name="bot"/>',
    '<robot name="\x00"/>', 'x' * 100_000])
def test_message_on_invalid_xml(text):
    message = refusal(text)
    assert message.startswith('robot_description is not well-formed XML (')
    assert message.endswith(f'), expected a URDF; it begins with {text[:40]!r}')
    assert len(message) < 250


@pytest.mark.parametrize('kind', ['revolute', 'continuous', 'prismatic'])
def test_a_negative_effort_or_velocity_limit_is_refused(kind):
    for attribute, value in (('velocity', '-inf'), ('effort', '-1e-300')):
        assert refusal(joint_of('', kind, f'<limit {attribute}="{value}"/>')) == (
            f"robot_description: joint 'turn': {attribute}={value}, expected >= 0 (0: unknown)")


def test_as_many_links_as_may_be_are_read_and_no_more():
    def chain(links):
        body = ''.join(f'<link name="l{i}"/>' for i in range(links))
        return robot(body + ''.join(
            f'<joint name="j{i}" type="fixed"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/></joint>' for i in range(links - 1)))

    assert len(parse_urdf(chain(500)).link_names) == 500
    with pytest.raises(ModelError, match='has 501 links, expected at most 500'):
        parse_urdf(chain(501))


def test_as_many_tags_as_may_be_are_read_and_no_more():
    text = robot(LINKS + JOINT + '{}')
    more = 100_000 - text.count('<')
    assert parse_urdf(text.format('<a/>' * more)).joint('turn').moves
    with pytest.raises(ModelError, match='has 100001 tags, expected at most 100000'):
        parse_urdf(text.format('<a/>' * (more + 1)))


def test_a_xacro_leftover_of_a_real_package_is_recognized():
    left_over = robot_path('ur3').with_name('ur3.urdf').read_text(encoding='utf-8')
    assert re.search('has no links.*xacro file without its robot', refusal(left_over))


ARM = default_arm_urdf()
LARGEST_DESCRIPTION = 10_000_000
DTD = '<!DOCTYPE robot [<!ENTITY e "x">]>'
REFUSED = r"has a document type declaration \(DTD\), '<!DOCTYPE robot .*expected a URDF without"


def amplified():
    """Return a robot of 390 KB with 9 million elements, fewer than the parser's own limit."""
    entity, padding = '<a/>' * 20_000, 'x' * 305_000
    return (f'<!DOCTYPE robot [<!ENTITY e "{entity}"><!--{padding}-->]>'
            f'<robot name="r">{"&e;" * 450}</robot>')


@pytest.mark.parametrize('read', [
    pytest.param(parse_urdf, marks=fault(
        'External files and web pages',
        'a robot description of 390 KB whose DTD expands to 9 million elements',
        'rejected before it is parsed; the message names the DTD')),
    check_model])
def test_entities_are_refused_before_they_expand(read):
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ModelError, match=REFUSED):
        read(amplified())
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < 50_000  # [KiB]


@pytest.mark.parametrize('before', [
    '', ' \n', '\ufeff', '<?xml version="1.0"?>\n', '<!-- a > comment --><!---->',
    '<?xml version="1.0" encoding="UTF-16"?><?style x="<robot>"?>\n<!-- <robot/> -->\t'])
def test_a_dtd_is_found_wherever_xml_allows_it(before):
    with_dtd, without = (before + part for part in (f'{DTD}<robot/>', f'<robot>{DTD}</robot>'))
    for encode in (str, *(lambda text, encoding=encoding: text.encode(encoding) for encoding in (
            'utf-8-sig', 'utf-16', 'utf-16-le', 'utf-16-be'))):
        assert find_dtd(encode(with_dtd)).startswith('<!DOCTYPE robot')
        assert find_dtd(encode(without)) == ''


def test_a_prolog_that_does_not_end_is_searched_once():
    """A search per comment would take hours."""
    assert find_dtd('<!--' * 250_000).startswith('<!--')
    assert find_dtd('<?a?>' * 200_000 + '<?') == ''


@pytest.mark.parametrize('name', ['arm.urdf', 'arm.xacro'])
def test_a_file_with_a_dtd_or_too_large_is_refused(tmp_path, name):
    file = tmp_path / name
    for encoding in ('utf-8', 'utf-16'):
        file.write_text(DTD + ARM, encoding=encoding)
        with pytest.raises(ModelError, match=rf"URDF '.*{name}' {REFUSED}"):
            read_description(file, 'URDF')
    file.write_text(ARM.ljust(LARGEST_DESCRIPTION + 1))
    with pytest.raises(ModelError, match=rf"{name}' has more than 10000000 bytes"):
        read_description(file, 'URDF')


def test_a_description_that_is_too_large_is_refused():
    parse_urdf(ARM.ljust(LARGEST_DESCRIPTION))
    with pytest.raises(ModelError, match='has more than 10000000 characters'):
        parse_urdf(ARM.ljust(LARGEST_DESCRIPTION + 1))


def test_a_file_with_the_line_ends_of_windows_is_read(tmp_path):
    (tmp_path / 'arm.urdf').write_bytes(ARM.replace('\n', '\r\n').encode())
    assert read_description(tmp_path / 'arm.urdf', 'URDF') == ARM
