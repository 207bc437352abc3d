#!/bin/sh
# Creates (once) the Python environment of the peer scripts in peers/.venv, and
# installs CVODE for peers/cvode and the broker mosquitto with its clients for the tests of `watch` (Debian;
# needs the right to install packages).
# Run it again at any time: it only installs what is missing.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
[ -x "$here/.venv/bin/python" ] || python3 -m venv "$here/.venv"
"$here/.venv/bin/python" -m pip install --quiet scikit-learn==1.9.1 scipy==1.17.1 numpy polars
"$here/need" /usr/include/cvode/cvode.h=libsundials-dev mosquitto=mosquitto mosquitto_sub=mosquitto-clients
