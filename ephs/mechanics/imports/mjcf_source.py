"""Preprocessing of MJCF: includes expanded, elements without a counterpart removed, files restricted to the folder.

MuJoCo then gets one text, and no file but meshes in the model's folder, from which it takes inertias.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import final
from xml.etree.ElementTree import Element, tostring

from ephs.mechanics.imports.draft import Draft
from ephs.mechanics.imports.xml import MOST_LEVELS, numbers, read_tree
from ephs.mechanics.scene.errors import fault

# Sections without counterpart in scenes, and names of their contents.
_SECTIONS = {
    "sensor": "sensors",
    "deformable": "deformables",
    "extension": "plugins",
    "keyframe": "keyframes",
}
# Actuators and tendons that may have a counterpart, and targets of actuators.
_DRIVES = ("general", "motor", "position", "velocity", "cylinder", "damper")
_TARGETS = ("joint", "jointinparent", "tendon")
_SILENT = ("visual", "statistic", "custom", "size", "compiler-plugin")
_ASSETS = ("texture", "material", "hfield", "skin")
_UNSUPPORTED = {
    "flexcomp": "take it out: bodies are rigid",
    "composite": "write its bodies out: mujoco's compile command does",
}
_PAIRS = ("connect", "weld", "joint")
_REFERENCES = ("material", "hfield", "texture")
# Attributes that hold names: a body may be called nan.
_NAMES = {
    *("name", "class", "childclass", "model", "file", "content_type", "material", "mesh", "hfield", "prefix", "target"),
    *(
        "body",
        "body1",
        "body2",
        "tendon",
        "jointinparent",
        "joint",
        "joint1",
        "joint2",
        "site",
        "site1",
        "site2",
        "geom",
        "geom1",
        "geom2",
    ),
}
_MOST_INCLUDES = 100
_MOST_COPIES = 10_000
_MOST_PARAMETER = 100.0


@final
class MjcfSource:
    """An MJCF prepared for MuJoCo.

    Attributes
    ----------
    text
        The model, without what a scene cannot have.
    assets
        The meshes that it names, by the names that it has for them.
    models
        The texts of models that it attaches, prepared likewise, by the names that it has for them.
    size
        Number of its elements, with all copies.
    """

    def __init__(
        self, root: Element, draft: Draft, above: "MjcfSource | None" = None, file: Path | None = None
    ) -> None:
        self._draft = draft
        self._read: set[Path] = set()
        self._above: tuple[Path, ...] = () if above is None or file is None else (*above._above, file)
        self._folder = "" if file is None else file.parent.relative_to(draft.folder.resolve()).as_posix()
        self.assets: dict[str, bytes] = {} if above is None else above.assets
        self.models: dict[str, bytes] = {} if above is None else above.models
        self._files: dict[str, str] = {} if above is None else above._files
        self._gone: set[str] = set()
        self._sizes: dict[str, int] = {}
        self.text, self.size = "", 0
        self._include(root, draft.folder, 0, 0)
        if draft.faults:
            return
        if above is None:
            draft.name = root.get("model") or draft.name
        self._models(root)
        self._refuse(root)
        self._strip(root)
        self._refuse_nan(root)
        self._meshes(root)
        self.text = tostring(root, encoding="unicode")

    def _inside(self, name: str) -> Path | None:
        return self._draft.file_inside(f"{self._folder}/{name}" if self._folder else name)

    def _models(self, root: Element) -> None:
        """Prepare the models that are attached."""
        for model in [model for assets in root.findall("asset") for model in assets.findall("model")]:
            name = model.get("file", "")
            key, file, faults = f'model "{name}"', self._inside(name), self._draft.faults
            if file is None or file in self._above or len(self._above) >= _MOST_INCLUDES:
                found = "no file there" if file is None else "a model within itself"
                faults.append(fault("outside" if file is None else "twice", key, found))
                continue
            inner = read_tree(file, faults, key)
            if inner is None:
                continue
            if inner.tag != "mujoco":
                faults.append(fault("root element", key, f"<{inner.tag}>", known="<mujoco>"))
                continue
            source = MjcfSource(inner, self._draft, self, file)
            own = model.get("name") or inner.get("model") or file.stem
            model.set("name", own)
            model.set("file", f"{len(self.models)}.xml")
            self._sizes[own] = source.size
            self.models[f"{len(self.models)}.xml"] = source.text.encode()

    def file_of(self, asset: str) -> str:
        """File, relative to the model's folder, of a MuJoCo asset."""
        return self._files.get(asset, asset)

    def _include(self, element: Element, folder: Path, depth: int, level: int) -> None:
        """Put the content of the included files in their places."""
        if level > MOST_LEVELS:
            found = f"elements nested deeper than {MOST_LEVELS} levels"
            self._draft.faults.append(fault("deep", "", found, most=MOST_LEVELS))
            return
        for number, child in reversed(list(enumerate(element))):
            if child.tag != "include":
                self._include(child, folder, depth, level + 1)
                continue
            name = child.get("file", "")
            key = f'include "{name}"'
            file = self._inside(name)
            element.remove(child)
            if file is None:
                self._draft.faults.append(fault("outside", key, "no file there"))
                continue
            if file in self._read or depth >= _MOST_INCLUDES:
                self._draft.faults.append(fault("twice", key, "a second include of this file"))
                continue
            self._read.add(file)
            inner = read_tree(file, self._draft.faults, key)
            if inner is not None:
                self._include(inner, folder, depth + 1, level)
                for place, part in enumerate(inner):
                    element.insert(number + place, part)

    def _refuse(self, root: Element) -> None:
        for element in root.iter():
            if element.tag in _UNSUPPORTED:
                name = element.get("name") or element.get("model") or element.tag
                what, hint = f"<{element.tag}>", _UNSUPPORTED[element.tag]
                self._draft.faults.append(fault("not supported", element.tag, f'"{name}"', what=what, hint=hint))
        self.size = self._copies(root)
        if self.size > _MOST_COPIES:
            self._draft.faults.append(fault("copies", "replicate", "more", most=_MOST_COPIES))

    def _refuse_nan(self, root: Element) -> None:
        """Invalid numbers: MuJoCo warns of them while parsing, and rarely never returns."""
        for element in root.iter():
            for key, value in element.items():
                if key not in _NAMES and any(word.lower().lstrip("+-") == "nan" for word in value.split()):
                    self._draft.faults.append(fault("finite", f"{element.tag}.{key}", f'"{value}"'))

    def _copies(self, element: Element) -> int:
        """Number of elements after repetition."""
        inner = 1 + sum(map(self._copies, element)) + self._sizes.get(element.get("model") or "", 0)
        if element.tag != "replicate":
            return inner
        count = numbers(element.get("count"), 1, "replicate.count", self._draft.faults)[0]
        return int(min(inner * max(count, 1.0), 10.0 * _MOST_COPIES))

    def _strip(self, root: Element) -> None:
        for section in list(root):
            if section.tag in _SECTIONS:
                for number, entry in enumerate(section):
                    self._draft.leave(_SECTIONS[section.tag], _called(entry, number))
            if section.tag in _SECTIONS or section.tag in _SILENT:
                root.remove(section)
        lost: set[str] = set()
        for section in root.findall("tendon"):
            for number, tendon in enumerate(list(section)):
                if tendon.tag not in ("fixed", "spatial") or tendon.find("geom") is not None:
                    self._draft.leave("tendons", _called(tendon, number))
                    lost.add(tendon.get("name") or "")
                    section.remove(tendon)
        for section in root.findall("actuator"):
            for number, drive in enumerate(list(section)):
                targets = [drive.get(word) for word in _TARGETS if drive.get(word)]
                if drive.tag not in _DRIVES or not targets or drive.get("tendon") in lost:
                    self._draft.leave("actuators", _called(drive, number))
                    section.remove(drive)
        for element in list(root.iter()):
            for child in list(element):
                if element.tag == "asset" and child.tag in _ASSETS:
                    element.remove(child)
                elif element.tag == "equality" and child.tag not in _PAIRS:
                    name = child.get("name") or f"one of {child.tag}"
                    self._draft.leave("equality constraints that are neither lower pairs nor constant ratios", name)
                    element.remove(child)
                elif element.tag == "body" and child.tag == "plugin":
                    self._draft.leave("plugins", child.get("plugin") or "plugin")
                    element.remove(child)
                elif child.tag in ("light", "camera") or (element.tag == "default" and child.tag in _ASSETS):
                    element.remove(child)
            for reference in _REFERENCES:
                element.attrib.pop(reference, None)
        heights = [(parent, child) for parent, child in _geoms(root) if child.get("type") == "hfield"]
        for number, (parent, child) in enumerate(heights):
            self._draft.leave("height fields", _called(child, number))
            self._remove_geom(parent, child)

    def _meshes(self, root: Element) -> None:
        """Load meshes of the folder; remove others and their shapes."""
        compiler = root.findall("compiler")
        folders = [c.get("meshdir") or c.get("assetdir") for c in compiler if c.get("meshdir") or c.get("assetdir")]
        for element in compiler:
            for word in ("meshdir", "assetdir", "texturedir", "strippath"):
                element.attrib.pop(word, None)
        lost: set[str] = set()
        for assets in root.findall("asset"):
            for mesh in assets.findall("mesh"):
                name = mesh.get("file")
                if name is None:
                    self._check_formula(mesh)
                    continue
                mesh.set("name", mesh.get("name") or Path(name).stem)
                path = Path(folders[-1] or "", name).as_posix() if folders else name
                file = self._inside(path)
                if file is None:
                    self._draft.leave("meshes that are no readable file in the model's folder", path)
                    lost.add(str(mesh.get("name")))
                    assets.remove(mesh)
                    continue
                known = f"{len(self.assets)}{file.suffix.lower()}"
                mesh.set("file", known)
                self.assets[known] = file.read_bytes()
                self._files[known] = file.relative_to(self._draft.folder.resolve()).as_posix()
        for parent, child in [pair for pair in _geoms(root) if pair[1].get("mesh") in lost]:
            self._remove_geom(parent, child)
            if parent.tag != "worldbody" and parent.find("inertial") is None and child.get("mass") != "0":
                called = child.get("name") or parent.get("name") or child.get("mesh", "")
                self._draft.leave("masses of shapes whose meshes are not read", called)
        for section in root.findall("contact"):
            for pair in section.findall("pair"):
                ends = [pair.get(word) or "" for word in ("geom1", "geom2")]
                if self._gone.intersection(ends):
                    self._draft.leave("contacts between", " and ".join(ends))
                    section.remove(pair)
        for element in root.iter():  # whatever else names a file
            if element.get("file") not in self.assets.keys() | self.models.keys():
                element.attrib.pop("file", None)

    def _remove_geom(self, parent: Element, geom: Element) -> None:
        parent.remove(geom)
        self._gone.add(geom.get("name", ""))

    def _check_formula(self, mesh: Element) -> None:
        """Limit of the size of a mesh from a formula."""
        for word in (mesh.get("params") or "").split():
            try:
                small = abs(float(word)) <= _MOST_PARAMETER
            except ValueError:  # reported by MuJoCo
                continue
            if not small:
                key = f"mesh {mesh.get('name', '')}.params"
                self._draft.faults.append(fault("large", key, word, most=_MOST_PARAMETER))


def _called(entry: Element, number: int) -> str:
    """Name of an entry, or a generated one."""
    return entry.get("name") or f"{entry.tag} {number + 1}"


def _geoms(root: Element) -> Iterator[tuple[Element, Element]]:
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag == "geom":
                yield parent, child
