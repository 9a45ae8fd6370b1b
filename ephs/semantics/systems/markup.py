"""A small HTML table, as notebooks show reports, solutions and ledgers."""

from collections.abc import Iterable, Sequence
from html import escape


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table; the first cell of a row is its name."""
    top = f"<thead><tr>{''.join(f'<th>{escape(word)}</th>' for word in head)}</tr></thead>" if head else ""
    body = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        + "".join(f'<td style="text-align:right">{escape(cell)}</td>' for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    caption = f'<caption style="text-align:left">{escape(title)}</caption>'
    return f"<table>{caption}{top}<tbody>{body}</tbody></table>"
