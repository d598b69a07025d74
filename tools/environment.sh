#!/bin/sh
# tools/environment.sh        make .venv what environment.lock says, or leave it alone if it is that already
# tools/environment.sh lock   rewrite environment.lock from pyproject.toml
#
# Called by the Makefile. Needs a POSIX shell and Python >= 3.11. Whatever goes wrong is one sentence and exit 2.
#
# .venv/installed/ is the stamp: copies of the two files that the environment was made from, and the place it was
# made in (scripts in an environment name it, so one that moved is made anew). It goes before anything is changed
# and comes back when all is done, so that an interrupted installation is never taken for a whole one.

set -u
cd "$(dirname "$0")/.." || exit 2
stamp=.venv/installed
log=.venv/install.log
place=$(pwd -P)

fail() {
    printf '%s\n' "$*" >&2
    exit 2
}

say() {
    printf '%s\n' "$*"
}

# --- finding a Python -----------------------------------------------------------------------------------------

version_of() {
    "$1" -c 'import sys; print("%d.%d.%d" % tuple(sys.version_info[:3]))' 2>/dev/null
}

new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

find_python() {
    if [ -n "${PYTHON:-}" ]; then
        version=$(version_of "$PYTHON") ||
            fail "PYTHON=$PYTHON does not run: name a Python 3.11 or newer, as in 'make PYTHON=/usr/bin/python3.12 reports'."
        new_enough "$PYTHON" ||
            fail "PYTHON=$PYTHON is Python $version and wildlab needs 3.11 or newer: name a newer one, or leave PYTHON out to have one looked for."
        python=$PYTHON
        return
    fi
    for python in python3 python3.13 python3.12 python3.11 python3.14 python; do
        if new_enough "$python"; then
            return
        fi
    done
    found=$(version_of python3) && found="python3 is $found" || found="there is no python3 at all"
    fail "No Python 3.11 or newer was found ($found): install one, or name one, as in 'make PYTHON=/opt/python3.12/bin/python3 reports'."
}

# --- installing -----------------------------------------------------------------------------------------------

# Shows one line that counts on a terminal, a line now and then elsewhere.
show_progress() {
    count=0
    while IFS= read -r line; do
        case $line in
        Collecting\ * | Processing\ *.whl*)
            count=$((count + 1))
            if [ -t 1 ]; then
                printf '\r  %d packages fetched ' "$count"
            elif [ $((count % 50)) -eq 0 ]; then
                printf '  %d packages fetched\n' "$count"
            fi
            ;;
        "Installing collected packages"*)
            [ $count -gt 0 ] || continue # wildlab itself, which is not fetched
            if [ -t 1 ]; then printf '\r'; fi
            printf '  %d packages fetched and their hashes checked; now unpacking them\n' "$count"
            ;;
        esac
    done
}

pip_install() {
    {
        # PIP_USER from someone's configuration would send the packages elsewhere.
        PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1 .venv/bin/python -m pip install \
            --no-input --progress-bar off --no-deps "$@" 2>&1
        echo $? >.venv/install.status
    } | tee -a "$log" | show_progress
    [ "$(cat .venv/install.status)" = 0 ] || explain
}

explain() {
    if grep -q 'DO NOT MATCH THE HASHES' "$log"; then
        fail "A package from the index is not the one that environment.lock names by its hash: do not install it; see $log for which, and fetch a clean environment.lock or use another index."
    elif grep -q -i 'No space left' "$log"; then
        fail "The disk is full: free about 3 GB where this folder lies and run make again."
    elif grep -q -E 'ConnectionError|NewConnectionError|Max retries|Name or service|Temporary failure|ProxyError|ConnectTimeout|ReadTimeout|SSLError|Network is unreachable|certificate verify failed' "$log"; then
        fail "The package index cannot be reached: check the network, or the proxy or index in 'pip config list', and run make again (details in $log)."
    elif grep -q 'from versions: none' "$log"; then
        fail "The package index answers nothing for $(sed -n 's/.*requirement \([^ ]*\) (from versions: none).*/\1/p' "$log" | head -n 1): check the network, or the proxy or index in 'pip config list', and run make again (details in $log)."
    elif grep -q 'No matching distribution' "$log"; then
        wanted=$(sed -n 's/^ERROR: No matching distribution found for \([^ ]*\).*/\1/p' "$log" | head -n 1)
        fail "The package index has no $wanted for $(.venv/bin/python --version) on this machine: use another Python from 3.11 to 3.13 ('make PYTHON=python3.12 ...'), or check the index in 'pip config list' (details in $log)."
    fi
    reason=$(grep '^ERROR' "$log" | tail -n 1)
    fail "Installing the packages failed (${reason:-pip stopped without saying why}): see $log, and run make again once that is mended."
}

# Two makes at once would pull the environment from under each other.
take_turn() {
    turn=${TMPDIR:-/tmp}/wildlab-$(id -u)-$(printf '%s' "$place" | cksum | cut -d ' ' -f 1)
    if ! mkdir "$turn" 2>/dev/null; then
        other=$(cat "$turn/process" 2>/dev/null)
        if [ -n "$other" ] && kill -0 "$other" 2>/dev/null; then
            fail "Another make (process $other) is preparing .venv: wait until it is done and run make again."
        fi
    fi
    mkdir -p "$turn" 2>/dev/null && echo $$ >"$turn/process" 2>/dev/null
    trap 'rm -rf "$turn"' EXIT
    trap 'exit 130' INT TERM HUP
}

usable() {
    [ -d "$stamp" ] && [ "$(cat "$stamp/place" 2>/dev/null)" = "$place" ] || return 1
    here=$(version_of .venv/bin/python) || return 1
    # A Python asked for by name is a wish to change; otherwise the one that is there stays.
    [ -z "${PYTHON:-}" ] || [ "${here%.*}" = "${version%.*}" ]
}

create() {
    if [ -z "${PYTHON:-}" ]; then find_python; fi
    "$python" -c 'import venv, ensurepip' 2>/dev/null ||
        fail "$python has no venv module or no pip to put into one: install it (Debian and Ubuntu: 'apt-get install python3-venv') and run make again."
    if [ -e .venv ]; then
        say "Replacing .venv: it was not finished, was made elsewhere, or is not wildlab's own."
        rm -rf .venv 2>/dev/null || fail ".venv cannot be removed: check who owns it, remove it by hand and run make again."
    fi
    free_kb=$(df -Pk . 2>/dev/null | awk 'NR == 2 { print $4 }')
    if [ "${free_kb:-9999999}" -lt 3000000 ] 2>/dev/null; then
        fail "Only $((free_kb / 1024)) MB are free on this disk and the environment needs about 3000: free some and run make again."
    fi
    say "Making the environment .venv with $python ($(version_of "$python")); this happens once and takes some minutes."
    message=$("$python" -m venv .venv 2>&1) ||
        fail "The environment .venv could not be made ($(printf '%s' "$message" | tail -n 1)): check that this folder can be written to and that '$python -m venv' works."
    .venv/bin/python -m pip --version >/dev/null 2>&1 ||
        fail "The new environment has no pip: reinstall $python with its ensurepip module (Debian and Ubuntu: 'apt-get install python3-venv') and run make again."
}

make_environment() {
    if [ -n "${PYTHON:-}" ]; then find_python; fi
    if usable && cmp -s environment.lock "$stamp/environment.lock" && cmp -s pyproject.toml "$stamp/pyproject.toml"; then
        return
    fi
    take_turn
    if usable; then
        cmp -s environment.lock "$stamp/environment.lock" && packages=same || packages=changed
        rm -rf "$stamp"
        if [ $packages = changed ]; then say "environment.lock has changed: updating .venv."; fi
    else
        create
        packages=changed
    fi
    : >"$log"
    if [ $packages = changed ]; then
        # Wheels only: building a package from source would fetch build tools that no hash in the lock covers.
        pip_install --require-hashes --only-binary :all: -r environment.lock
    fi
    pip_install --no-build-isolation --no-index --editable .
    mkdir "$stamp.new" &&
        cp environment.lock pyproject.toml "$stamp.new/" &&
        printf '%s\n' "$place" >"$stamp.new/place" &&
        mv "$stamp.new" "$stamp" || fail "$stamp could not be written: check the disk and run make again."
    say "The environment is ready."
}

# --- locking --------------------------------------------------------------------------------------------------

make_lock() {
    uv=.venv/bin/uv
    if ! [ -x $uv ]; then
        find_python
        folder=$(mktemp -d) || fail "No temporary folder could be made: check TMPDIR."
        trap 'rm -rf "$folder"' EXIT
        { "$python" -m venv "$folder" && "$folder/bin/python" -m pip install --quiet --no-input uv; } >"$folder/log" 2>&1 ||
            fail "uv, which computes the lock, could not be installed ($(tail -n 1 "$folder/log")): check the network and the index in 'pip config list'."
        uv=$folder/bin/uv
    fi
    if [ -n "${LOCK_UPGRADE:-}" ] && [ "$LOCK_UPGRADE" != 0 ]; then set -- --upgrade; else set --; fi
    UV_PYTHON_DOWNLOADS=never "$uv" pip compile --quiet --universal --generate-hashes --python-version 3.11 --all-extras \
        --no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" "$@" \
        pyproject.toml -o environment.lock ||
        fail "The lock could not be computed (uv says why above): environment.lock is as it was."
    say "environment.lock is up to date; 'make test' installs it and runs the tests."
}

case ${1:-environment} in
environment) make_environment ;;
lock) make_lock ;;
*) fail "tools/environment.sh knows 'environment' and 'lock', not '$1'." ;;
esac
