#!/bin/sh
# Sets up a fresh machine, step by step: `tools/setup.sh venv` makes .venv and installs the package with its tools;
# `tools/setup.sh llvm` makes sure of a usable libLLVM; `tools/setup.sh chromium` gets the browser of the tests
# where it can; `tools/setup.sh lock` writes tools/lock.txt anew from the ranges in pyproject.toml. Run from the
# root of the repository (the Makefile does).
# It installs system packages only through apt, and only as root or where sudo asks for no password.
set -eu

VENV=.venv
LOCK=tools/lock.txt
LOCKED_PYTHONS="3.10 3.11 3.12 3.13 3.14" # for which every package of the lock is there as a wheel
LLVM_VERSIONS="22 21 20 19 18 17" # best first; older ones abort the renderer

say() { printf 'set-up: %s\n' "$*" >&2; }
stop() { say "$*"; exit 1; }

# Prints the prefix for commands that need root; fails where there is no right to them.
root_prefix() {
    if [ "$(id -u)" = 0 ]; then echo "env"; return; fi
    command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null && echo "sudo"
}

apt_install() {
    prefix=$(root_prefix) || return 1
    command -v apt-get >/dev/null 2>&1 || return 1
    say "installing $* with apt"
    $prefix env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 -q -y \
        install --no-install-recommends "$@" >&2
}

# The apt lists of a fresh machine are empty; without the right to fetch them we look at what is there.
apt_update_once() {
    [ -z "${APT_UPDATED:-}" ] || return 0
    APT_UPDATED=1
    prefix=$(root_prefix) || return 0
    command -v apt-get >/dev/null 2>&1 || return 0
    $prefix apt-get -o DPkg::Lock::Timeout=300 -qq update >&2 || say "apt-get update failed; using the lists at hand"
}

find_python() {
    for candidate in "${PYTHON:-python3}" python3.13 python3.12 python3.11 python3.10; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

make_venv() {
    python=$(find_python) || stop "Python 3.10 or newer is needed; found $(python3 --version 2>&1 || echo none)." \
        "Install it, or name it: make PYTHON=/path/to/python3"
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
        apt_update_once
        apt_install "$package" || stop "$python has no venv module. Run: sudo apt-get install $package"
    fi
    # Also replaces an environment whose interpreter is gone or that was made in another place.
    if ! "$VENV/bin/python" -c 'import pip' 2>/dev/null; then
        say "making $VENV with $("$python" --version)"
        "$python" -m venv --clear "$VENV" || stop "could not make $VENV with $python"
    fi
    say "installing lightfield and its dependencies"
    version=$("$VENV/bin/python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    case " $LOCKED_PYTHONS " in
        *" $version "*)
            # What is downloaded is what the hashes name, and nothing of it is built: so set-up repeats exactly.
            pip_install --require-hashes --only-binary :all: -r "$LOCK"
            # "compat": a plain path, where Python would else spend a third of its start on finding the package.
            pip_install --no-deps --no-build-isolation --config-settings editable_mode=compat -e .
            ;;
        *)
            say "$LOCK is not made for Python $version: the newest versions that pyproject.toml allows"
            pip_install -e ".[dev,docs]"
            ;;
    esac
}

# Twice, since a long download may break off.
pip_install() {
    for attempt in 1 2; do
        if "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --retries 5 "$@"; then return; fi
        [ "$attempt" = 2 ] || { say "trying once more"; sleep 5; }
    done
    stop "pip could not install the dependencies (see above)"
}

write_lock() {
    "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade --target "$VENV/uv" "uv>=0.9,<1"
    # The package is built with what is locked, too.
    sed -n 's/^requires = \["\(.*\)"\]$/\1/p' pyproject.toml | "$VENV/uv/bin/uv" pip compile pyproject.toml - \
        --quiet --upgrade --universal --python-version "${LOCKED_PYTHONS%% *}" --extra dev --extra docs \
        --generate-hashes --no-build --no-annotate --no-emit-index-url --no-emit-find-links \
        --custom-compile-command "make lock" --output-file "$LOCK"
    say "$LOCK: $(grep -c '==' "$LOCK") versions"
}

find_llvm() { "$VENV/bin/python" -I lightfield/render/backend/llvm.py; }

# Names of the apt package of one version: Ubuntu 24.04 renamed some.
offered_llvm() {
    for version in $LLVM_VERSIONS; do
        for package in "libllvm$version" "libllvm${version}t64"; do
            candidate=$(apt-cache policy "$package" 2>/dev/null | sed -n 's/^ *Candidate: *//p')
            if [ -n "$candidate" ] && [ "$candidate" != "(none)" ]; then echo "$package"; return; fi
        done
    done
    return 1
}

ensure_llvm() {
    [ "${LIGHTFIELD_BACKEND:-auto}" != cuda ] || return 0
    status=0
    findings=$(find_llvm 2>&1) || status=$?
    case $status in
        0) say "libLLVM: $findings"; return ;;
        1) ;;
        2) stop "$findings" ;; # named by the user, and not usable: not ours to overrule
        *) stop "the search for libLLVM failed: $findings" ;;
    esac
    [ -z "$findings" ] || say "not usable: $findings"
    if ! command -v apt-get >/dev/null 2>&1; then
        case $(uname -s) in
            Darwin) stop "no libLLVM 17 or newer. Run: brew install llvm" ;;
            *) stop "no libLLVM 17 or newer. Install LLVM with your package manager (dnf install llvm-libs," \
                "pacman -S llvm-libs), or set LIGHTFIELD_LIBLLVM to its libLLVM.so" ;;
        esac
    fi
    apt_update_once
    package=$(offered_llvm) || stop "no libLLVM 17 or newer, and apt offers none. See https://apt.llvm.org, then:" \
        "sudo apt-get install libllvm19"
    apt_install "$package" || stop "no libLLVM 17 or newer. Run: sudo apt-get install $package"
    findings=$(find_llvm 2>&1) || stop "$package is installed, but no usable libLLVM was found: $findings"
    say "libLLVM: $findings"
}

# Tests of the explorer's page drive Debian's Chromium. Without it they are skipped, and nothing else: so what goes
# wrong here is said, and set-up goes on. (Ubuntu's package of another name asks for a snap, which few machines run.)
ensure_chromium() {
    for name in chromium chromium-browser google-chrome; do
        if command -v "$name" >/dev/null 2>&1; then say "browser for tests: $name"; return 0; fi
    done
    (
        prefix=$(root_prefix) && command -v apt-get >/dev/null 2>&1 && [ -n "$prefix" ] || exit 1
        apt_update_once
        candidate=$(apt-cache policy chromium 2>/dev/null | sed -n 's/^ *Candidate: *//p')
        [ -n "$candidate" ] && [ "$candidate" != "(none)" ] && apt_install chromium
    ) || say "no Chromium: tests of the explorer's page will be skipped. Run: sudo apt-get install chromium"
}

case ${1:-} in
    venv) make_venv ;;
    llvm) ensure_llvm ;;
    chromium) ensure_chromium ;;
    lock) write_lock ;;
    *) stop "usage: tools/setup.sh venv|llvm|chromium|lock" ;;
esac
