#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian 12 packages that Loci is built and run with, and changes nothing else.
# May be run again at any time: what is there already is left alone, and no network is needed then.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: deploy/setup.sh [--bench] [--checks] [--dry-run]
       deploy/setup.sh --runtime [--dry-run]

Installs the Debian packages that Loci needs (as root, or through sudo).
  --bench    also the libraries that benchmarks compare with
  --checks   also the tools of .ci/run: formatter, linters, clang
  --runtime  only the libraries that the installed programs need
  --dry-run  says what would be installed, and installs nothing
TEXT
}

# What the build, the tests and the demo need.
packages=(
  cmake ninja-build g++ pkg-config
  libeigen3-dev                      # core: small matrices, sparse factorisation
  libzmq3-dev cppzmq-dev             # server, clients: transport
  protobuf-compiler libprotobuf-dev  # the contract
  libsqlite3-dev sqlite3             # storage, and a shell to look into a map file
  libboost1.74-dev                   # server: HTTP (Beast and Asio, headers only)
  libisal-dev                        # server: PNG tiles
  libpng-dev                         # tests: reads them back
  libzstd-dev                        # stored blobs
  zlib1g-dev libbz2-dev              # logs as .gz and .bz2
  libcli11-dev nlohmann-json3-dev    # command line
  libspdlog-dev                      # the server's log lines
  libgtest-dev libgmock-dev          # tests
  jq bzip2                           # the demo reads answers and logs with them
)
# What the programs need where they were not built.
runtime_packages=(
  libzmq5 libprotobuf32 libsqlite3-0 libisal2 libzstd1 zlib1g libbz2-1.0 libspdlog1.10
)
# Peers of the benchmarks. A benchmark without its peer is skipped, and says so.
bench_packages=(libmrpt-maps-dev libopencv-imgproc-dev)
check_packages=(git python3 clang-14 clang-format-14 clang-tidy-14 cppcheck)

dry_run=no
for argument in "$@"; do
  case "$argument" in
    --bench) packages+=("${bench_packages[@]}") ;;
    --checks) packages+=("${check_packages[@]}") ;;
    --runtime) packages=("${runtime_packages[@]}") ;;
    --dry-run) dry_run=yes ;;
    -h | --help) usage; exit 0 ;;
    *) echo "setup: unknown argument $argument" >&2; usage >&2; exit 2 ;;
  esac
done

if ! command -v apt-get > /dev/null; then
  echo "setup: this script knows Debian 12 only (no apt-get here). Packages by their Debian names:" >&2
  printf '  %s\n' "${packages[@]}" >&2
  exit 1
fi
release=$(. /etc/os-release && echo "${ID:-} ${VERSION_ID:-}")
if [ "$release" != "debian 12" ]; then
  echo "setup: written for Debian 12, this is '$release'; trying the same package names" >&2
fi

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2> /dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#packages[@]} packages are installed, nothing to do"
  exit 0
fi
echo "setup: installing ${#missing[@]} of ${#packages[@]} packages: ${missing[*]}"
if [ "$dry_run" = yes ]; then
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo > /dev/null; then
    echo "setup: not root and no sudo here; run as root: apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
apt_options=(-o Acquire::Retries=3 -o DPkg::Lock::Timeout=120 -o Dpkg::Use-Pty=0)
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "${apt_options[@]}" -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get "${apt_options[@]}" -qq install \
  --yes --no-install-recommends "${missing[@]}" > /dev/null
echo "setup: done"
