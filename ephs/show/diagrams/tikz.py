"""A placed picture as TikZ, to be compiled by plain LaTeX with the article class."""

from typing import Final

from ephs.show.diagrams.geometry import Placement, Point
from ephs.show.diagrams.marks import DiagramMark, DiagramWord, parts_of
from ephs.show.shared.palette import FILLS, GREY, HATCHED, INK, OPENED, PAPER, RIMS

_COLOURS: Final = {
    PAPER: "ephspaper", INK: "ephsink", GREY: "ephsgrey", HATCHED: "ephshatched", OPENED: "ephsopened",
    **{rim: f"ephs{kind}rim" for kind, rim in reversed(RIMS.items())},
    **{fill: f"ephs{kind}" for kind, fill in reversed(FILLS.items())},
}  # fmt: skip
"""Names of all colours."""

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "_": r"\_",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
_GREEK_NAMES = (
    "alpha beta gamma delta varepsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon varphi chi"
    " psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
)
_GREEK = dict(zip("αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΥΦΨΩ", _GREEK_NAMES.split(), strict=True))


def to_tikz(placement: Placement) -> str:
    """The picture as a whole LaTeX document; its ``tikzpicture`` can be pasted into another.

    Its colours, ``ephsstorage`` and so on, are defined before it.
    """
    (start, above), (width, height) = placement.origin, placement.size
    left, top, across, down = placement.rectangle
    head = [
        r"\documentclass{article}",
        r"\usepackage[T1]{fontenc}",
        r"\usepackage{tikz}",
        r"\usepackage{iftex}",
        r"\newcommand\ephschar[1]{\ifPDFTeX[U+#1]\else\char\"#1\relax\fi}% letters that pdfLaTeX's fonts lack",
        rf"\usepackage[paperwidth={width:.2f}bp,paperheight={height:.2f}bp,margin=0pt]{{geometry}}",
        r"\pagestyle{empty}\parindent=0pt\topskip=0pt",
        *(rf"\definecolor{{{name}}}{{HTML}}{{{colour[1:].upper()}}}" for colour, name in _COLOURS.items()),
    ]
    body = [
        r"\begin{tikzpicture}[x=1bp,y=-1bp,every node/.style={inner sep=0pt,font=\sffamily}]",
        rf"\useasboundingbox {_point((start, above))} rectangle {_point((start + width, above + height))};",
        rf"\draw[line width=1.4bp,rounded corners={placement.corner:.0f}bp] "
        rf"{_point((left, top))} rectangle {_point((left + across, top + down))};",
    ]
    for part in parts_of(placement):
        if part.title:
            body.append(f"% {_comment(part.title)}")
        body += [*map(_mark, part.marks), *map(_word, part.words)]
    body.append(r"\end{tikzpicture}")
    return "\n".join([*head, r"\begin{document}", r"\hbox{%", *body, "}", r"\end{document}"]) + "\n"


def _mark(mark: DiagramMark) -> str:
    options = [f"draw={_COLOURS[mark.stroke]}", f"line width={mark.width:g}bp"] if mark.stroke else []
    options += [f"fill={_COLOURS[mark.fill]}"] if mark.fill else []
    options += ["dash pattern=on {:g}bp off {:g}bp".format(*mark.dashes)] if mark.dashes else []
    line = " -- ".join(map(_point, mark.points))
    return rf"\path[{','.join(options)}] {line}{f' circle[radius={mark.radius:.2f}bp]' if mark.radius else ''};"


def _point(point: Point) -> str:
    return f"({point[0]:.2f},{point[1]:.2f})"


def _word(word: DiagramWord) -> str:
    text = word.text
    words = _escape(text.base) + (rf"\textsubscript{{{_escape(text.sub)}}}" if text.sub else "")
    size = rf"\fontsize{{{text.size:.1f}}}{{{1.2 * text.size:.1f}}}\selectfont"
    # names beside lines need no ground of their own
    ground = f"fill={_COLOURS[word.halo]},inner sep=.5bp," if word.halo not in ("", PAPER) else ""
    style = rf"{ground}text={_COLOURS[word.colour]},font=\sffamily{size}"
    return rf"\node[{style}] at {_point(text.at)} {{{words}}};"


def _escape(words: str) -> str:
    return "".join(_letter(letter) for letter in words)


def _letter(letter: str) -> str:
    if letter in _GREEK:
        return rf"\ensuremath{{\{_GREEK[letter]}}}"
    return _ESCAPES.get(letter, letter if ord(letter) < 0x100 else rf"\ephschar{{{ord(letter):04X}}}")


def _comment(words: str) -> str:
    return "".join(letter if ord(letter) < 0x100 else "?" for letter in words.replace("\n", " "))
