#!/bin/sh
# MC/DC of the exported C by the samples of its proof: sh peers/mcdc/run.sh [SERVOTWIN [DIAGNOSER]]
# Exports a diagnoser (the shipped one), runs 'servotwin prove' with a clang that measures coverage, and prints lines,
# branches and conditions (MC/DC) of each file, and every outcome that the proof does not show. HOURS and VARIANTS set the
# scope of the proof. Installs clang 19 (Debian; needs the right to install packages).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
servotwin=$(command -v "${1:-servotwin}") || { echo "there is no ${1:-servotwin}: name the program" >&2; exit 1; }
servotwin=$(realpath "$servotwin")
"$here/../need" clang-19=clang-19,libclang-rt-19-dev llvm-profdata-19=llvm-19
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if [ $# -ge 2 ]; then
    diagnoser=$2
else
    diagnoser=$work/aileron.json
    gzip -d -c "$here/../../crates/servotwin-watch/shipped/aileron.json.gz" > "$diagnoser"
fi
"$servotwin" --quiet export c --model "$diagnoser" --out "$work/export"
LLVM_PROFILE_FILE="$work/proof.profraw" "$servotwin" prove "$work/export" \
    --hours "${HOURS:-24}" --variants "${VARIANTS:-100}" --keep "$work/kept" \
    --compiler "clang-19 -O1 -fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc"
llvm-profdata-19 merge "$work/proof.profraw" -o "$work/proof.profdata"
llvm-cov-19 export "$work/kept/1/export.so" -instr-profile="$work/proof.profdata" \
    -ignore-filename-regex='/prove[^/]*$' > "$work/coverage.json"
python3 "$here/coverage.py" "$work/coverage.json"
