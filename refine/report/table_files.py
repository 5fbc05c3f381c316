"""The paper's tables as files: CSV and JSON for programs, Markdown and LaTeX for people who write."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from refine.evaluation.results import null_nan
from refine.report.paper_tables import MeasureColumn, PaperCell, PaperTable

Tables = Mapping[str, Sequence[PaperTable]]
"""By the data set's name."""

_FIELDS = ("value", "low", "high", "ratio", "ratio_low", "ratio_high", "paper", "paper_ratio")
_LATEX = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    ">": "$>$",
    "<": "$<$",
    "–": "--",
}


def tables_csv(tables: Tables) -> str:
    """One line a measure of a method: set, table, method, measure, the numbers in full precision."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["set", "table", "method", "measure", *_FIELDS, "paper_set"])
    for record in _records(tables):
        numbers = ("" if record[name] is None else repr(record[name]) for name in _FIELDS)
        names = (record[name] for name in ("set", "table", "method", "measure"))
        writer.writerow([*names, *numbers, record["paper_set"] or ""])
    return buffer.getvalue()


def tables_json(tables: Tables) -> str:
    """The same records; null for what is not known."""
    return json.dumps(list(_records(tables)), indent=1, allow_nan=False) + "\n"


def tables_markdown(tables: Tables) -> str:
    """A section a set, a table each: ours with its interval and ratio, the paper's with its ratio."""
    parts = []
    for name, each in tables.items():
        parts.append(f"## {name}\n")
        for table in each:
            headings = ["method", *(text for column in table.columns for text in _headings(table, column))]
            lines = [
                f"**{caption(table)}**\n",
                _pipes(headings),
                _pipes(["---", *("---:" for _ in headings[1:])]),
            ]
            for row in table.rows:
                cells = [
                    text
                    for pair in zip(table.columns, row.cells, strict=True)
                    for text in _texts(table, *pair)
                ]
                lines.append(_pipes([row.label, *cells]))
            parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def tables_latex(tables: Tables) -> str:
    """A `table` environment a table, with booktabs rules."""
    parts = ["% needs \\usepackage{booktabs}\n"]
    for name, each in tables.items():
        for table in each:
            headings = ["method", *(text for column in table.columns for text in _headings(table, column))]
            lines = [
                r"\begin{table}",
                rf"\caption{{{_latex(f'{name}. {caption(table)}')}}}",
                rf"\begin{{tabular}}{{l{'r' * (len(headings) - 1)}}}",
                r"\toprule",
                " & ".join(map(_latex, headings)) + r" \\",
                r"\midrule",
            ]
            for row in table.rows:
                cells = [
                    text
                    for pair in zip(table.columns, row.cells, strict=True)
                    for text in _texts(table, *pair)
                ]
                lines.append(" & ".join(map(_latex, (row.label, *cells))) + r" \\")
            lines += [r"\bottomrule", r"\end{tabular}", r"\end{table}"]
            parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def caption(table: PaperTable) -> str:
    """What the table is, and whose numbers stand beside ours."""
    beside = f"; beside it the paper's, {table.counterpart}" if table.has_paper else ""
    return f"Table {table.number}. {table.title}{beside}"


def printed(value: float, column: MeasureColumn) -> str:
    """A number as it is read; a dash for NaN."""
    return "–" if math.isnan(value) else f"{value * column.scale:.{column.digits}f}"


def printed_paper(cell: PaperCell, column: MeasureColumn) -> str:
    """The paper's number with the digits it has there."""
    return printed(cell.paper, replace(column, digits=min(column.digits, 2)))


def printed_interval(cell: PaperCell, column: MeasureColumn) -> str:
    """The confidence interval, empty where there is none."""
    low, high = cell.interval.low, cell.interval.high
    return "" if math.isnan(low) else f"{printed(low, column)}–{printed(high, column)}"


def printed_ratio(ratio: float) -> str:
    """The ratio to the regressor's, empty where there is none."""
    return "" if math.isnan(ratio) else f"×{ratio:.2f}"


def _records(tables: Tables) -> Iterator[dict[str, Any]]:
    for name, each in tables.items():
        for table in each:
            for row in table.rows:
                for column, cell in zip(table.columns, row.cells, strict=True):
                    numbers = (
                        cell.value,
                        cell.interval.low,
                        cell.interval.high,
                        cell.ratio,
                        cell.ratio_interval.low,
                        cell.ratio_interval.high,
                        cell.paper,
                        cell.paper_ratio,
                    )
                    yield {
                        "set": name,
                        "table": table.number,
                        "method": row.method or row.label,
                        "measure": column.measure,
                        **dict(zip(_FIELDS, map(null_nan, numbers), strict=True)),
                        "paper_set": table.counterpart,
                    }


def _headings(table: PaperTable, column: MeasureColumn) -> tuple[str, ...]:
    return (column.heading, "paper") if table.has_paper else (column.heading,)


def _texts(table: PaperTable, column: MeasureColumn, cell: PaperCell) -> tuple[str, ...]:
    interval = printed_interval(cell, column)
    here = " ".join(
        part
        for part in (
            printed(cell.value, column),
            f"[{interval}]" if interval else "",
            printed_ratio(cell.ratio),
        )
        if part
    )
    if not table.has_paper:
        return (here,)
    return here, " ".join(filter(None, (printed_paper(cell, column), printed_ratio(cell.paper_ratio))))


def _pipes(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _latex(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text).replace("×", r"$\times$")
