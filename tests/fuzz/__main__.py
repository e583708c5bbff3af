"""Runs cases in this process and says what is wrong with how they ended.

python -m fuzz --seed 7 --count 2000    # ends with exit code 1 if anything is wrong
python -m fuzz --seed 7 --case 31       # one case again; its files stay in the folder that is printed
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import io
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
from pathlib import Path

from fuzz.cases import make_case
from lightfield import cli
from lightfield.commands.shared.terminal import printable
from lightfield.studies.compare import readings as compared

#: A case that takes more of the processor than this is a fault, and one that waits for so long: on a busy
#: machine each second of work takes many.
LONGEST_S, LONGEST_WAIT_S = 60, 1800
#: A line about work that takes long, as every ten seconds on a slow machine.
TIME = r"[\d.]+ (?:s|min|h)"
PROGRESS = re.compile(rf"[a-z][^\n]*: (?:[^\n]*; )?{TIME} so far(?:, about {TIME} left)?\n")


def wrong_with(words: list[str], folder: Path) -> str:
    """Run one command line in a folder; empty when it ended as it may."""
    out, err = io.StringIO(), io.StringIO()
    os.chdir(folder)
    faulthandler.dump_traceback_later(LONGEST_WAIT_S, exit=True)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = cli.main(words)
    except SystemExit as end:  # --help, --version
        code = end.code
    except BaseException:
        return f"escaped: {traceback.format_exc()}"
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_PROF, 0)
    if code in (cli.EXIT_INTERRUPTED, cli.EXIT_TERMINATED):
        sys.exit(code)  # somebody stopped us
    # Of a scene that will do all the same, one word.
    lines = (x for x in err.getvalue().splitlines(True) if not PROGRESS.fullmatch(x))
    message = "".join(x for x in lines if not x.startswith("warning: "))
    if code not in (0, 2):
        return f"exit code {code}: {message}"
    if code == 2 and not (message.startswith("lightfield: ") and message.endswith("\n")):
        return f"not one error: {message}"
    if code == 2 and any(not line.startswith("  ") for line in message.splitlines()[1:]):
        return f"more than one error: {message}"
    if code == 0 and message:
        return f"done, but it complains: {message}"
    if len(message) > 30_000:
        return f"{len(message)} characters of complaint: {message[:2000]}"
    if printable(out.getvalue()) != out.getvalue() or printable(message) != message:
        return "commands to the terminal"
    return ""


def main() -> int:
    """Run the cases; 1 when something is wrong with one."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--case", type=int, help="this one alone, in a folder that stays")
    args = parser.parse_args()
    # No backend: what gets as far as a trace stops there, with an error.
    os.environ.update(LIGHTFIELD_BACKEND="llvm", LIGHTFIELD_LIBLLVM="/nonexistent", MPLBACKEND="Agg")
    os.environ.pop(cli.TRACEBACK_VARIABLE, None)
    faulthandler.register(signal.SIGPROF, chain=True)  # and then the signal ends the process
    # `compare` with readings fits direct light alone.
    fit = compared.fit_readings
    compared.fit_readings = lambda *given, **named: fit(*given, **{**named, "diffuse": None})
    if args.case is not None:
        folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
        words = make_case(args.seed, args.case, folder)
        os.environ[cli.TRACEBACK_VARIABLE] = "1"
        print(f"cd {folder}; lightfield {' '.join(map(repr, words))}", flush=True)
        print(wrong_with(words, folder) or "nothing wrong")
        return 0
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="fuzz-") as place:
        for number in range(args.count):
            shutil.rmtree(folder := Path(place) / "case", ignore_errors=True)
            folder.mkdir()
            words = make_case(args.seed, number, folder)
            print(f"\r--seed {args.seed} --case {number}", end="", file=sys.stderr, flush=True)
            problem = wrong_with(words, folder)
            os.chdir(place)
            if problem:
                wrong += 1
                print(
                    f"\n--seed {args.seed} --case {number}: {' '.join(words)[:300]}\n{problem[:3000]}",
                    flush=True,
                )
    print(f"\n--seed {args.seed}: {args.count} cases, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
