"""The site of the documentation is built without a warning, and every public name is in it."""

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import assembly as asm

pytest.importorskip("sphinx", reason="the site is Sphinx's: extra `docs`")
ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory, pytestconfig, alone):
    place = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "docs", str(place)]
    if not pytestconfig.getoption("--long"):
        # Without a page of each module's text, which nothing here reads.
        command += ["-D", "extensions=myst_parser,sphinx.ext.autodoc,numpydoc"]
    # Some of its pages are written into the checkout.
    with alone():
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    return place


@pytest.mark.parametrize("room", [asm, asm.proximity, asm.view, asm.cad], ids=lambda room: room.__name__)
def test_every_public_name_has_its_section(site, room):
    page = (site / "generated" / f"{room.__name__}.html").read_text()
    # Modules that are public, `asm.curves` say, have pages of their own.
    # One that is called has a section: `asm.interference`, once the command of that name was imported.
    names = [
        name for name in room.__all__ if not inspect.ismodule(getattr(room, name)) or callable(getattr(room, name))
    ]
    missing = [name for name in names if f'id="{name.lower().replace("_", "-")}"' not in page]
    assert missing == []
    modules = [name for name in room.__all__ if name not in names]
    assert [name for name in modules if not (site / "generated" / f"{room.__name__}.{name}.html").exists()] == []


def test_examples_are_shown_with_their_pictures(site):
    page = (site / "generated" / "examples.html").read_text()
    assert "paper_clips.png" in page and "def take_hold" not in page and "two_clips" in page
    assert (site / "search.html").exists()
