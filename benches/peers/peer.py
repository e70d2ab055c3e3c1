"""What every comparison needs: a virtual environment with pinned peers, our programs, CPU time, and a table.

A script starts with `peer.environment("ik", [...])`; that makes target/peers/ik once and runs the script again inside it.
"""

import os
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def environment(name, requirements):
    """Runs the calling script in a virtual environment that holds exactly these pinned requirements."""
    home = ROOT / "target" / "peers" / name
    python = home / "bin" / "python3"
    stamp = home / "requirements.txt"
    wanted = "\n".join(requirements) + "\n"
    if not stamp.exists() or stamp.read_text() != wanted:
        venv.create(home, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *requirements], check=True)
        stamp.write_text(wanted)
    if Path(sys.prefix).resolve() != home.resolve():
        os.execv(python, [str(python), *sys.argv])


def cargo(package, kind, name):
    """Builds one of our programs in release mode (kind: `bin` or `example`) and returns its path."""
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", package, f"--{kind}", name], cwd=ROOT, check=True)
    folder = ROOT / "target" / "release"
    return folder / "examples" / name if kind == "example" else folder / name


def cpu_seconds(work):
    """CPU time of this process, all its threads, spent in `work()`, and what it returned."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def median(values):
    """The middle value; of an even number, the mean of the two in the middle."""
    ordered = sorted(values)
    half = len(ordered) // 2
    return ordered[half] if len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2


def table(header, rows):
    """Prints a Markdown table."""
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
