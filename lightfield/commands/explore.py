"""`lightfield explore`: a page where effects are switched and parameters dragged, and all follows at once."""

from __future__ import annotations

import argparse
import asyncio
import threading
import webbrowser
from pathlib import Path

from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_option
from lightfield.errors import UsageError
from lightfield.explorer.documents import open_session
from lightfield.explorer.server import serve
from lightfield.explorer.session import Session
from lightfield.explorer.state import History
from lightfield.readings import read_table
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    what = "scene file (.toml), or a session that was saved (.json)"
    add_option(parser, "scene", metavar="SCENE|SESSION", help=what)
    parser.add_argument(
        "data",
        type=Path,
        metavar="DATA",
        nargs="?",
        help="reading table (CSV); without, formula against render",
    )
    add_option(parser, "--effects-file")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    session, history = _session(args)
    output = console(stderr=True)

    def opened(address: str) -> None:
        print(f"open in a browser of this machine: {address}\nCtrl-C ends it", flush=True)
        if not args.no_browser:  # beside: some browsers keep whoever opens them waiting
            threading.Thread(target=show, args=(address,), daemon=True).start()

    def show(address: str) -> None:
        if not webbrowser.open(address):
            output.print("no browser was found here: open the address by hand")

    asyncio.run(serve(session, history, opened))
    return 0


def _session(args: argparse.Namespace) -> tuple[Session, History | None]:
    diffuse = None if args.no_trace else "trace"
    if args.scene.suffix.lower() == ".json":
        if args.data is not None or args.effects_file is not None:
            raise UsageError(
                "a session has its own readings and effects",
                where=str(args.scene),
                rule="SESSION alone, or SCENE with DATA and --effects-file",
                remedy="leave the others out",
            )
        return open_session(args.scene, diffuse)
    scene = with_effects(Scene.load(args.scene), args.effects_file)
    readings = None if args.data is None else read_table(args.data, scene)
    return Session(scene, readings, diffuse), None
