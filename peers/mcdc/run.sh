#!/bin/sh
# MC/DC of an export by other tools: sh peers/mcdc/run.sh EXPORT
# Replays mcdc.csv, which 'servotwin prove EXPORT --vectors 400' writes, compares every outcome, and compares the coverage with
# the branches that gcov counts and with the MC/DC that clang and llvm-cov measure. Needs gcc and Python;
# clang 18 or later is used if it is there: set CLANG, LLVM_PROFDATA and LLVM_COV (Debian: clang-19, llvm-19).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
export_folder=$(cd "$1" && pwd)
clang=${CLANG:-clang-19}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
vectors="$export_folder/mcdc.csv"
table="$export_folder/mcdc_decisions.csv"
cp "$export_folder"/servotwin_*.[ch] "$here/replay.c" .
flags="-std=c99 -D_POSIX_C_SOURCE=200809L -Wall -Wextra -Wconversion -Werror -ffp-contract=off"
status=0
# shellcheck disable=SC2086 # words are split on purpose, here and below
gcc $flags -O2 -o replay ./*.c -lm
./replay < "$vectors" || status=1
gcc $flags -O0 --coverage -o counted ./*.c -lm
./counted < "$vectors" > counted.txt || status=1
gcov --branch-probabilities --json-format ./*.gcda > gcov.txt
python3 "$here/compare.py" gcov "$table" ./*.gcov.json.gz || status=1
if command -v "$clang" > found.txt; then
    $clang $flags -O0 -fprofile-instr-generate -fcoverage-mapping -fcoverage-mcdc -o measured ./*.c -lm
    LLVM_PROFILE_FILE=measured.profraw ./measured < "$vectors" > measured.txt || status=1
    ${LLVM_PROFDATA:-llvm-profdata-19} merge measured.profraw -o measured.profdata
    ${LLVM_COV:-llvm-cov-19} export ./measured -instr-profile=measured.profdata > measured.json
    python3 "$here/compare.py" llvm "$table" measured.json || status=1
else
    echo "no $clang: MC/DC is not compared"
fi
exit $status
