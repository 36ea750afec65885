# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Formulas between dollars as MathML, which browsers draw without a script.

Where GitHub shows `$…$` and `$$…$$` as formulas, the site does too; dollars in code stay.
"""

import re
from typing import Any

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.preprocessors import Preprocessor

CODE_OR_FORMULA = re.compile(
    r'(?P<code>(?P<ticks>`+)(?!`).+?(?<!`)(?P=ticks)(?!`))'
    r'|\$\$(?P<block>.+?)\$\$'
    r'|(?<![\\$\w])\$(?P<inline>[^\s$](?:[^$]*?[^\s$\\])?)\$(?![\w$])', re.DOTALL)
AFTER_FENCES = 24
"""Priority: code between fences is gone by then (25), and raw HTML is not yet looked for (20)."""


def to_mathml(latex: str, display: str) -> str:
    """Return the formula as MathML; raise ValueError at a command that is not known."""
    mathml = convert(' '.join(latex.split()), display=display)
    unknown = re.findall(r'\\[A-Za-z]+', mathml)
    if unknown:
        raise ValueError(f'{unknown} in ${latex}$ cannot be shown as MathML')
    return mathml


class _Formulas(Preprocessor):
    def run(self, lines: list[str]) -> list[str]:
        return CODE_OR_FORMULA.sub(self._replace, '\n'.join(lines)).split('\n')

    def _replace(self, found: re.Match[str]) -> str:
        if found['code']:
            return found[0]
        display = 'block' if found['block'] is not None else 'inline'
        mathml = to_mathml(found['block'] or found['inline'], display)
        return str(self.md.htmlStash.store(mathml))


class FormulaExtension(Extension):
    """The extension of Python-Markdown, to be named as an object in its list of extensions."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802 - its name
        """Put the formulas into the chain of preprocessors."""
        md.preprocessors.register(_Formulas(md), 'formulas', AFTER_FENCES)


def makeExtension(**options: Any) -> FormulaExtension:  # noqa: N802 - what Python-Markdown calls
    """Return the extension."""
    return FormulaExtension(**options)
