#!/bin/sh
# Exported FMUs in two more independent importers: sh peers/fmu_importers/run.sh [SERVOTWIN]
# fmi-rs (Rust) steps FMI 2.0 and 3.0 in co-simulation; CasADi integrates FMI 2.0 by its own CVODES. Both trajectories of a
# step of the command are compared with 'servotwin simulate'. Installs what it needs (crates, PyPI, Debian's libclang).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
servotwin=${1:-servotwin}
"$here/../need" /usr/lib/llvm-14/lib/libclang.so.1=libclang1-14
work=${TMPDIR:-/tmp}/servotwin-fmu-importers
mkdir -p "$work"
[ -x "$work/venv/bin/python" ] || python3 -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet casadi==3.8.2 numpy
CARGO_TARGET_DIR="$work/target" cargo build --quiet --manifest-path "$here/fmi_rs/Cargo.toml"
for version in 2 3; do
    "$servotwin" --quiet export fmu --fmi "$version" --out "$work/system$version.fmu"
done
"$work/venv/bin/python" "$here/compare.py" "$servotwin" "$work"
