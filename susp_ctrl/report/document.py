"""The PDF: the sections as plain data for the template, and its compilation by typst.

Values travel as JSON in a file that the template reads; no value is ever part of the markup. The template uses the
fonts that come with typst and no package from the net, so the document looks the same on every machine.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any, assert_never

from susp_ctrl.report.blocks import Block, Box, Equations, Figure, Heading, Section, Table, Text
from susp_ctrl.report.formatting import prose, sentence
from susp_ctrl.study.results import StudyRun

DATA_FILE = "report.json"
_WHOLE_ROWS = 16  # tables up to this length are not broken over pages
NO_TYPST = "report.pdf is left out: the package typst is not installed (pip install typst)"
"""What is said where the wheel that sets the PDF is missing."""


def opening(run: StudyRun) -> list[Block]:
    """Return what stands on the first page: the verdict box, and what a reader must be warned of."""
    blocks: list[Block] = [Box("In short", run.headlines)]
    if run.undecided:
        assert run.stability is not None
        names = {design.key: design.label for design in run.designs}
        verdicts = run.stability.verdicts
        open_ones = [names[key] for key in verdicts.loc[verdicts["verdict"] == "undecided", "design"]]
        blocks.append(
            Box(
                "Undecided stability",
                (
                    f"The methods differ, or a root lies on the axis as far as can be told: {', '.join(open_ones)}.",
                ),
                warning=True,
            )
        )
    return blocks


def payload(run: StudyRun, sections: Sequence[Section], figure_folder: str = "figures") -> dict[str, Any]:
    """Return everything the template needs, as data that JSON can hold.

    Parameters
    ----------
    run
        The data of the study (title, provenance, headlines).
    sections
        The chapters.
    figure_folder
        Folder of the PDF figures, relative to the data file.
    """
    return {
        "title": run.study.title,
        "source": run.study.settings.source,
        "description": run.study.settings.description,
        "file": run.provenance.study_file,
        "footer": footer(run),
        "opening": [block_data(block, figure_folder) for block in opening(run)],
        "sections": [
            {
                "title": prose(section.title),
                # Figures float: without a page break they would stray into the next section.
                "new_page": bool(section.figures or (before is not None and before.figures)),
                "blocks": [block_data(b, figure_folder) for b in section.blocks if is_shown(b)],
            }
            for before, section in zip([None, *sections], sections, strict=False)
        ],
    }


def block_data(block: Block, figure_folder: str) -> dict[str, Any]:
    """Return one block as data for the template."""
    match block:
        case Heading():
            return {"kind": "heading", "text": prose(block.text)}
        case Text():
            return {
                "kind": "text",
                "text": prose(block.text),
                "items": [sentence(item) for item in block.items],
                "numbered": block.numbered,
            }
        case Equations():
            return {"kind": "equations", "name": block.name}
        case Box():
            return {
                "kind": "box",
                "title": block.title,
                "lines": [prose(line) for line in block.lines],
                "warning": block.warning,
            }
        case Figure():
            return {
                "kind": "figure",
                "path": f"{figure_folder}/{block.key}.pdf",
                "caption": prose(block.caption),
            }
        case Table():
            rows = block.cells()
            size, gap = _table_size(block, rows)
            return {
                "kind": "table",
                "caption": prose(block.caption),
                "note": block.note,
                "breakable": len(rows) > _WHOLE_ROWS and not block.whole,
                "size": size,
                "gap": gap,
                "columns": [
                    {"heading": c.heading, "align": c.align, "wrap": c.kind == "long"} for c in block.columns
                ],
                "spans": [{"text": text, "count": count} for text, count in block.spans],
                "rows": rows,
            }
    assert_never(block)


def write_pdf(folder: Path, data: dict[str, Any], name: str = "report.pdf") -> Path | None:
    """Set the document in `folder`, which holds the figures; return its path, or None where typst is missing.

    Parameters
    ----------
    folder
        Root of the document.
    data
        Of `payload`.
    name
        File name of the PDF.

    Raises
    ------
    RuntimeError
        The template cannot be set with this data (a fault of this program, never of the user's).
    """
    typst = _typst()
    if typst is None:
        return None
    source = folder / DATA_FILE
    source.write_text(json.dumps(data, ensure_ascii=False), encoding="utf-8")
    template = (asset("equations.typ") + asset("template.typ")).encode()
    try:
        document: bytes = typst.compile(
            template,
            root=str(folder),
            ignore_system_fonts=True,
            sys_inputs={"data": f"/{DATA_FILE}"},
            pdf_tags=False,  # tags would double the size of the document
        )
    finally:
        source.unlink()
    target = folder / name
    target.write_bytes(document)
    return target


def equations_svg() -> dict[str, str]:
    """Return every group of equations as SVG, by name; empty where typst is missing."""
    typst = _typst()
    if typst is None:
        return {}
    page = "#set page(width: 16cm, height: auto, margin: 2pt, fill: none)\n#set par(justify: true)\n"
    source = page + asset("equations.typ") + "\n#equations.at(sys.inputs.name)\n"
    set_as_svg = partial(typst.compile, source.encode(), format="svg", ignore_system_fonts=True)
    names = re.findall(r"^  (\w+): \[$", source, flags=re.MULTILINE)
    return {name: bytes(set_as_svg(sys_inputs={"name": name})).decode() for name in names}


def footer(run: StudyRun) -> str:
    """Return the line that says what made the report."""
    version, digest = run.provenance.versions.get("susp_ctrl", ""), run.provenance.study_sha256[:12]
    return f"susp_ctrl {version}" + (f" · study {digest}" if digest else "")


def is_shown(block: Block) -> bool:
    """Return whether a block is part of the document (long histories are only files)."""
    return not isinstance(block, Table) or (block.in_document and bool(block.columns))


def asset(name: str) -> str:
    """Return a file of the folder ``assets`` as text."""
    return files("susp_ctrl.report").joinpath("assets", name).read_text(encoding="utf-8")


def _typst() -> Any:
    try:
        import typst  # only here: where its wheel is missing everything but the PDF is written
    except ImportError:
        return None
    return typst


def _table_size(table: Table, rows: list[dict[str, Any]]) -> tuple[float, float]:
    # Wide tables are set smaller and tighter; the estimate counts the characters of the widest cell per column.
    total = 0.0
    for position, column in enumerate(table.columns):
        cells = [row["cells"][position] for row in rows if "cells" in row]
        words = column.heading.split()
        width = max(
            [len(word) for word in words] + ([0] if column.kind == "long" else [len(c) for c in cells]),
            default=0,
        )
        total += max(width, 14) if column.kind == "long" else width
    total += 2 * len(table.columns)
    if total <= 84:
        return 9.0, 5.0
    return (8.2, 4.0) if total <= 100 else (7.2, 2.6)
