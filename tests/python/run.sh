#!/usr/bin/env bash
# The Python package: its wheel is built as `pip install .` builds it, installed where there is no compiler, and tested with
# its tutorial. What is compiled stays in target/python. ABBE_SKIP_PYTHON=1 skips all of it.
set -euo pipefail
cd "$(dirname "$0")/../.."

if [ "${ABBE_SKIP_PYTHON:-}" = 1 ]; then
    echo "Python package: skipped (ABBE_SKIP_PYTHON=1)"
    exit 0
fi
base=${PYTHON:-python3}
place=$PWD/target/python
mkdir -p "$place"

rm -rf "$place/wheels"
CARGO_TARGET_DIR=$place "$base" -m pip wheel -q --disable-pip-version-check --no-deps --wheel-dir "$place/wheels" .

# one environment for each list of packages
hash=$(cksum < tests/python/requirements.txt | cut -d ' ' -f 1)
venv=$place/venv-$hash
if [ ! -e "$venv/.complete" ]; then
    "$base" -m venv --clear "$venv"
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --only-binary=:all: --require-hashes --no-deps \
        -r tests/python/requirements.txt
    touch "$venv/.complete"
fi
env -i PATH="$venv/bin" HOME="$place" "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-deps --no-index \
    --force-reinstall "$place"/wheels/*.whl
# -I: the installed package, not the sources beside
MPLCONFIGDIR=$place "$venv/bin/python" -I -m pytest -q -p no:cacheprovider --rootdir tests/python tests/python
