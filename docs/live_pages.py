"""Pages that simulate: the four-bar linkage, and every scene of the gallery.

    python docs/live_pages.py FOLDER

writes them as files that need no network.
"""

import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

import ephs  # noqa: E402 - the package lies beside the pages
from ephs import Scene  # noqa: E402
from ephs.mechanics.scene.parameters import varied  # noqa: E402
from ephs.show.shared.page import Page  # noqa: E402
from examples.gallery import entries  # noqa: E402

UNTIL = 4.0
SLIDERS = ("bodies.coupler.mass", "bodies.rocker.mass", "joints.main.friction", "joints.pivot.friction")
DRIVEN = "joints.main"
FRICTION = 0.35  # N m s/rad, in the bearing of the crank


def linkage() -> Scene:
    """The four-bar linkage of `ephs new --like four-bar`, with more friction, so that the eye can follow the crank."""
    scene = ephs.load(ROOT / "ephs" / "templates" / "four-bar.toml")
    return replace(varied(scene, {f"{DRIVEN}.friction": FRICTION}), name="Four-bar linkage")


def four_bar() -> Page:
    """A four-bar linkage with sliders for masses, frictions and the torque on the crank."""
    return ephs.live_page(linkage(), parameters=SLIDERS, inputs=[DRIVEN], until=UNTIL)


def file_of(name: str) -> str | None:
    """The file of a gallery entry's page, None where the entry is no scene."""
    model = entries()[name].model()
    return f"{name.replace(' ', '-').lower()}.html" if isinstance(model, Scene) else None


def write(folder: Path) -> list[Path]:
    """Write the page of each scene of the gallery, and of the four-bar linkage."""
    written = [four_bar().save(folder / "interactive-four-bar.html")]
    for name, entry in entries().items():
        model, file = entry.model(), file_of(name)
        if isinstance(model, Scene) and file is not None:
            written.append(ephs.live_page(model, until=UNTIL).save(folder / file))
    return written


if __name__ == "__main__":
    for page in write(Path(sys.argv[1])):
        print(page)
