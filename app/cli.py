"""The command `paikka`: serve, list, run, export, check."""

import argparse
import logging
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from app import commands
from app.commands import UsageError

USAGE_ERROR = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: 0 well, 1 something failed, 2 the command was wrong."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or (given[0].startswith("-") and given[0] not in ("-h", "--help", "--version")):
        given.insert(0, "serve")
    options = _parser().parse_args(given)
    logging.basicConfig(level=logging.INFO if getattr(options, "verbose", False) else logging.WARNING,
                        format="%(levelname)s %(name)s: %(message)s")
    try:
        return options.command(options)
    except UsageError as error:
        print(f"paikka: {error}", file=sys.stderr)
        return USAGE_ERROR
    except (RuntimeError, OSError) as error:
        print(f"paikka: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paikka", description="An interactive laboratory for the mathematics of positioning.",
        epilog="Without a command, the lessons are served.")
    parser.add_argument("--version", action="version", version=f"paikka {_version()}")
    chosen = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, action: Any, help_text: str) -> argparse.ArgumentParser:
        made = chosen.add_parser(name, help=help_text, description=help_text)
        made.set_defaults(command=action)
        made.add_argument("--lessons", metavar="DIR", type=Path, help="also take the lessons of this folder")
        return made

    serve = command("serve", commands.serve, "Serve the lessons to browsers on this machine.")
    serve.add_argument("--host", default="127.0.0.1", help="address to listen on (default: only this machine)")
    serve.add_argument("--port", type=_port, default=8080, help="port; the next free one if it is taken")
    serve.add_argument("--lesson", metavar="ID", help="the lesson that opens first")
    _file_option(serve)
    serve.add_argument("--no-open", action="store_true", help="do not open a browser")
    serve.add_argument("--allow-host", action="append", default=[], metavar="NAME",
                       help="a name under which other machines may ask for this server; may be repeated")
    serve.add_argument("--verbose", action="store_true", help="log what happens")

    listing = command("list", commands.list_lessons, "List the lessons.")
    listing.add_argument("--json", action="store_true", help="with parameters and presets, as JSON")

    run = command("run", commands.run, "Compute a lesson without a browser and print its numbers.")
    _scenario_options(run)
    run.add_argument("--json", action="store_true", help="as JSON")

    export = command("export", commands.export, "Write a lesson's scene, a plot or its numbers to a file.")
    _scenario_options(export)
    export.add_argument("--to", required=True, type=Path, metavar="FILE",
                        help=".png (scene; plot with --figure), .svg, .pdf, .html (plot), .csv, .json (numbers)")
    export.add_argument("--size", type=_size, default=None, metavar="WxH", help="pixels, e.g. 1920x1080")
    export.add_argument("--transparent", action="store_true", help="no background")
    export.add_argument("--figure", metavar="NAME", help="the plot to write instead of the scene")
    export.add_argument("--no-legend", action="store_true", help="without caption and legend")

    _study_options(command("study", commands.study, "Compare filters over many walks and write the table."))

    check = command("check", commands.check, "Run every lesson at default, presets and limits; print what is wrong.")
    check.add_argument("--json", action="store_true", help="as JSON")
    check.add_argument("--map", "--data", action="append", default=[], type=Path, metavar="FILE", dest="files",
                       help="check this file instead of the lessons; may be repeated")
    return parser


def _study_options(study: argparse.ArgumentParser) -> None:
    study.add_argument("subject", choices=["indoor"], help="what is compared: the filters of the indoor laboratory")
    study.add_argument("--routes", type=_count, default=10, metavar="R", help="random walks through the building")
    study.add_argument("--seeds", type=_count, default=20, metavar="S", help="draws of the noise for each walk")
    study.add_argument("--particles", type=_count, default=1000, metavar="N", help="of the graph filters")
    study.add_argument("--to", type=Path, default=Path("study"), metavar="DIR",
                       help="folder for runs.csv, table.csv and table.md; a study in it is gone on with")
    study.add_argument("--map", action="append", default=[], type=Path, metavar="FILE", dest="files",
                       help="another building than our own")


def _file_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--data", "--map", action="append", default=[], type=Path, metavar="FILE", dest="files",
                        help="a file for the lessons that take one: a map, measurements; may be repeated")


def _scenario_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("lesson", metavar="LESSON", help="id, as `paikka list` prints it")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", dest="changes",
                        help="a parameter; may be repeated")
    parser.add_argument("--preset", metavar="NAME", help="start from this preset")
    _file_option(parser)
    parser.add_argument("--step", type=int, metavar="K", help="the step of the timeline")
    parser.add_argument("--stage", metavar="NAME", help="the stage within the step")


def _port(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to 65535, got {text!r}")
    return int(text)


def _count(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 to 1,000,000, got {text!r}")
    return int(text)


def _size(text: str) -> tuple[int, int]:
    from app.picture import MAX_SIDE

    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and 16 <= int(width) <= MAX_SIDE and 16 <= int(height) <= MAX_SIDE):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, each 16 to {MAX_SIDE}, e.g. 1920x1080, got {text!r}")
    return int(width), int(height)


def _version() -> str:
    try:
        return version("paikka")
    except PackageNotFoundError:
        return "0 (not installed)"


if __name__ == "__main__":
    sys.exit(main())
