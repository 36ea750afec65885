# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Print the number of words of each page for users, and of the appendix.

The pages are README.md and docs/*.md. The appendix is what scripts write and measure:
docs/reference and docs/evidence. A word contains a letter or a digit,
also in code and tables; their bars do not count.
"""

from collections.abc import Iterable
from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
NOT_FOR_USERS = 'architecture.md', 'contributing.md', 'index.md', 'releasing.md'
"""For contributors, and the pages into which docs/conf.py inserts README and CONTRIBUTING."""
MOST_PAGES, MOST_WORDS = 25, 25_000
"""For users, README included."""


def pages() -> list[Path]:
    """Return the pages for users."""
    return [ROOT / 'README.md', *(page for page in sorted((ROOT / 'docs').glob('*.md'))
                                  if page.name not in NOT_FOR_USERS)]


def appendix() -> list[Path]:
    """Return the pages that scripts write, and measured results."""
    return sorted((ROOT / 'docs').glob('*/*.md'))


def words(files: Iterable[Path]) -> int:
    """Return the number of words of all files."""
    return sum(
        bool(re.search(r'\w', word))
        for file in files for word in file.read_text(encoding='utf-8').split())


def main() -> None:
    """Print one line per page, and the sums."""
    for page in pages():
        print(f'{words([page]):7,}  {page.relative_to(ROOT)}')
    print(f'{words(pages()):7,}  {len(pages())} pages, at most {MOST_WORDS:,} and {MOST_PAGES}')
    print(f'{words(appendix()):7,}  appendix: docs/reference and docs/evidence')


if __name__ == '__main__':
    main()
