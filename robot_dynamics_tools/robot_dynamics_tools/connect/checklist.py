# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of a connection: one printed line per check, and the verdicts of the report."""

from typing import NamedTuple

from robot_dynamics.model_check.html_page import Grade, Verdict

GOOD, CHECK, BAD, UNKNOWN = Grade.GOOD, Grade.CHECK, Grade.BAD, Grade.UNKNOWN


class Check(NamedTuple):
    """One check: its name, its grade, the value, what is expected, and what to do if it is not."""

    name: str
    grade: Grade
    value: str
    expected: str
    remedy: str = ''

    @property
    def line(self) -> str:
        remedy = f'; to do: {self.remedy}' if self.remedy else ''
        return f'{self.grade.value[0]:8} {self.name}: {self.value} (expected: {self.expected})' + (
            remedy)

    @property
    def verdict(self) -> Verdict:
        return Verdict(
            self.name, self.grade, f'{self.value} (expected: {self.expected})', self.remedy)


class Checklist(list[Check]):
    """The checks so far; each is printed when it is added."""

    def add(
        self, name: str, grade: Grade | bool, value: str, expected: str, remedy: str = '',
    ) -> None:
        """Add a check; a grade True is GOOD, False CHECK. GOOD has no remedy."""
        if not isinstance(grade, Grade):
            grade = GOOD if grade else CHECK
        self.append(Check(name, grade, value, expected, '' if grade is GOOD else remedy))
        print(self[-1].line, flush=True)

    @property
    def bad(self) -> list[Check]:
        """The checks that forbid a parameter file."""
        return [check for check in self if check.grade is BAD]
