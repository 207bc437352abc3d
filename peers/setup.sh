#!/bin/sh
# Creates (once) the Python environment of the peer scripts in peers/.venv.
# Run it again at any time: it only installs what is missing.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
[ -x "$here/.venv/bin/python" ] || python3 -m venv "$here/.venv"
"$here/.venv/bin/python" -m pip install --quiet scikit-learn==1.9.1 numpy
