"""A placed picture as TikZ, to be compiled by plain LaTeX with the article class."""

from ephs.show.diagrams.geometry import KINDS, Lettering, Placement, Point, all_boxes, notes_of
from ephs.show.shared.palette import FILLS, RIMS

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
    width, height = placement.size
    left, top, across, down = placement.rectangle
    right, bottom = left + across, top + down
    head = [
        r"\documentclass{article}",
        r"\usepackage[T1]{fontenc}",
        r"\usepackage{tikz}",
        r"\usepackage{iftex}",
        r"\newcommand\ephschar[1]{\ifPDFTeX[U+#1]\else\char\"#1\relax\fi}% letters that pdfLaTeX's fonts lack",
        rf"\usepackage[paperwidth={width:.2f}bp,paperheight={height:.2f}bp,margin=0pt]{{geometry}}",
        r"\pagestyle{empty}\parindent=0pt\topskip=0pt",
    ]
    for kind in KINDS:
        head.append(rf"\definecolor{{ephs{kind}}}{{HTML}}{{{FILLS[kind][1:].upper()}}}")
        head.append(rf"\definecolor{{ephs{kind}rim}}{{HTML}}{{{RIMS[kind][1:].upper()}}}")
    body = [
        r"\begin{tikzpicture}[x=1bp,y=-1bp,line width=1.2bp,every node/.style={inner sep=0pt,font=\sffamily}]",
        rf"\useasboundingbox (0,0) rectangle ({width:.2f},{height:.2f});",
        rf"\draw[line width=1.4bp,rounded corners={placement.corner:.0f}bp] "
        rf"({left:.2f},{top:.2f}) rectangle ({right:.2f},{bottom:.2f});",
    ]
    for region in placement.regions:
        circle = f"{_coordinates(region.at)} circle[radius={region.radius:.2f}bp]; % {_comment(region.path)}"
        body.append(rf"\filldraw[fill=ephscomposite!35,draw=ephscompositerim] {circle}")
        body.append(_node(region.label, "text=ephscompositerim,"))
    for wire in placement.wires:
        dash = "" if wire.power else "[dotted]" if wire.role == "link" else "[dashed]"
        body.append(
            rf"\draw{dash} {' -- '.join(_coordinates(point) for point in wire.points)}; % {_comment(wire.title)}"
        )
    for box in all_boxes(placement):
        style = f"fill=ephs{box.kind},draw=ephs{box.kind}rim"
        what = box.path or f"legend: {box.kind}"
        body.append(rf"\filldraw[{style}] {_coordinates(box.at)} circle[radius={box.radius:.2f}bp]; % {_comment(what)}")
        body += [
            rf"\draw[ephs{box.kind}rim,line width=.4bp] {_coordinates(a)} -- {_coordinates(b)};"
            for a, b in box.hatching
        ]
        back = f"fill=ephs{box.kind},inner sep=.5bp," if box.hatching else ""
        body += [_node(text, back) for text in box.lines]
    for junction in placement.junctions:
        body.append(
            rf"\fill {_coordinates(junction.at)} circle[radius={junction.radius:.2f}bp]; % {_comment(junction.path)}"
        )
        body.append(_node(junction.label, ""))
    body += [_node(text, "text=gray,") for text in notes_of(placement)]
    body.append(r"\end{tikzpicture}")
    lines = [*head, r"\begin{document}", r"\hbox{%", *body, "}", r"\end{document}"]
    return "\n".join(lines) + "\n"


def _coordinates(point: Point) -> str:
    return f"({point[0]:.2f},{point[1]:.2f})"


def _node(text: Lettering, style: str) -> str:
    words = _escape(text.base) + (rf"\textsubscript{{{_escape(text.sub)}}}" if text.sub else "")
    size = rf"\fontsize{{{text.size:.1f}}}{{{1.2 * text.size:.1f}}}\selectfont"
    return rf"\node[{style}font=\sffamily{size}] at {_coordinates(text.at)} {{{words}}};"


def _escape(words: str) -> str:
    return "".join(_letter(letter) for letter in words)


def _letter(letter: str) -> str:
    if letter in _GREEK:
        return rf"\ensuremath{{\{_GREEK[letter]}}}"
    return _ESCAPES.get(letter, letter if ord(letter) < 0x100 else rf"\ephschar{{{ord(letter):04X}}}")


def _comment(words: str) -> str:
    return "".join(letter if ord(letter) < 0x100 else "?" for letter in words.replace("\n", " "))
