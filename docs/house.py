"""The picture of the architecture page: the rooms of the package and who knows whom, from the code's own imports."""

import ast
from collections import Counter
from collections.abc import Iterator

import networkx as nx
import pygraphviz

from tests.rooms import DOORS, PLACE, ROOT, SOURCES, STOREYS, Import, house, module_name, room_of, size_of

STYLES = {
    "down": {"color": "#55606b"},
    "beside": {"color": "#b07d2b", "constraint": "false"},
    "door": {"color": "#c0392b", "style": "dashed", "constraint": "false"},
}
TOP = "The command line, which parses, calls and prints; the public names."
COLOURS = {"operad": "#dfe9f5", "semantics": "#e3f0df", "mechanics": "#fbf0d9", "show": "#f3e3ef", "testing": "#f3e3ef"}


def _label(room: str, files: int) -> str:
    name = room.removeprefix("ephs.") if room != "ephs" else "ephs, the command line"
    return f"{name}\n{files} file" + "s" * (files != 1)


def arrows(imports: list[Import]) -> Iterator[tuple[str, str, str, str]]:
    """The arrows of the picture: kind, two rooms, and which way they lead; none that others imply."""
    pairs = {one.rooms for one in imports if not one.upward}
    beside = {(a, b) for a, b in pairs if PLACE[a] == PLACE[b]}
    for a, b in sorted(nx.transitive_reduction(nx.DiGraph(sorted(pairs - beside))).edges):
        yield "down", a, b, "forward"
    for a, b in sorted({(min(pair), max(pair)) for pair in beside}):
        ways = {(True, True): "both", (True, False): "forward", (False, True): "back"}
        yield "beside", a, b, ways[(a, b) in beside, (b, a) in beside]
    for a, b in sorted({one.rooms for one in imports if one.upward}):
        yield "door", a, b, "forward"


def picture() -> str:
    """The house as SVG, the ground below."""
    files = Counter(room_of(module_name(file)) for file in SOURCES)
    graph = pygraphviz.AGraph(directed=True, strict=False, rankdir="TB", nodesep=0.35, ranksep=0.42)
    graph.node_attr.update(shape="box", style="filled,rounded", fontname="Helvetica", fontsize=13, margin="0.14,0.07")
    graph.edge_attr.update(arrowsize=0.7)
    for room in PLACE:
        colour = COLOURS.get(room.removeprefix("ephs").strip(".").partition(".")[0], "#eceff1")
        graph.add_node(room, label=_label(room, files[room]), fillcolor=colour, color="#8a949e")
    for storey in STOREYS:
        graph.add_subgraph([room for flat in storey for room in sorted(flat)], rank="same")
    for above, below in zip(STOREYS[1:], STOREYS, strict=False):  # a storey stands on the one below, whoever knows whom
        graph.add_edge(min(min(above, key=sorted)), min(min(below, key=sorted)), key="stand", style="invis")
    for kind, a, b, way in arrows(house()):
        graph.add_edge(a, b, key=kind, dir=way, **STYLES[kind])
    return graph.draw(format="svg", prog="dot").decode()


def rooms() -> str:
    """The rooms from the top, each with what its own first lines say, as a Markdown table."""
    said = {module_name(file): file for file in SOURCES if file.name == "__init__.py"}
    table = "| room | contents |\n| --- | --- |\n"
    for room in sorted(PLACE, key=lambda room: (-PLACE[room][0], room)):
        words = ast.get_docstring(ast.parse(said[room].read_text(encoding="utf-8"))) or ""
        first = words.partition("\n\n")[0] if room != "ephs" else TOP
        table += f"| `{room}` | {first} |\n"
    return table


def doors() -> str:
    """The ways up, as a Markdown table."""
    rows = (f"| `{module}` | `{room}` | {why} |\n" for (module, room), why in DOORS.items())
    return "| module | imports | why |\n| --- | --- | --- |\n" + "".join(rows)


def readings(files: dict[str, tuple[str, ...]]) -> str:
    """Readings with their files, what these are by their first line, and their tokens, as a table."""
    rows, whole = ["| reading | files | tokens |", "| --- | --- | ---: |"], 0
    for reading, names in files.items():
        texts = [(ROOT / f"ephs/{name}.py").read_text(encoding="utf-8") for name in names]
        said = [
            f"`{name}.py`: {(ast.get_docstring(ast.parse(text)) or '').splitlines()[0]}"
            for name, text in zip(names, texts, strict=True)
        ]
        whole += (tokens := sum(map(size_of, texts)))
        rows.append(f"| {reading} | {'<br>'.join(said)} | {tokens} |")
    return "\n".join([*rows, f"| | | {whole} |"])
