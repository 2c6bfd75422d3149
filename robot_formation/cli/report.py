"""`formation report`: runs and sweeps as one HTML page, without ROS."""

from __future__ import annotations

import argparse
from pathlib import Path

from robot_formation.cli.parser import Subparsers

DESCRIPTION = """\
Write one HTML page about runs or sweeps that needs nothing from outside: what was run, whether it held the formation,
figures, tables, parameters, versions, the command that repeats it, and BibTeX. Several bags are compared too. The page
stays below 5 MB.
"""


def add_parser(subparsers: Subparsers) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser("report", help="runs and sweeps as one HTML page", description=DESCRIPTION)
    parser.add_argument(
        "sources",
        metavar="BAG|SWEEP_DIR",
        type=Path,
        nargs="+",
        help="bag of a run, or folder of 'formation sweep'; several bags are compared",
    )
    parser.add_argument(
        "--out",
        metavar="FILE.html",
        type=Path,
        help="the page (default: <BAG>_analysis/report.html or SWEEP_DIR/report.html, "
        "comparison.html in the first one's folder for several)",
    )
    parser.add_argument(
        "--namespace", metavar="NS", help="the formations' namespace, where bags hold several formations"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the page and print where it is; return 0, also for runs that lost their leader.

    Raises:
        FormationError: a bag or folder that is given twice, can't be read, or holds neither run nor sweep; or a page
            that can't be written.
    """
    # Imported here, so that the other verbs don't pay for rosbags and matplotlib.
    from robot_formation.reporting.page import write_page
    from robot_formation.reporting.report import default_path, report_page
    from robot_formation.system.files import size_text

    page = write_page(lambda: report_page(args.sources, args.namespace), args.out or default_path(args.sources))
    print(f"report: {page} ({size_text(page.stat().st_size)})")
    return 0
