"""The report as one HTML page that holds everything: tables, plots as SVG, equations, and the script to zoom.

The page opens offline; its content security policy forbids any network request.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import assert_never

from susp_ctrl import plotting
from susp_ctrl.report.blocks import Block, Box, Equations, Figure, Heading, Section, Table, Text
from susp_ctrl.report.document import equations_svg, footer, is_shown, opening
from susp_ctrl.report.explorer import explorer_html, explorer_script, filled
from susp_ctrl.report.formatting import prose, sentence
from susp_ctrl.report.sections.maps import figure_key
from susp_ctrl.study.results import MapExplorer, StudyRun

_TOOLS = (
    '<span class="tools"><button>+</button><button>−</button><button title="whole plot">⟲</button></span>'
)


def write_page(
    folder: Path,
    run: StudyRun,
    sections: Sequence[Section],
    name: str = "report.html",
    *,
    explorers: Sequence[MapExplorer] = (),
) -> Path:
    """Write the page into `folder` and return its path.

    Parameters
    ----------
    folder
        Where to; figures are drawn anew, nothing in the folder is used.
    run
        The data of the study (title, provenance, headlines).
    sections
        The chapters.
    name
        File name of the page.
    explorers
        Maps to click on; each stands below the figure of its map.
    """
    equations = equations_svg()
    below = {figure_key(explorer.case): explorer_html(explorer) for explorer in explorers}
    parts = {
        "title": escape(run.study.title),
        "opening": "\n".join(
            [
                f'<p class="faint">{escape(run.study.settings.source)}</p>',
                f"<p>{escape(run.study.settings.description)}</p>",
                *(_block(block, folder, equations) for block in opening(run)),
            ]
        ),
        "contents": "".join(
            f'<li><a href="#s{number}">{escape(prose(section.title))}</a></li>'
            for number, section in enumerate(sections, 1)
        ),
        "sections": "\n".join(
            _section(number, section, folder, equations, below) for number, section in enumerate(sections, 1)
        ),
        "footer": escape(footer(run)),
        "script": explorer_script() if explorers else "",
    }
    target = folder / name
    target.write_text(filled("page.html", parts), encoding="utf-8")
    return target


def table_html(table: Table) -> str:
    """Return a table as HTML, with the digits and marks of the document."""
    head = ""
    if table.spans:
        cells = [f'<th colspan="{count}" class="center">{_lines(text)}</th>' for text, count in table.spans]
        head = f"<tr>{''.join(cells)}</tr>"
    head += (
        "<tr>" + "".join(f'<th class="{c.align}">{escape(c.heading)}</th>' for c in table.columns) + "</tr>"
    )
    kinds = [f"{column.align}{' long' if column.kind == 'long' else ''}" for column in table.columns]
    body = []
    for row in table.cells():
        if "group" in row:
            body.append(f'<tr class="group"><th colspan="{len(kinds)}">{escape(row["group"])}</th></tr>')
            continue
        cells = [
            f'<td class="{kind}">{escape(cell)}</td>' for kind, cell in zip(kinds, row["cells"], strict=True)
        ]
        kind = "strong" if row["strong"] else "plain"
        body.append(f'<tr class="{kind}">{"".join(cells)}</tr>')
    return f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"


def _section(
    number: int, section: Section, folder: Path, equations: dict[str, str], below: Mapping[str, str]
) -> str:
    blocks = []
    for block in section.blocks:
        if is_shown(block):
            blocks.append(_block(block, folder, equations))
        if isinstance(block, Figure) and block.key in below:
            blocks.append(below[block.key])
    return (
        f'<section id="s{number}"><h2>{number} {escape(prose(section.title))}</h2>\n'
        + "\n".join(blocks)
        + "</section>"
    )


def _block(block: Block, folder: Path, equations: dict[str, str]) -> str:
    match block:
        case Heading():
            return f"<h3>{escape(prose(block.text))}</h3>"
        case Text():
            items = "".join(f"<li>{escape(sentence(item))}</li>" for item in block.items)
            listed = f'<ol class="evidence">{items}</ol>' if items else ""
            return (f"<p>{escape(prose(block.text))}</p>" if block.text else "") + listed
        case Equations():
            drawn = equations.get(block.name)
            return (
                f'<div class="equations">{drawn}</div>'
                if drawn
                else "<p>(See the PDF for the equations.)</p>"
            )
        case Box():
            lines = "".join(f"<p>{escape(prose(line))}</p>" for line in block.lines)
            return f'<div class="box{" warning" if block.warning else ""}"><b>{escape(block.title)}</b>{lines}</div>'
        case Figure():
            caption = f"<figcaption>{escape(prose(block.caption))}</figcaption>"
            plot = f'<div class="plot">{_TOOLS}{_svg(block, folder)}</div>'
            return f'<figure id="figure-{block.key}">{plot}{caption}</figure>'
        case Table():
            note = f'<p class="note">{escape(prose(block.note))}</p>' if block.note else ""
            caption = f"<figcaption>{escape(prose(block.caption))}</figcaption>"
            inside = f'<div class="scroll">{table_html(block)}</div>'
            return f'<figure id="table-{block.key}">{caption}{inside}{note}</figure>'
    assert_never(block)


def _svg(figure: Figure, folder: Path) -> str:
    path = folder / f".{figure.key}.svg"
    plotting.save_figure(figure.draw(), path)
    text = path.read_text(encoding="utf-8")
    path.unlink()
    return text[text.index("<svg") :]  # without the XML declaration, which HTML does not know


def _lines(text: str) -> str:
    return "<br>".join(escape(line) for line in text.split("\n"))
