# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""A description with a DTD, or a description that is too large, is rejected before parsing."""

import resource

from fault_table import fault
import pytest
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model_check.checks import check_model
from robot_dynamics.planar.urdf import default_arm_urdf
from robot_dynamics.urdf.description_file import read_description
from robot_dynamics.urdf.document import find_dtd
from robot_dynamics.urdf.parser import parse_urdf

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
