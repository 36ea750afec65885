# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""What MkDocs calls: pages of files outside docs/ and of the code, links, formulas, anchors."""

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
import posixpath

from mathml import FormulaExtension
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files, InclusionLevel
from python_pages import python_pages
from site_links import (
    CODE,
    code_page,
    github_slug,
    links,
    PAGES_OF_FILES,
    ROOT,
    target_in_site,
    with_links_of_site,
)

FONT = 'STIXTwoMath-Regular.ttf'
"""Of the formulas; site.css names it. Licence: SIL OFL 1.1."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Give headings the anchors that they have on GitHub, and show formulas."""
    config.mdx_configs['toc']['slugify'] = github_slug
    config.markdown_extensions.append(FormulaExtension())
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are no files of docs/, links rewritten, and those that they link to."""
    made = {page: ((ROOT / name).read_text(encoding='utf-8'), name)
            for name, page in PAGES_OF_FILES.items()}
    for file in files.documentation_pages():
        made[file.src_uri] = (file.content_string, f'docs/{file.src_uri}')
    code = _linked_code(made)
    for page, (text, source) in made.items():
        try:
            text = with_links_of_site(text, source, page)
        except ValueError as error:
            raise PluginError(f'{page}: {error}') from None
        _replace(files, config, page, text)
    for page, text in {**code, **python_pages()}.items():
        _replace(files, config, page, text)
    font = Path(str(resources.files('ziamath').joinpath('fonts', FONT)))
    files.append(File.generated(config, f'fonts/{FONT}', abs_src_path=str(font)))
    return files


def _linked_code(made: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """Return a page for each file of the repository that a page links to, and is no page."""
    found = {}
    for page, (text, source) in made.items():
        for link in links(text):
            try:
                target = target_in_site(link, source).partition('#')[0]
            except ValueError as error:
                raise PluginError(f'{page}: {error}') from None
            if target.startswith(f'{CODE}/'):
                found[target] = code_page(
                    posixpath.relpath(target, CODE).removesuffix('.md'))
    return found


def _replace(files: Files, config: MkDocsConfig, page: str, text: str) -> None:
    before = files.get_file_from_path(page)
    if before is not None:
        files.remove(before)
    level = (InclusionLevel.NOT_IN_NAV if page.startswith((f'{CODE}/', 'reference/python/'))
             else InclusionLevel.INCLUDED)
    files.append(File.generated(config, page, content=text, inclusion=level))
