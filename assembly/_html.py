"""What notebooks show of results: tables and lines as HTML, for the `_repr_html_` of classes."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import NamedTuple

__all__ = ["Table", "as_html", "printed"]


class Table(NamedTuple):
    """Cells under headings, one row per line. Cells that are numbers stand to the right."""

    headings: tuple[str, ...]
    rows: list[tuple[object, ...]]


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'<td style="text-align: right">{value:.6g}</td>'
    side = "right" if isinstance(value, int) else "left"
    return f'<td style="text-align: {side}">{escape(str(value))}</td>'


def _table(table: Table) -> str:
    head = "".join(f'<th style="text-align: left">{escape(name)}</th>' for name in table.headings)
    rows = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in table.rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def as_html(*parts: Table | str) -> str:
    """Lines and tables below each other; tables without rows are left out."""
    texts: Iterable[str] = (
        f"<div>{escape(part)}</div>" if isinstance(part, str) else _table(part)
        for part in parts
        if isinstance(part, str) or part.rows
    )
    return f"<div>{''.join(texts)}</div>"


def printed(result: object) -> str:
    """What `print` shows, with its columns."""
    return f"<pre>{escape(str(result))}</pre>"
