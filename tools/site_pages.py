"""Hook of mkdocs: the pages of the site that are made from the code.

`configuration.md` has every key of a configuration, `commands.md` every command with its options,
`names.md` what problems and models declare, `library.md` every effect; the list of decisions goes on
their first page.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from tolevo.cli import app
from tools.configuration_page import configuration_page
from tools.declared_pages import effects_page, names_page

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

DECISIONS = "decisions/README.md"
INTRODUCTION = """# Commands

This page is generated from the command line itself. Exit status: 0 done; 1 the run failed; 2 the
input is wrong, with every fault on its own line; 130 interrupted. Results go to files, a short
summary to stdout, progress to stderr.
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    from mkdocs.structure.files import File

    made = {"configuration.md": configuration_page, "commands.md": commands_page,
            "names.md": names_page, "library.md": effects_page}  # fmt: skip
    for name, page in made.items():
        files.append(File.generated(config, name, content=page()))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """List the decisions on their first page."""
    if page.file.src_uri != DECISIONS:
        return markdown
    folder = Path(config.docs_dir) / "decisions"
    return markdown + "\n" + "\n".join(f"- [{_title(one)}]({one.name})" for one in sorted(folder.glob("0*.md")))


def _title(page: Path) -> str:
    return page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def commands_page() -> str:
    """Every command with its arguments and options, as Markdown."""
    commands: dict[str, Any] = getattr(typer.main.get_command(app), "commands")  # noqa: B009
    return "\n".join([INTRODUCTION, *(_command(name, one) for name, one in commands.items())])


def _command(name: str, command: Any) -> str:
    context = command.make_context(f"tolevo {name}", [], resilient_parsing=True)
    usage = command.get_usage(context).removeprefix("Usage: ")
    usage = re.sub(r"\{(\w+)\}", lambda found: found[1].upper(), usage)
    rows = [f"| {_shown(one)} | {_help(one)} |" for one in command.params]
    table = ["| argument or option | meaning |", "|---|---|", *rows]
    head = [f"## `tolevo {name}`\n", f"{command.help}\n", f"    {' '.join(usage.split())}\n"]
    return "\n".join([*head, *table, ""])


def _shown(one: Any) -> str:
    if one.param_type_name == "argument":
        return f"`{one.metavar or one.name.upper()}`"
    return ", ".join(f"`{name}`" for name in one.opts)


def _help(one: Any) -> str:
    text = getattr(one, "help", None) or "Configuration (TOML)."
    return " ".join(str(text).split()).replace("|", "\\|")
