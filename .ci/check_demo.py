"""Checks what a demo leaves behind. Usage: check_demo.py RUN_DIR. Standard library only."""

import hashlib
import html.parser
import json
import math
import pathlib
import re
import sys

STAGES = ["no-contact", "unreachable", "no-plan", "collision", "slip", "threshold", "timeout"]
CELL = {"object", "robots", "order", "method", "trials", "successes", "rate", "wilson95", "failures"}
SMALLEST_REPORT = 300_000  # bytes: the viewer alone is larger


def check(holds, message):
    if not holds:
        sys.exit(f"check_demo: {message}")


def check_results(run):
    results = json.loads((run / "results.json").read_text())
    wanted = {"schema", "version", "commit", "config_sha256", "seed", "cells"}
    check(wanted <= results.keys(), f"results.json: lacks {sorted(wanted - results.keys())}")
    check(results["schema"] == 1, f"results.json: schema {results['schema']}, expected 1")
    sha = hashlib.sha256((run / "config.toml").read_bytes()).hexdigest()
    check(results["config_sha256"] == sha, f"results.json: config_sha256 is not that of config.toml, {sha}")
    cells = results["cells"]
    names = sorted((cell["order"], cell["method"]) for cell in cells)
    expected = sorted((order, method) for order in ("sequential", "parallel") for method in ("vmao", "best-of-k", "top1"))
    check(names == expected, f"results.json: cells {names}, expected {expected}")
    for cell in cells:
        name = f"results.json: {cell['method']}, {cell['order']}"
        check(CELL <= cell.keys(), f"{name}: lacks {sorted(CELL - cell.keys())}")
        check(sorted(cell["failures"]) == sorted(STAGES), f"{name}: failures {sorted(cell['failures'])}")
        counted = cell["successes"] + sum(cell["failures"].values())
        check(counted == cell["trials"] > 0, f"{name}: {counted} trials counted of {cell['trials']}")
        rate = cell["successes"] / cell["trials"]
        check(math.isclose(cell["rate"], rate), f"{name}: rate {cell['rate']}, expected {rate}")
        low, high = cell["wilson95"]
        check(0 <= low <= rate <= high <= 1 and low < high, f"{name}: interval {[low, high]} about {rate}")
    lines = (run / "trials.jsonl").read_text().splitlines()
    trials = sum(cell["trials"] for cell in cells)
    check(len(lines) == trials, f"trials.jsonl: {len(lines)} lines, expected {trials}")


class Page(html.parser.HTMLParser):
    """Collects what a page would load."""

    def __init__(self):
        super().__init__()
        self.loads = []
        self.tag = ""

    def handle_starttag(self, tag, attrs):
        self.tag = tag
        place = "line %d" % self.getpos()[0]
        for name, value in attrs:
            if name in ("src", "href", "srcset", "data", "poster") and re.match(r"\s*(https?:)?//", value or ""):
                self.loads.append(f"{place}: <{tag} {name}={value!r}>")

    def handle_endtag(self, tag):
        self.tag = ""

    def handle_data(self, data):
        if self.tag == "style":
            self.loads += re.findall(r"@import[^;]*|url\(\s*['\"]?(?:https?:)?//[^)]*\)", data)


def check_report(run):
    path = run / "report.html"
    check(path.is_file(), f"{path}: missing")
    check(path.stat().st_size > SMALLEST_REPORT, f"{path}: {path.stat().st_size} bytes, expected over {SMALLEST_REPORT}")
    page = Page()
    page.feed(path.read_text())
    check(not page.loads, f"{path}: loads from elsewhere: {page.loads}")


def main():
    check(len(sys.argv) == 2, "expected one run directory")
    run = pathlib.Path(sys.argv[1])
    for name in ("config.toml", "run.json", "results.json", "trials.jsonl", "data", "models/vmao", "models/top1"):
        check((run / name).exists(), f"{run / name}: missing")
    check_results(run)
    check_report(run)
    print("check_demo: all as it should be", file=sys.stderr)


main()
