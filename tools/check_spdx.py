#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the rule that every source file names its licence in its first three lines.

Run from the repository root. Headers must also have #pragma once.
"""
import pathlib
import subprocess
import sys

LINE = "SPDX-License-Identifier: Apache-2.0"
SUFFIXES = {".h", ".cc", ".proto", ".py", ".sh", ".sql", ".js", ".css", ".html", ".service"}
NAMES = {"Dockerfile", "run"}
DATA = "tests/golden/"  # what a program wrote, kept as it is


def problems():
    listed = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    for name in filter(None, listed.stdout.split("\0")):
        path = pathlib.Path(name)
        if name.startswith(DATA) or not path.is_file() or (path.suffix not in SUFFIXES and path.name not in NAMES):
            continue
        text = path.read_text()
        if LINE not in "\n".join(text.splitlines()[:3]):
            yield f"{path}: must say '{LINE}' in its first three lines"
        if path.suffix == ".h" and "#pragma once" not in text:
            yield f"{path}: must have #pragma once"


if __name__ == "__main__":
    bad = list(problems())
    print("\n".join(bad) if bad else "licence lines: every source file has one")
    sys.exit(1 if bad else 0)
