"""Pages look as they did when somebody looked at them: small stored pictures, compared blurred.

After a change of design: `TOLEVO_PICTURES=write python -m pytest tests/page/test_pictures.py`,
look at every picture in `tests/data/pictures`, and commit those that are right.
"""

from __future__ import annotations

import io
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from tests.page.test_browser import claims, gap, pages, problem, real, study
from tolevo.page import page
from tolevo.page.sheet import drawing_page

if TYPE_CHECKING:
    from playwright.sync_api import Browser
    from playwright.sync_api import Page as Tab

pytestmark = pytest.mark.skipif(
    shutil.which("chromium") is None and not os.environ.get("CI"), reason="no chromium here: apt-get install chromium"
)
__all__ = ["claims", "gap", "pages", "problem", "real", "study"]
STORED = Path(__file__).parents[1] / "data" / "pictures"
WRITE = os.environ.get("TOLEVO_PICTURES") == "write"
WIDTH = 200
"""Pixels that a stored picture is wide: letters are gone, blocks, lines and colours are there."""
HEIGHT = 900
SOFT = 4.0
"""Radius [pixels of a stored picture] of the blur that both are compared with."""
FAR = 12
"""Difference of a blurred pixel, of 255, that shows something else."""
MOST = 0.10
"""Share of such pixels at most. A serif font, wider as well, comes to 2 to 8 %; columns below each
other, an empty panel or charts that are missing to 11 to 45 %, another theme to 100 %."""
LOOKS = [(width, look) for width in (390, 820, 1400) for look in ("light", "dark", "print")]
OTHERS = [("gap", 390, "dark"), ("gap", 1400, "light"), ("gap", 820, "print"),
          ("study", 390, "light"), ("study", 1400, "dark"), ("claims", 390, "light"),
          ("claims", 1400, "dark"), ("drawing", 820, "print"),
          ("drawing", 390, "light")]  # fmt: skip


@pytest.fixture(scope="module")
def tab(browser: Browser) -> Tab:
    return browser.new_page()


@pytest.fixture(scope="module")
def run_page(real: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures") / "run.html"
    path.write_text(page(real), encoding="utf-8")
    return path


def taken(tab: Tab, path: Path, width: int, look: str, style: str = "") -> Image.Image:
    """The top of a page as it is seen, or as its first printed page would be."""
    tab.set_viewport_size({"width": width, "height": HEIGHT})
    scheme: Any = "dark" if look == "dark" else "light"
    tab.emulate_media(media="print" if look == "print" else "screen", color_scheme=scheme)
    tab.goto(path.as_uri())
    if style:
        tab.add_style_tag(content=style)
    return Image.open(io.BytesIO(tab.screenshot())).convert("RGB")


def small(picture: Image.Image) -> Image.Image:
    height = round(picture.height * WIDTH / picture.width)
    return picture.resize((WIDTH, height), Image.Resampling.BOX)


def differs(one: Image.Image, other: Image.Image) -> float:
    """Share of the pixels of two small pictures that show something else."""
    if one.size != other.size:
        return 1.0

    def seen(picture: Image.Image) -> NDArray[np.int64]:
        return np.asarray(picture.filter(ImageFilter.GaussianBlur(SOFT)), dtype=np.int64)

    return float(np.mean(np.max(np.abs(seen(one) - seen(other)), axis=2) > FAR))


def as_stored(picture: Image.Image, name: str) -> float:
    """How much a page differs from its stored picture, which is written where that is asked."""
    path, found = STORED / f"{name}.png", small(picture)
    if WRITE:
        path.parent.mkdir(exist_ok=True)
        found.quantize(64).save(path, optimize=True)
    return differs(found, Image.open(path).convert("RGB"))


@pytest.mark.parametrize(("width", "look"), LOOKS)
def test_the_page_of_a_run_looks_as_it_did(tab: Tab, run_page: Path, width: int, look: str) -> None:
    assert as_stored(taken(tab, run_page, width, look), f"run-{width}-{look}") < MOST


@pytest.mark.parametrize(("kind", "width", "look"), OTHERS)
def test_other_pages_look_as_they_did(
    tab: Tab, tmp_path: Path, pages: dict[str, str], real: Any, kind: str, width: int, look: str
) -> None:
    path = tmp_path / "p.html"
    made = drawing_page(real) if kind == "drawing" else pages[kind]
    path.write_text(made or "", encoding="utf-8")
    assert as_stored(taken(tab, path, width, look), f"{kind}-{width}-{look}") < MOST


BROKEN = [
    (1400, "dark", ".work { display: block !important; }"),
    (1400, "light", "#detail { visibility: hidden; }"),
    (1400, "dark", ":root { --ink: #000 !important; --paper: #fff !important; }"),
    (390, "light", ".plot { display: none; }"),
    (820, "light", ".plot { display: none; }"),
]  # fmt: skip


@pytest.mark.parametrize(("width", "look", "fault"), BROKEN)
def test_a_page_that_breaks_is_seen(tab: Tab, run_page: Path, width: int, look: str, fault: str) -> None:
    broken = small(taken(tab, run_page, width, look, fault))
    stored = Image.open(STORED / f"run-{width}-{look}.png").convert("RGB")
    assert differs(broken, stored) > MOST


@pytest.mark.parametrize("width", [390, 1400])
def test_other_fonts_are_no_difference(tab: Tab, run_page: Path, width: int) -> None:
    fonts = "body { font-family: serif !important; font-size-adjust: 0.5; }"  # else some are narrower, whose lines wrap
    other = small(taken(tab, run_page, width, "light", fonts))
    stored = Image.open(STORED / f"run-{width}-light.png").convert("RGB")
    assert differs(other, stored) < MOST
