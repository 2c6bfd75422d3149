"""Builds the documentation site, without a network; a warning of Sphinx is an error.

Run: python docs/build_site.py [--out DIR]
It needs the packages of the extra `docs`; neither ROS nor PyBullet.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parent
OUT = DOCS.parent / "build" / "site"


def main() -> int:
    """Build the site of a copy of this folder, into which pages are written; return an exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the site (default: build/site)")
    out: Path = parser.parse_args().out
    try:
        from sphinx.cmd.build import build_main
    except ImportError:
        print("Sphinx is missing; install the extra: pip install -e '.[docs]'", file=sys.stderr)
        return 2
    sys.path.insert(0, str(DOCS.parent))  # the copy's conf.py finds the package there
    with tempfile.TemporaryDirectory(prefix="robot_formation_site_") as folder:
        source = Path(folder) / "docs"
        shutil.copytree(DOCS, source, ignore=shutil.ignore_patterns("__pycache__"))
        options = ("-W", "--keep-going", "-q", "-E", "-b", "html", "-d", f"{folder}/trees")
        code = build_main([*options, str(source), str(out)])
    if code == 0:
        print(f"site: {out / 'index.html'}")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
