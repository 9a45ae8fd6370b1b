"""A page: displayed in notebooks and built documentation as a frame, elsewhere a file."""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path as FilePath
from typing import final


@final
@dataclass(frozen=True, slots=True)
class Page:
    """A self-contained HTML page.

    Attributes
    ----------
    html : str
        The whole document.
    title : str
        What it shows.
    """

    html: str
    title: str

    def save(self, path: str | FilePath) -> FilePath:
        """Write the page to a file; its folder is created if missing."""
        target = FilePath(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(self.html, encoding="utf-8")
        return target

    def frame(self, height: str = "32rem") -> str:
        """The page as a frame of another page, `height` in the words of CSS."""
        inside, title = html.escape(self.html, quote=True), html.escape(self.title, quote=True)
        style = f"width:100%;height:{height};border:1px solid #dfe3e8;border-radius:8px"
        return f'<iframe title="{title}" loading="lazy" style="{style}" srcdoc="{inside}"></iframe>'

    def _repr_html_(self) -> str:
        return self.frame("26rem")

    def __repr__(self) -> str:
        return f"<Page {self.title!r}, {len(self.html) / 1e6:.1f} MB; save(path) writes it>"


def asset(name: str) -> str:
    """The text of a script or a style that comes with the package."""
    return files("ephs.show").joinpath("assets", name).read_text(encoding="utf-8")


def wide_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """An HTML table that may be wider than the page; the first cell of a row is its head."""
    names = "".join(f"<th>{words}</th>" for words in head)
    body = "".join(f"<tr><th>{first}</th>{''.join(f'<td>{x}</td>' for x in rest)}</tr>" for first, *rest in rows)
    return f'<div class="wide"><table><thead><tr>{names}</tr></thead><tbody>{body}</tbody></table></div>'
