"""The page in the package is the one that its sources make, small, and asks nobody for anything."""

import hashlib
import re
from pathlib import Path

from vnca.recipe.film import FilmConfig
from vnca.viewer import PAGE, POLICY, page_file

ROOT = Path(__file__).parents[2]
MOST_BYTES = 1_000_000


def digest() -> str:
    """As `web/build.mjs` has it."""
    listed = {
        path.relative_to(ROOT / "web").as_posix(): path
        for path in (ROOT / "web/src").rglob("*")
        if path.suffix in (".ts", ".wgsl", ".css", ".html")
    }
    engine = (ROOT / "src/vnca/engine/wgsl").glob("*.wgsl")
    listed |= {f"engine/{path.name}": path for path in engine}
    found = hashlib.sha256()
    for name in sorted(listed):
        found.update(name.encode() + b"\0" + listed[name].read_bytes() + b"\0")
    return found.hexdigest()


def test_the_built_page_is_not_older_than_its_sources() -> None:
    """If it is: `npm ci && npm run build` in web/."""
    head = page_file("viewer.js")[:200].decode()
    match = re.search(r"sources ([0-9a-f]{64})", head)
    assert match is not None
    assert match[1] == digest()


def test_it_is_small_and_names_no_host() -> None:
    files = {name: page_file(name) for name in PAGE}
    assert sum(map(len, files.values())) < MOST_BYTES
    for name, content in files.items():
        hosts = set(re.findall(rb"https?://[\w.]+", content))
        assert hosts <= {b"http://www.w3.org"}, name  # the name of SVG's elements


def test_smoke_is_lit_on_the_page_as_in_films() -> None:
    source = (ROOT / "web/src/settings.ts").read_text()
    defaults = dict(re.findall(r"^  (\w+): (-?[\d.]+),$", source, re.MULTILINE))
    names = ("light", "light_azimuth", "light_elevation", "ambient")
    of_page = {
        name: float(defaults[re.sub("_(.)", lambda m: m[1].upper(), name)]) for name in names
    }
    assert of_page == {name: getattr(FilmConfig(), name) for name in names}


def test_the_page_has_the_policy_that_its_server_sends() -> None:
    assert f'content="{POLICY}"' in page_file("index.html").decode()


def test_the_lock_of_its_tools_names_no_host() -> None:
    assert "http" not in (ROOT / "web/package-lock.json").read_text()
