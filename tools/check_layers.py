#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the dependency rules: fails if a folder includes a header that it may not know.

Run from the repository root. The compiler cannot do this: zmq.h and sqlite3.h lie in /usr/include for
all. Also fails if folders of core include each other in a circle.
"""
import pathlib
import re
import sys

SYSTEM = r"sys/|netinet/|arpa/|linux/|unistd\.h|fcntl\.h|signal\.h|pthread\.h|malloc\.h|poll\.h|termios\.h"
SIMD = r"[a-z]+mmintrin\.h|immintrin\.h"
PROTOBUF = r"google/protobuf/"
GENERATED = "loci/"  # headers that protoc makes from proto/loci/v1
SERVER = ["core/", "storage/", "server/"]
CLIENT = ["core/base/", "core/geometry/", "clients/"]

# folder -> (beginnings of our own headers, outside headers) that it may include; the longest folder that
# fits a file counts, so that each library stays in its room
ALLOWED = {
    "core": (["core/"], rf"Eigen/|{SIMD}"),
    "storage": (["core/", "storage/"], rf"Eigen/|zstd\.h|{SIMD}"),
    "storage/sqlite": (["core/", "storage/"], rf"Eigen/|sqlite3\.h|{SYSTEM}"),
    "server": (SERVER, rf"Eigen/|spdlog/|{SYSTEM}"),
    "server/main.cc": (SERVER, rf"spdlog/|CLI/|{SYSTEM}"),
    "server/server.cc": (SERVER + [GENERATED], rf"spdlog/|{SYSTEM}"),
    "server/http": (["core/", "server/"], r"boost/|nlohmann/"),
    "server/tile": (["core/", "server/"], r"isa-l/|zlib\.h"),
    "server/transport": (["core/base/", "server/"] + [GENERATED], rf"zmq\.hpp|{PROTOBUF}|{SYSTEM}"),
    "server/rpc": (["core/", "server/"] + [GENERATED], rf"spdlog/|{PROTOBUF}"),
    "server/service": (SERVER + [GENERATED], rf"Eigen/|spdlog/|{PROTOBUF}"),
    "server/convert": (SERVER + [GENERATED], rf"Eigen/|{PROTOBUF}"),
    "clients": (CLIENT + [GENERATED], PROTOBUF),
    "clients/cpp": (CLIENT + [GENERATED], rf"zmq\.hpp|{PROTOBUF}|{SYSTEM}"),
    "clients/log": (CLIENT, rf"Eigen/|zlib\.h|bzlib\.h|{SYSTEM}"),
    "clients/simulator": (CLIENT, r"Eigen/"),
    "clients/cli": (CLIENT + [GENERATED], rf"Eigen/|CLI/|nlohmann/|zlib\.h|{PROTOBUF}|{SYSTEM}"),
    "clients/cli/ceres": (["core/", "clients/cli/ceres/"], r"Eigen/|ceres/"),
    "clients/cli/offline": (["core/", "clients/"], rf"Eigen/|CLI/|nlohmann/|{SYSTEM}"),
}
# core has no clock, no thread, no file, and no random number that depends on the standard library
BANNED = {"core": "chrono condition_variable filesystem fstream future iostream mutex random thread".split()}

INCLUDE = re.compile(r'^\s*#\s*include\s*(["<])([^">]+)')
STANDARD = re.compile(r"[a-z_0-9]+$")


def sources():
    for folder in ("core", "storage", "server", "clients"):
        for path in sorted(p for p in pathlib.Path(folder).rglob("*") if p.suffix in {".h", ".cc"}):
            for number, line in enumerate(path.read_text().splitlines(), 1):
                found = INCLUDE.match(line)
                if found:
                    yield path, number, *found.groups()


def rule_for(path):
    fitting = (f for f in ALLOWED if str(path) == f or str(path).startswith(f + "/"))
    return max(fitting, key=len)


def violations():
    for path, number, quote, header in sources():
        rule = rule_for(path)
        ours, outside = ALLOWED[rule]
        if quote == '"':
            good = header.startswith(tuple(ours))
        else:
            good = bool(STANDARD.match(header) or re.match(outside, header))
            good = good and header not in BANNED.get(rule, ())
        if not good:
            yield f"{path}:{number}: {rule} may not include {header}"


def core_room(path):
    """The folder of a file of core; a patch is data that matching reads, and stands before the other places."""
    return "place/patch" if path.startswith("core/place/patch.") else path.split("/")[1]


def core_circles():
    """Folders of core that include each other, directly or through others."""
    includes = {}
    for path, _, quote, header in sources():
        if path.parts[0] == "core" and quote == '"' and header.startswith("core/"):
            source, target = core_room(str(path)), core_room(header)
            if source != target:
                includes.setdefault(source, set()).add(target)

    def reached(start):
        seen, waiting = set(), [start]
        while waiting:
            for target in includes.get(waiting.pop(), ()):
                if target not in seen:
                    seen.add(target)
                    waiting.append(target)
        return seen

    circle = sorted(folder for folder in includes if folder in reached(folder))
    if circle:
        yield "core: these folders include each other in a circle: " + " ".join(circle)


if __name__ == "__main__":
    bad = list(violations()) + list(core_circles())
    print("\n".join(bad) if bad else "layers: every include goes the right way")
    sys.exit(1 if bad else 0)
